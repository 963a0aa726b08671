"""The command line: the only place that parses arguments or prints."""

from detent.cli import check, docs, export, identify, live, look, run, start, tolerance, tune
from detent.cli.app import app, main

__all__ = ["app", "check", "docs", "export", "identify", "live", "look", "main", "run", "start", "tolerance", "tune"]
