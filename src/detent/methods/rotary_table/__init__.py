"""The rotary table's part of the axis file."""
