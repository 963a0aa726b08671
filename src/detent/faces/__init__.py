"""How other people's software reaches an axis, or what stands in for a machine."""
