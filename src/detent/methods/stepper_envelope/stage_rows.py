"""What the rows of every file of stage moves have in common: words that name no motor, and checks of their values."""

from collections.abc import Sequence
from pathlib import PurePath

from detent.errors import InputError
from detent.files.job_rows import JobRows
from detent.files.job_values import MAX_SHOWN, RefusedValueError
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove

StageRows = JobRows[StageMove | StageJog]

KEYS = ("by", "turn", "changed_at", "changed_to", "jog", "speed", "duration", "dwell", "repeat", "label")
"""Keys of a row beside the names of motors."""

WORDS = (*KEYS, "tile")
"""What the files say beside the names of motors."""


def check_motors(file: str, motors: Sequence[str]) -> None:
    """Refuse motors that no file could tell from its own words."""
    taken = [motor for motor in motors if motor in WORDS]
    if taken:
        came = f'an axis with a motor named "{taken[0]}"'
        allowed = f"motors that are not named as words of a job: {', '.join(WORDS)}"
        raise InputError.of_file(file, came, allowed, "rename the motor in the axis file")


def check_label(text: str) -> str:
    """Check what a move is called."""
    if len(text) > MAX_SHOWN:
        raise RefusedValueError("", f"up to {MAX_SHOWN} characters", "shorten it")
    if not text.isprintable():
        raise RefusedValueError("", "printable characters", "remove the others")
    return text


def to_stage_job(
    rows: StageRows, motors: Sequence[str], *, kind: str, repeat: int = 1, notes: tuple[str, ...] = ()
) -> StageJob:
    """Make the rows a job that does the list `repeat` times."""
    moves = rows.written_out(repeat, missing=f"add a move with a place for {' or '.join(motors)}")
    named = {motor for move in moves for motor in move.motors}
    return StageJob(PurePath(rows.file).name, kind, moves, tuple(motor for motor in motors if motor in named), notes)
