"""An environment, a mapping and a listener of my own."""
