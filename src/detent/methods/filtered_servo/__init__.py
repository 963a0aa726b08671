"""The filtered servo's part of the axis file."""
