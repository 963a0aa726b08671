"""Firmware from an axis: its controller as C99, golden vectors of a simulated job, and the proof that both agree."""
