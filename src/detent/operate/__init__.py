"""An axis under somebody's hand: the loop in wall time, commands, faults, and what survives."""
