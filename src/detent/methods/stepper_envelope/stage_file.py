"""Jobs of stepper stages, read from files: lists of places as CSV, moves and manual runs as TOML."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from detent.files.job_text import read_text
from detent.methods.stepper_envelope.stage_csv import parse_stage_csv
from detent.methods.stepper_envelope.stage_job import StageJob
from detent.methods.stepper_envelope.stage_rows import check_motors
from detent.methods.stepper_envelope.stage_toml import parse_stage_toml


def load_stage_job(path: str | PathLike[str], motors: Sequence[str]) -> StageJob:
    """Read the job of a stepper stage; the ending of the name says what it is."""
    file = str(Path(path))
    text = read_text(path, (".csv", ".toml"), "a list of places (.csv) or of moves (.toml)")
    check_motors(file, motors)
    if Path(path).suffix.lower() == ".csv":
        return parse_stage_csv(file, text, motors)
    return parse_stage_toml(file, text, motors)
