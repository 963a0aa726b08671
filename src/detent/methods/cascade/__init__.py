"""The cascade axis's part of the axis file."""
