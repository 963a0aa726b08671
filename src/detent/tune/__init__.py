"""Gains with margins: chosen on the linear model of an axis, over all that its file does not know."""
