"""The command line: the only place that parses arguments or prints."""

from detent.cli import check, identify, look, run
from detent.cli.app import app, main

__all__ = ["app", "check", "identify", "look", "main", "run"]
