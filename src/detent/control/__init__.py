"""The laws: what the axis computer and its supervisor decide."""
