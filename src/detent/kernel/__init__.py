"""The core abstraction: register files, steps that work on them, and the compiled cache."""
