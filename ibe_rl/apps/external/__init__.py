"""apps/external."""
