"""Jobs of stepper stages: moves of one motor or of several at once, and manual runs of one.

A stage goes to a place with every motor that the move names, and stands there for a while: a microscope takes a
picture of a tile then. A move of one motor may also turn on its way, or have its stop extreme changed while it runs; a
manual run is what an operator does with a joystick. Everything is in SI units, and nothing is known of the motors but
their names, and which of them turn: what is said to be in m is in rad for those.

In TOML each ``[[move]]`` names motors: ``x = "12 mm"`` is a place, ``by = {x = "1 mm"}`` a way from the place before.

In CSV a column is the motor's ``x`` if its heading is ``x [mm]``, ``x_mm``, or ``x_mm_`` with further words. Of several
columns of one motor that with the word "nominal" is taken: the place asked for, not what an encoder read there. Other
columns than those of `CSV_KEYS` are passed over; with ``tile`` the file is a list of tiles.
"""

from __future__ import annotations

import difflib
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, ClassVar, cast

from pydantic import AfterValidator, ValidationInfo, create_model
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from detent.axisfile.motion import unit_in
from detent.errors import FileProblem
from detent.files.fields import Table, Unit, extra_of, optional
from detent.files.quantities import Angle, Length, Time, Velocity
from detent.files.read import Row, check_values, example_value, read_tables
from detent.files.read_csv import Column, CsvRows, split_heading
from detent.files.screen import OnScreen
from detent.files.source import parse_source
from detent.files.text import MAX_SHOWN, read_text, short
from detent.methods.changes import ParameterChange, read_changes
from detent.methods.moves.job import MOST_MOVES, MoveFile, expand_moves
from detent.units import QuantityError, describe_kind, parse_quantity


def _check_label(text: str) -> str:
    if len(text) > MAX_SHOWN or not text.isprintable():
        raise PydanticCustomError("refused", "not a label", {})
    return text


def _check_speed(speed: float | None) -> float | None:
    if speed == 0:
        raise PydanticCustomError("refused", "no motion", {"remedy": "write a minus for the negative direction"})
    return speed


Label = Annotated[str, AfterValidator(_check_label)]

CSV_KEYS = ("dwell", "repeat", "label", "tile")  # keys beside the motors that a list of places may have
# A name such as ``x_um`` may end in these units.
_NAME_UNITS = {"m": ("um", "mm", "cm", "m", "in"), "rad": ("arcsec", "arcmin", "deg", "rad"), "s": ("us", "ms", "s")}
_EXAMPLES = {"m": ("12 mm", "1 mm"), "rad": ("90 deg", "5 deg")}  # of a place and of a way
_OF_ONE_MOTOR = {"turn": "m", "changed_at": "m", "changed_to": "m", "speed": "m/s"}
"""Keys of a row in units of the one motor that it names, with their units where it slides."""
_PREFERRED = "nominal"
_MOST_NAMED = 12
_LABEL = f"text of up to {MAX_SHOWN} printable characters"


class StageRow(Row, frozen=True):
    """A move or a manual run as a file says it; `stage_row` adds the motors, whose keys are places."""

    motors: ClassVar[tuple[str, ...]] = ()
    turning: ClassVar[frozenset[str]] = frozenset()
    by: Table | None = optional("ways of motors from the places before", None)
    turn: Length | None = optional("where the motor turns before it goes to its place", None)
    changed_at: Length | None = optional("where the motor is when its stop is changed", None)
    changed_to: Length | None = optional("the new stop", None)
    jog: str | None = optional("the motor that is driven by hand", None)
    speed: Annotated[Velocity | None, AfterValidator(_check_speed)] = optional(
        "speed of a manual run", None, allowed="a velocity other than 0 mm/s"
    )
    duration: Time | None = optional("how long the motor is driven by hand", None, gt=0)
    dwell: Time = optional("how long the stage stands after it is ready", 0.0, ge=0)
    repeat: int = optional("how often it is done in succession", 1, ge=1, le=MOST_MOVES)
    label: Label = optional("what it is for", "", allowed=_LABEL)

    @classmethod
    def faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """Keys that do not go together, or that the row lacks."""
        yield from (cls._jog_faults if "jog" in stated else cls._move_faults)(stated, is_whole=is_whole)
        yield from cls._unit_faults(stated)

    @classmethod
    def unit(cls, motor: str, linear: str = "m") -> str:
        """Unit of a quantity of a motor, by that of a motor that slides."""
        return unit_in("rotary" if motor in cls.turning else "linear", linear)

    @classmethod
    def _motors_in(cls, stated: Mapping[str, Any]) -> list[str]:
        """Motors that an automatic move names."""
        by = cast("dict[str, Any]", stated["by"]) if isinstance(stated.get("by"), dict) else {}
        return [motor for motor in cls.motors if motor in stated or motor in by]

    @classmethod
    def _unit_faults(cls, stated: Mapping[str, Any]) -> Iterator[FileProblem]:
        """What is not in a unit of the one motor that the row names, where some slide and some turn."""
        named = [stated["jog"]] if "jog" in stated else cls._motors_in(stated)
        is_mixed = 0 < len(cls.turning) < len(cls.motors)
        motor = named[0] if is_mixed and len(named) == 1 and named[0] in cls.motors else ""
        for key in (key for key in _OF_ONE_MOTOR if motor and key in stated):
            unit, value = cls.unit(motor, _OF_ONE_MOTOR[key]), stated[key]
            try:
                parse_quantity(value if isinstance(value, str) else "", unit)
            except QuantityError as error:
                allowed = f"{describe_kind(unit)[0]}: the motor {motor} {'turns' if motor in cls.turning else 'slides'}"
                yield FileProblem.of_key(key, "", allowed, error.remedy)

    @classmethod
    def _jog_faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """What is wrong with a manual run as a whole."""
        if isinstance(stated["jog"], str) and stated["jog"] not in cls.motors:
            allowed = f"a motor: {', '.join(cls.motors)}"
            yield FileProblem.of_key("jog", "", allowed, "name a motor of the axis file")
        for key in stated:
            if key in (*cls.motors, "by", "turn", "changed_at", "changed_to"):
                allowed, remedy = "beside jog: speed, duration, dwell, repeat, label", "give it a [[move]] of its own"
                yield FileProblem.of_key(key, f'the key "{key}" beside jog', allowed, remedy)
        if is_whole:
            yield from cls._lacking(stated, ("speed", "duration"), "of a jog")

    @classmethod
    def _move_faults(cls, stated: Mapping[str, Any], *, is_whole: bool) -> Iterator[FileProblem]:
        """What is wrong with an automatic move as a whole."""
        by = cast("dict[str, Any]", stated["by"]) if isinstance(stated.get("by"), dict) else {}
        ways = cls._motors_in(stated)
        for key in ("speed", "duration"):
            if key in stated:
                remedy = f'remove it, for the tables decide how fast; or add jog = "{cls.motors[0]}" for a manual run'
                yield FileProblem.of_key(key, f'the key "{key}" without jog', "speed and duration of a jog", remedy)
        for motor in (motor for motor in ways if motor in stated and motor in by):
            allowed = f"{motor} (a place) or by.{motor} (a way from the place before)"
            yield FileProblem.of_key(f"by.{motor}", f"{motor} and by.{motor}", allowed, "remove one of the two")
        if not ways and is_whole and (not stated.get("by") or by):
            motors, first = ", ".join(cls.motors), cls.motors[0]
            place, way = _EXAMPLES[cls.unit(first)]
            remedy = f'add {first} = "{place}" or by = {{{first} = "{way}"}}'
            yield FileProblem.of_key(first, "no motor", f"a place or a way for at least one of {motors}", remedy)
        changed = [key for key in ("changed_at", "changed_to") if key in stated]
        if changed and is_whole:
            yield from cls._lacking(stated, ("changed_at", "changed_to"), "of a stop changed on the way")
        if "turn" in stated and changed:
            allowed = "one of them: the motor would pass the place twice"
            yield FileProblem.of_key(changed[0], f"turn and {changed[0]}", allowed, "divide the move into two")
        for key in [key for key in ("turn", *changed) if key in stated][:1] if len(ways) > 1 else ():
            got, allowed = f"{key} in a move of {len(ways)} motors", f"{key} in a move of exactly one motor"
            yield FileProblem.of_key(key, got, allowed, "give the motor a [[move]] of its own")

    @classmethod
    def _lacking(cls, stated: Mapping[str, Any], needed: Sequence[str], what: str) -> Iterator[FileProblem]:
        """Keys that belong together and are not all there."""
        for key in needed:
            if key not in stated:
                allowed, remedy = f"{' and '.join(needed)} {what}", f"add {key} = {example_value(cls, key)}"
                yield FileProblem.of_key(key, f"no {key}", allowed, remedy)


class PlaceRow(StageRow, frozen=True):
    """A line of a list of places."""

    tile: Label = optional("what a place is called", "", allowed=_LABEL)


class UnitOfMotor(Unit):
    """Unit of the motor that a row names, where some slide and some turn: `StageRow.faults` tells them apart."""

    __slots__ = ()

    def read(self, value: object, info: ValidationInfo) -> object:
        """Read a quantity in the unit of either."""
        for motion in ("linear", "rotary"):
            with suppress(PydanticCustomError):
                return Unit(unit_in(motion, self.symbol)).read(value, info)
        return 1.0  # it is one of the faults


@lru_cache(maxsize=64)
def stage_row(
    motors: tuple[str, ...], base: type[StageRow] = StageRow, turning: frozenset[str] = frozenset()
) -> type[StageRow]:
    """Model of a row whose places and ways are those of some motors, of which some may turn."""
    # Names of motors are keys only: as fields they could be words of pydantic.
    units: dict[str, Any] = {motor: Angle if motor in turning else Length for motor in motors}
    places: dict[str, Any] = {
        f"m{number}": (unit | None, optional(f"place of {motor}", None, alias=motor))
        for number, (motor, unit) in enumerate(units.items())
    }
    by: Any = create_model("StageWays", __base__=Table, **places)
    fields: dict[str, Any] = places | {"by": (by | None, StageRow.model_fields["by"])}
    for key, linear in _OF_ONE_MOTOR.items() if turning else ():
        is_mixed = len(turning) < len(motors)
        unit = UnitOfMotor(linear) if is_mixed else Unit(unit_in("rotary", linear))
        fields[key] = _in_unit(base.model_fields[key], unit)
    row = create_model("StageRow", __base__=base, **fields)
    row.motors, row.turning = motors, turning
    return row


def _in_unit(field: FieldInfo, unit: Unit) -> tuple[Any, FieldInfo]:
    """Annotation and declaration of a quantity that need not be there, in another unit."""
    made, quantity = copy(field), cast("Any", Annotated[float, unit])
    kind: Any = quantity | None
    # The annotation brings what else is checked, and pydantic joins both.
    made.metadata, made.annotation = [], None
    if extra_of(field, "allowed"):
        extra = cast("dict[str, Any]", field.json_schema_extra)
        made.json_schema_extra = extra | {"allowed": f"{describe_kind(unit.symbol)[0]} other than 0"}
    return (Annotated[kind, *field.metadata] if field.metadata else kind), made


def places_of(table: Table | None, motors: Sequence[str]) -> dict[str, float]:
    """Places or ways of the motors that a row, or its table of ways, names [m]."""
    found = {motor: getattr(table, f"m{number}", None) for number, motor in enumerate(motors)}
    return {motor: place for motor, place in found.items() if place is not None}


@dataclass(frozen=True, slots=True)
class StopChange:
    """A stop extreme changed on the way.

    Attributes
    ----------
    at, to : float
        Position at which the motor is when the change comes, and the new stop extreme [m].
    """

    at: float
    to: float


@dataclass(frozen=True, slots=True)
class StageMove:
    """One automatic move, of all the motors it names at the same time, and how long the stage stands after it.

    Attributes
    ----------
    number, row : int
        Counted from 1 through the whole job, repeats counted; and the line of the file that asks for the move, from 1.
    targets, by : dict of float by motor
        Where to, or how far from where the motor was told to go before [m]. No motor is in both; one that is in
        neither stays.
    dwell : float
        Time the stage stands after the last motor is ready [s], 0 or more.
    label : str
        What the move is for: the number of a tile, or a word.
    turn : float or None
        Where the motor turns before it goes to its target [m], the turn extreme of its envelope: it runs on to there
        and comes back in the same move. Only where exactly one motor moves.
    change : StopChange or None
        A stop extreme changed on the way. Only where exactly one motor moves, and without `turn`: the motor would pass
        one place twice.

    Raises
    ------
    DetentError
        A value is outside what is said above, or not finite.
    """

    number: int
    row: int
    targets: dict[str, float] = field(default_factory=dict[str, float])
    by: dict[str, float] = field(default_factory=dict[str, float])
    dwell: float = 0.0
    label: str = ""
    turn: float | None = None
    change: StopChange | None = None

    def __post_init__(self) -> None:
        """Refuse what no stage could do."""
        # No word of a file: a motor could be called as one.
        named = {motor: f"motor {motor}" for motor in self.motors}
        values: dict[str, Any] = {named[motor]: place for motor, place in self.targets.items()}
        values["by"] = {named[motor]: way for motor, way in self.by.items()}
        values |= {"dwell": self.dwell, "turn": self.turn}
        if self.change is not None:
            values |= {"changed_at": self.change.at, "changed_to": self.change.to}
        check_values(stage_row(tuple(named.values()) or ("motor",)), f"move {self.number}", values)

    @property
    def motors(self) -> tuple[str, ...]:
        """Motors that the move names."""
        return (*self.targets, *self.by)

    def place_of(self, motor: str, before: float) -> float:
        """Where a motor goes that was told to go to `before` by the move before [m]."""
        return self.targets[motor] if motor in self.targets else before + self.by[motor]


@dataclass(frozen=True, slots=True)
class StageJog:
    """One manual run: the joystick of a motor is held deflected for a time, then let go.

    Attributes
    ----------
    number, row : int
        As of a `StageMove`.
    motor, label : str
        The motor, and what the run is for.
    speed : float
        Speed asked for [m/s], negative for the negative direction, not 0.
    duration, dwell : float
        Time until the joystick is let go [s], above 0, and time the stage stands after the motor has slowed down to
        rest [s], 0 or more.

    Raises
    ------
    DetentError
        A value is outside what is said above, or not finite.
    """

    number: int
    row: int
    motor: str
    speed: float
    duration: float
    dwell: float = 0.0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse what no stage could do."""
        values = {name: getattr(self, name) for name in ("speed", "duration", "dwell")}
        check_values(stage_row(("motor",)), f"move {self.number}", {"jog": "motor", **values})

    @property
    def motors(self) -> tuple[str, ...]:
        """The motor, as the one that this run names."""
        return (self.motor,)


@dataclass(frozen=True, slots=True, repr=False)
class StageJob(OnScreen):
    """A list of moves of a stage.

    Attributes
    ----------
    name : str
        Name of the file, without its folders.
    kind : str
        "moves", or "tiles" where the file is a list of tiles.
    moves : tuple of StageMove or StageJog
        In order, numbered from 1; repeats are written out.
    motors : tuple of str
        Motors that the job names, in the order of the axis file.
    notes : tuple of str
        What the reader of the file chose, to be told to the user, such as the columns it took.
    changes : tuple of ParameterChange
        Parameters of the motors' controllers that change on the way, each by the name of its motor and its own.
    """

    name: str
    kind: str
    moves: tuple[StageMove | StageJog, ...]
    motors: tuple[str, ...]
    notes: tuple[str, ...] = ()
    changes: tuple[ParameterChange, ...] = ()

    @property
    def count(self) -> int:
        """Number of moves."""
        return len(self.moves)


# ---- files


def load_stage_job(path: str | PathLike[str], motors: Sequence[str], turning: frozenset[str] = frozenset()) -> StageJob:
    """Read the job of a stepper stage with these motors, of which some turn; that it can do it is not checked here."""
    file = Path(path)
    text = read_text(file, (".csv", ".toml"), "a list of places (.csv) or of moves (.toml)")
    repeat, kind, notes, changes = 1, "moves", (), ()
    if file.suffix.lower() == ".csv":
        table = PlaceRows(str(file), text, stage_row(tuple(motors), PlaceRow, turning))
        made = table.read(_make_move, MOST_MOVES)
        kind, notes = "tiles" if table.has_tiles else "moves", table.notes
    else:
        source = parse_source(str(file), text)
        model: Any = stage_row(tuple(motors), StageRow, turning)
        found = read_tables(source, cast("type[MoveFile[StageRow]]", MoveFile[model]))
        made = [_make_move(source.line_of("move", number), row) for number, row in enumerate(found.move)]
        repeat, changes = found.repeat, read_changes(source, found.parameter_change)
    moves = expand_moves(str(file), made, repeat, missing=f"add a move with a place for {' or '.join(motors)}")
    named = {motor for move in moves for motor in move.motors}
    return StageJob(file.name, kind, moves, tuple(motor for motor in motors if motor in named), notes, changes)


def _make_move(line: int, row: StageRow) -> tuple[StageMove | StageJog, int]:
    """The move of a row, and how often it is done."""
    label = " ".join(word for word in (row.tile if isinstance(row, PlaceRow) else "", row.label) if word)
    if row.jog is not None:
        return StageJog(1, line, row.jog, row.speed or 0.0, row.duration or 0.0, row.dwell, label), row.repeat
    at, to = row.changed_at, row.changed_to
    change = None if at is None or to is None else StopChange(at, to)
    targets, by = places_of(row, row.motors), places_of(row.by, row.motors)
    return StageMove(1, line, targets, by, row.dwell, label, row.turn, change), row.repeat


def unit_in_name(name: str, motors: Iterable[str], turning: Container[str] = ()) -> tuple[str, str | None]:
    """Key and unit of a heading that ends in its unit, perhaps with further words, such as ``x_um`` of motor x."""
    # A motor x_um before a motor x, which could have such a column too.
    for key in sorted((*motors, "dwell"), key=len, reverse=True):
        token = name.removeprefix(f"{key}_").partition("_")[0]
        unit = "s" if key == "dwell" else "rad" if key in turning else "m"
        if name.startswith(f"{key}_") and token in _NAME_UNITS[unit]:
            return key, token
    return name, None


class PlaceRows(CsvRows[StageRow]):
    """A list of places: a column for each motor, whatever else there is."""

    has_tiles = False
    notes: tuple[str, ...] = ()
    """Which columns were taken and which not, where there was a choice."""

    def read_header(self) -> None:
        """Read the columns, and choose one for each motor."""
        self.several = frozenset(self.model.motors)
        for index, cell in enumerate(self.header.cells):
            self.columns.append(self.read_heading(index, cell))
        for motor in self.model.motors:
            self._choose(motor)
        keys = [column.key for column in self.columns]
        self.has_tiles = "tile" in keys
        if self.problems:
            return
        if not set(keys) & set(self.model.motors):
            usual = [self.heading_of(motor) for motor in self.model.motors]
            allowed = f"a column for at least one motor: {', '.join(usual)}"
            self.refuse_header(allowed, f"begin with a header such as {self.separator.join(usual)}")
        cells = [short(cell) for cell in self.header.cells]
        passed = [cells[k] or "a column without a name" for k, one in enumerate(self.columns) if not one.key]
        if passed:
            more = f" and {len(passed) - _MOST_NAMED} more" if len(passed) > _MOST_NAMED else ""
            taken = ", ".join(cells[k] for k, one in enumerate(self.columns) if one.key in self.model.motors)
            self.notes = (f"columns {taken}", f"passed over: {', '.join(passed[:_MOST_NAMED])}{more}")

    def read_heading(self, index: int, cell: str) -> Column:
        """Read key and unit of a column; a slip of one that says something of the motion must not be passed over."""
        name, unit = split_heading(cell)
        key, unit = self._unit_in(name) if unit is None else (name, unit)
        if key in self.model.motors or key in CSV_KEYS:
            return self.column_of(index, key, unit)
        head = name.partition("_")[0].lower()
        # By the first letter: wells of a plate have nothing to do with a dwell.
        near = [word for word in difflib.get_close_matches(head, ("dwell", "repeat"), cutoff=0.8) if head[0] == word[0]]
        meant = name.lower()  # motors have small letters
        meant = self._unit_in(meant)[0] if unit is None else meant
        near += [meant] if meant in self.model.motors else []
        if not near:
            return Column()
        allowed = ", ".join(map(self.heading_of, (*self.model.motors, "dwell", "repeat")))
        return self.refuse_heading(index, f'the unknown column "{short(cell)}"', allowed, f'did you mean "{near[0]}"?')

    def _unit_in(self, name: str) -> tuple[str, str | None]:
        """Key and unit of a heading that ends in its unit; a motor that turns may have one in mm, which is refused."""
        key, unit = unit_in_name(name, self.model.motors, self.model.turning)
        return (key, unit) if unit else unit_in_name(name, self.model.turning)

    def _choose(self, motor: str) -> None:
        """Pass over all columns of a motor but one."""
        cells = self.header.cells
        found = [index for index, column in enumerate(self.columns) if column.key == motor]
        if len(found) < 2:
            return
        nominal = [index for index in found if _PREFERRED in cells[index].lower()]
        if len(nominal) != 1:
            got = f"{len(found)} columns for {motor}: {', '.join(short(cells[index]) for index in found)}"
            allowed = f'one column for each motor, or one with the word "{_PREFERRED}" among several'
            unit = self.columns[found[0]].unit
            remedy = f"name the column of the places to go to {motor}_{unit}_{_PREFERRED}"
            self.refuse_heading(found[1], got, allowed, remedy)
        for index in set(found).difference(nominal):
            self.columns[index] = Column()
