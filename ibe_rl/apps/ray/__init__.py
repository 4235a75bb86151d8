"""apps/ray."""
