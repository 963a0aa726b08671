"""Files of stage moves as TOML: a `[[move]]` table each, its keys the names of the motors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

from detent.files.job_rows import EXAMPLE_UNITS, check_count, check_dwell
from detent.files.job_toml import JobTables, unknown_key
from detent.files.job_values import RefusedValueError, read_text_quantity, read_whole_number
from detent.methods.moves.move_toml import read_repeat
from detent.methods.stepper_envelope.stage_job import Change, StageJob, StageJog, StageMove
from detent.methods.stepper_envelope.stage_rows import KEYS, StageRows, check_label, to_stage_job

_UNITS = {"turn": "m", "changed_at": "m", "changed_to": "m", "speed": "m/s", "duration": "s", "dwell": "s"}
_ANY_ROW = ("dwell", "repeat", "label")
_MOVE_ONLY = ("by", "turn", "changed_at", "changed_to")
_JOG_ONLY = ("speed", "duration")
_ONE_MOTOR = "in a move of exactly one motor"


def parse_stage_toml(file: str, text: str, motors: Sequence[str]) -> StageJob:
    """Read a file of stage moves from TOML.

    Each ``[[move]]`` names motors: ``x = "12 mm"`` is a place, ``by = {x = "1 mm"}`` a way from the place before. A
    move of one motor may have a ``turn``, or ``changed_at`` and ``changed_to``. With ``jog = "x"``, ``speed`` and
    ``duration`` it is a manual run instead. Each may have ``dwell``, ``repeat`` and ``label``. A ``repeat`` before the
    first of them does the whole list so many times.
    """
    rows = StageRows(file)
    tables = JobTables(file, text, ("move",), rows.problems)
    repeat = read_repeat(tables, (*motors, *KEYS))
    for index, table in enumerate(tables.tables("move")):
        if rows.is_over:
            break
        known = len(rows.problems)
        row = _Row(tables.line("move", index), "jog" in table, tuple(motors))
        _read_row(tables, row, index, table)
        if len(rows.problems) == known and row.is_whole:
            rows.add(row.to_move(), row.numbers.get("repeat", 1))
    return to_stage_job(rows, motors, kind="moves", repeat=repeat)


@dataclass(slots=True)
class _Row:
    """One ``[[move]]``, as far as it could be read; values in SI units, ways under ``by.x``."""

    line: int
    is_jog: bool
    motors: tuple[str, ...]
    numbers: dict[str, float] = field(default_factory=dict[str, float])
    words: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that it may have."""
        return ("jog", *_JOG_ONLY, *_ANY_ROW) if self.is_jog else (*self.motors, *_MOVE_ONLY, *_ANY_ROW, "jog")

    @property
    def targets(self) -> dict[str, float]:
        """Places [m]."""
        return {motor: self.numbers[motor] for motor in self.motors if motor in self.numbers}

    @property
    def by(self) -> dict[str, float]:
        """Ways [m]."""
        return {motor: self.numbers[f"by.{motor}"] for motor in self.motors if f"by.{motor}" in self.numbers}

    @property
    def is_whole(self) -> bool:
        """True when it says enough for a move; where lines were left out, it may not."""
        if self.is_jog:
            return {"jog", *_JOG_ONLY} <= {*self.numbers, *self.words}
        has_change = ("changed_at" in self.numbers) == ("changed_to" in self.numbers)
        return bool(self.targets or self.by) and has_change

    def read(self, key: str, value: object) -> None:
        """Take one value, or refuse it."""
        if key in {"label", "jog"}:
            self.words[key] = self._read_words(key, value)
        elif key == "repeat":
            self.numbers[key] = check_count(read_whole_number(key, value))
        else:
            self.numbers[key] = self._read_quantity(key, value)

    def _read_words(self, key: str, value: object) -> str:
        if not isinstance(value, str):
            example = f'{key} = "{self.motors[0] if key == "jog" else "overview"}"'
            raise RefusedValueError("", "a text", f"write it in quotes, as in {example}")
        if key == "label":
            return check_label(value)
        if value not in self.motors:
            raise RefusedValueError("", f"a motor: {', '.join(self.motors)}", "name a motor of the axis file")
        return value

    def _read_quantity(self, key: str, value: object) -> float:
        table, _, motor = key.rpartition(".")
        if table == "by":
            if motor not in self.motors:
                raise unknown_key(motor, self.motors, "in by")
        elif key == "by":
            example = f'by = {{{self.motors[0]} = "1 mm"}}'
            raise RefusedValueError("", f"a way for each motor, as in {example}", f"write {example}")
        elif key not in self.keys:
            raise self._unknown(key)
        unit = _UNITS.get(key, "m")
        number = read_text_quantity(key, value, unit, f"12 {EXAMPLE_UNITS[unit]}")
        if key == "dwell":
            return check_dwell(number)
        if key == "duration" and number <= 0:
            raise RefusedValueError("", "more than 0 ms", "write how long the motor is driven by hand")
        if key == "speed" and number == 0:
            raise RefusedValueError("", "a speed other than 0 mm/s", "write a minus for the negative direction")
        return number

    def _unknown(self, key: str) -> RefusedValueError:
        """Error for a key that this kind of row does not have."""
        error = unknown_key(key, self.keys, "in a [[move]] with jog" if self.is_jog else "in [[move]]")
        if self.is_jog and key in (*self.motors, *_MOVE_ONLY):
            return RefusedValueError(f'the key "{key}" beside jog', error.allowed, "give it a [[move]] of its own")
        if not self.is_jog and key in _JOG_ONLY:
            remedy = f'remove it, for the tables decide how fast; or add jog = "{self.motors[0]}" for a manual run'
            return RefusedValueError(f'the key "{key}" without jog', error.allowed, remedy)
        if not self.is_jog and key == "target":
            remedy = f'name the motor, as in {self.motors[0]} = "12 mm"'
            return RefusedValueError(error.came, error.allowed, remedy)
        return error

    def to_move(self) -> StageMove | StageJog:
        """The move, not numbered yet."""
        n, label, dwell = self.numbers, self.words.get("label", ""), self.numbers.get("dwell", 0.0)
        if self.is_jog:
            return StageJog(1, self.line, self.words["jog"], n["speed"], n["duration"], dwell, label)
        change = Change(n["changed_at"], n["changed_to"]) if "changed_at" in n else None
        return StageMove(1, self.line, self.targets, self.by, dwell, label, n.get("turn"), change)


def _read_row(tables: JobTables, row: _Row, index: int, table: Mapping[str, Any]) -> None:
    """Read one move; what is wrong is noted."""
    values = dict(_flat(table))
    for key, value in values.items():
        try:
            row.read(key, value)
        except RefusedValueError as error:
            tables.refuse("move", index, key, value, error)
    for key, error in _row_faults(row, set(values), is_whole=tables.is_whole):
        tables.refuse("move", index, key, None, error)


def _flat(table: Mapping[str, Any]) -> Iterator[tuple[str, object]]:
    """Keys with their values; those inside ``by`` as ``by.x``."""
    for key, value in table.items():
        if key == "by" and isinstance(value, dict):
            yield from ((f"by.{motor}", way) for motor, way in cast("dict[str, object]", value).items())
        else:
            yield key, value


def _row_faults(row: _Row, stated: set[str], *, is_whole: bool) -> Iterator[tuple[str, RefusedValueError]]:
    """What is wrong with a row as a whole: the key to which that is told, and the error."""
    if row.is_jog:
        if is_whole:
            yield from _missing(stated, {"speed": '"5 mm/s"', "duration": '"0.5 s"'}, "of a jog")
        return
    ways = [motor for motor in row.motors if {motor, f"by.{motor}"} & stated]
    for motor in ways:
        if {motor, f"by.{motor}"} <= stated:
            allowed = f"{motor} (a place) or by.{motor} (a way from the place before)"
            yield f"by.{motor}", RefusedValueError(f"{motor} and by.{motor}", allowed, "remove one of the two")
    if not ways and is_whole and "by" not in stated:
        motor = row.motors[0]
        remedy = f'add {motor} = "12 mm" or by = {{{motor} = "1 mm"}}'
        yield "", RefusedValueError("no motor", f"a place or a way for at least one of {', '.join(row.motors)}", remedy)
    yield from _extreme_faults(ways, stated, is_whole=is_whole)


def _extreme_faults(
    ways: Sequence[str], stated: set[str], *, is_whole: bool
) -> Iterator[tuple[str, RefusedValueError]]:
    """What is wrong with a turn, or with a stop that is changed on the way."""
    changed = [key for key in ("changed_at", "changed_to") if key in stated]
    if changed and is_whole:
        yield from _missing(stated, {"changed_at": '"8 mm"', "changed_to": '"12 mm"'}, "of a stop changed on the way")
    if "turn" in stated and changed:
        came, allowed = f"turn and {changed[0]}", "one of them: the motor would pass the place twice"
        yield changed[0], RefusedValueError(came, allowed, "divide the move into two")
    if len(ways) > 1:
        for key in [key for key in ("turn", *changed) if key in stated][:1]:
            came = f"{key} in a move of {len(ways)} motors"
            yield key, RefusedValueError(came, f"{key} {_ONE_MOTOR}", "give the motor a [[move]] of its own")


def _missing(stated: set[str], needed: Mapping[str, str], what: str) -> Iterator[tuple[str, RefusedValueError]]:
    """Keys that belong together and are not all there."""
    for key, example in needed.items():
        if key not in stated:
            yield "", RefusedValueError(f"no {key}", f"{' and '.join(needed)} {what}", f"add {key} = {example}")
