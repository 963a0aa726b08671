"""From constants to an axis file."""
