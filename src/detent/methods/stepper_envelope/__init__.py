"""The stepper envelope's part of the axis file."""
