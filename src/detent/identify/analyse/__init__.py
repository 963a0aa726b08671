"""What one log tells without a model of the whole axis."""
