"""detent: positioning control as software."""

__version__ = "0.1.0"
