"""The phase servo's part of the axis file."""
