"""Advance an axis in simulated time; runs and their traces."""
