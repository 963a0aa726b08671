"""A bang-bang positioner for detent."""
