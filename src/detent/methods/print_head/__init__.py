"""The axis file of the print-head method: its tables, rules, derived figures, warnings, and what it builds."""
