"""The command line: the only place that parses arguments or prints."""

from detent.cli import analyse, check, examples, identify, look, run
from detent.cli.app import app, main

__all__ = ["analyse", "app", "check", "examples", "identify", "look", "main", "run"]
