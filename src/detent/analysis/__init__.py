"""Closed forms about loops: what the mathematics says of an axis before it moves."""
