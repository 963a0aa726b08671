"""The axis file: one description of an axis, checked as a whole, with exact places in every message."""
