"""From a cleaned log to constants with intervals, and a verdict."""
