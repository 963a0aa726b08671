"""An axis that a person stands in front of: what survives of it when the power goes."""
