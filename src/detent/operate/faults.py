"""Faults of a live axis: put in on purpose, and kept with what led to them.

A fault that begins is noted by the loop in the same period. Whoever keeps the records adds the sentence, the measured
value beside its limit, what is likely, what to do, and the rows of the ring from 2 s before to 2 s after it.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.control.reaction import REACTION_NAMES, rule_of
from detent.errors import REFUSAL_TEXT, DetentError
from detent.operate.loop import INJECT, NOTES
from detent.plant.injection import KIND_NAMES, MEMORY, PUSH, TIMED, WRONG, Place
from detent.units import QuantityError, format_quantity, parse_quantity

AROUND = 2.0  # time that the ring is kept before and after a fault [s]
NOTHING = "nothing"


# ---------------------------------------------------------------------------------------------------- put in


def injections(places: Mapping[str, Place]) -> dict[str, list[str]]:
    """Where something can go wrong, and how."""
    return {name: [KIND_NAMES[kind] for kind in place.kinds] for name, place in places.items()}


def injection_of(places: Mapping[str, Place], text: object) -> tuple[int, float]:
    """Kind and value of a request for "encoder stuck", "encoder wrong 1 mm", "load push 30 N" or "nothing"."""
    if not places:
        raise DetentError("got a fault to inject; expected: a simulated axis; what drives a machine injects none")
    if text == NOTHING:
        return INJECT, 0.0
    name = next((one for one in sorted(places, key=len, reverse=True) if f"{text} ".startswith(f"{one} ")), "")
    kind, _, amount = str(text)[len(name) + 1 :].partition(" ")
    if not name or kind not in injections(places)[name]:
        known = "; ".join(f"{one} {', '.join(kinds)}" for one, kinds in injections(places).items())
        told = f"inject {text!r}" if isinstance(text, str) else "inject without a fault"
        raise DetentError(f'{told}; expected: {known}; or {NOTHING}; try: inject "{next(iter(places))} stuck"')
    place, number = places[name], KIND_NAMES.index(kind)
    return INJECT + 16 * place.number + number, _amount(place, number, amount, f"inject {text!r}")


def _amount(place: Place, kind: int, text: str, told: str) -> float:
    """How much of it, as the loop takes it: refreshes of a word, counts, or a force."""
    unit, default, scale = "", 0.0, 1.0
    if kind in TIMED:
        unit, default, scale = "s", place.time, place.refresh
    elif kind == PUSH:
        unit, default = place.push_unit, place.push
    elif place.unit:
        unit, default, scale = place.unit, place.wrong, place.scale
    if text and not unit:
        raise DetentError(f"{told}; expected: no amount, for there is none of {KIND_NAMES[kind]} there; leave it out")
    try:
        amount = (parse_quantity(text, unit) if text else default) / scale
    except QuantityError as error:
        raise DetentError(f"{told}: {error}; try: {format_quantity(default, unit)}") from error
    longest = (MEMORY - 1) * place.refresh
    if kind in TIMED and not 0.5 <= amount <= (MEMORY - 1 if KIND_NAMES[kind] == "delayed" else 1e9):
        raise DetentError(
            f"{told}; expected: {format_quantity(place.refresh, 's')} to {format_quantity(longest, 's')}; "
            f"try: {format_quantity(default, 's')}"
        )
    if kind == WRONG and text and amount == 0.0:
        raise DetentError(f"{told}; expected: an amount other than 0; try: {format_quantity(default, unit)}")
    return amount


# ---------------------------------------------------------------------------------------------------- what is told


class Lore(NamedTuple):
    """What is known of a fault: likely causes in order, what to do, and what was compared with its limit."""

    causes: tuple[str, ...]
    steps: tuple[str, ...]
    shows: str = ""  # quantity of the first moment
    unit: str = ""  # of that: "m" stands for the unit of the axis


_BLOCKED = "look for what blocks the axis, and move it by hand with the torque off"
LORE: dict[int, Lore] = {
    1: Lore(("the cable of the sensor is cut or loose", "the sensor has no supply"), ("check cable and supply",)),
    2: Lore(
        ("the axis is blocked", "the cable of the sensor is cut", "the coupling of the sensor has come loose"),
        (_BLOCKED, "check cable and coupling of the sensor", "find the reference anew"), "effort", "%",
    ),
    3: Lore(
        ("noise on the cable of the sensor", "a loose plug", "the scale is dirty or damaged"),
        ("check cable, shield and supply of the sensor", "find the reference anew"), "velocity", "m/s",
    ),
    4: Lore(
        ("motor or sensor have swapped leads", "a force from outside beyond the effort drives the axis"),
        ("swap two leads of the motor or both channels of the sensor", "test the direction slowly"), "effort", "%",
    ),
    5: Lore(("the coupling slips", "steps were lost"), ("check the coupling", "find the reference anew")),
    6: Lore(("the sensor was read too seldom",), ("lower the speed", "find the reference anew")),
    10: Lore(
        ("the axis is blocked or drags", "the load is heavier than the file says", "the gains are too low"),
        (_BLOCKED, "lower speed or acceleration", "tune the loop anew"), "error", "m",
    ),
    11: Lore(
        ("the axis stands against something", "the load needs more than the drive has", "the loop is unstable"),
        (_BLOCKED, "lower the acceleration"), "effort", "%",
    ),
    12: Lore(
        ("a force from outside drives the axis", "the sensor counts wrongly", "the loop is unstable"),
        ("look for what drives the axis", "check the sensor", "lower the gains"), "velocity", "m/s",
    ),
    13: Lore(
        ("friction holds the axis outside the window", "a force pushes it away", "the loop has no integral"),
        ("look for what holds the axis", "widen the window, or add an integral"), "error", "m",
    ),
    14: Lore(("the gains are too high", "play in the gear"), ("lower the gains", "look for play"), "error", "m"),
    20: Lore(("a short in motor or cable", "the drive is damaged"), ("check motor and cable with the supply off",)),
    21: Lore(("the load is too heavy for the motor",), ("let the motor cool", "lower acceleration or duty")),
    30: Lore(("the axis ran onto a limit switch",), ("jog away from the switch", "check the soft limits")),
    32: Lore(
        ("something pushed the axis beyond its end", "it overshot a target close to the end"),
        ("jog back inwards", "keep the targets farther from the ends"), "position", "m",
    ),
    33: Lore(("the wire of a limit switch is cut",), ("check both switches and their wires",)),
    34: Lore(("the switch or index was not found",), ("look at switch and cable", "home again")),
    40: Lore(("the cable to the drive is cut", "the drive has lost its supply"), ("check cable and supply",)),
    50: Lore(
        ("the machine is busy with other work", "the loop has no real-time priority"),
        ("end other programs", 'give the loop real-time priority, or a longer period: --period "5 ms"'),
        "lateness", "s",
    ),
    51: Lore(("the process of the loop was stopped or killed",), ("start it again",)),
    52: Lore(("the sensor gave what is no number",), ("check the sensor and what computes with it",)),
    54: Lore(("an error in the program",), ("keep the report", "end detent live, and start it anew")),
    55: Lore(("the disk is full or read-only",), ("make room on the disk",)),
}  # fmt: skip
NOT_KNOWN = Lore(("what the sentence says",), ("mend that",))
ALLOWED = {
    "A": ("reset", "enable"), "E": ("reset", "enable"), "H": ("reset", "enable", "home", "jog", "move_by"),
    "C": (), "S": (), "": ("enable",),
}  # fmt: skip
"""What may be done after it, by its recovery; stop and disable always may."""


@dataclass(frozen=True)
class FaultRecord:
    """A fault, as it is told."""

    number: int  # of the record, from 1
    code: str
    period: int
    time: float  # since the loop began [s]
    text: str
    value: float | None
    limit: float | None
    unit: str
    position: str
    reaction: str
    causes: tuple[str, ...]
    steps: tuple[str, ...]
    allowed: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self) | {"causes": [*self.causes], "steps": [*self.steps], "allowed": [*self.allowed]}


@dataclass
class Kept:
    """Rows of the ring around a fault, as far as they have come."""

    following: int  # next row to be kept
    end: int  # first that is not
    pieces: list[NDArray[Any]] = field(default_factory=list[NDArray[Any]])


class Faults:
    """Records of the last faults, and the ring around each."""

    def __init__(self, host: Any) -> None:
        self._host, self._read = host, int(host.board.faults.count)
        self.records: list[FaultRecord] = []
        self._kept: dict[int, Kept] = {}

    def note(self) -> None:
        """Take down what has begun since the last time, and what the ring holds by now."""
        notes, scope = self._host.board.faults, self._host.scope
        self._read = max(self._read, notes.count - NOTES)
        while self._read < notes.count:
            self._read += 1
            record = self._record(notes, self._read)
            self.records = [*self.records, record][-NOTES:]
            row, around = int(notes.row[(self._read - 1) % NOTES]), math.ceil(AROUND / self._period)
            self._kept[record.number] = Kept(max(row - around, 0), row + around + 1)
            self._kept.pop(record.number - NOTES, None)
        for kept in self._kept.values():
            if kept.following < min(kept.end, self._host.board.loop.rows):
                rows, following, missed = scope.rows(kept.following)
                kept.pieces.append(rows[: max(kept.end - kept.following - missed, 0)])
                kept.following = following

    @property
    def _period(self) -> float:
        return self._host.board.loop.period * 1e-9

    def _record(self, notes: Any, number: int) -> FaultRecord:
        axis, k = self._host.axis, (number - 1) % NOTES
        given = int(notes.code[k])
        code = axis.fault_numbers.get(given, given)
        lore, rule = LORE.get(code, NOT_KNOWN), rule_of(code)
        text = axis.fault() or self._host.told(given) or REFUSAL_TEXT.get(given, "a fault that has no sentence")
        text = text.partition("; ")[0]
        value, limit = None, axis.limits.get(given)
        unit = lore.unit.replace("m", axis.unit) if lore.unit in ("m", "m/s") else lore.unit
        if lore.shows == "lateness":
            value, limit = self._host.board.loop.worst * 1e-9, 5 * self._period
        elif lore.shows:
            value = float(getattr(notes, lore.shows)[k])
        return FaultRecord(
            number, f"F{code:02d}", int(notes.period[k]), notes.period[k] * self._period, text, value, limit, unit,
            "kept" if notes.trust[k] else "lost", REACTION_NAMES[rule.reaction], lore.causes, lore.steps,
            ALLOWED[rule.recovery],
        )  # fmt: skip

    def trace(self, number: int) -> dict[str, list[float]]:
        """Columns of the ring around a fault: the time from it [s], then what the ring shows."""
        record = next((one for one in self.records if one.number == number), None)
        if record is None:
            known = ", ".join(str(one.number) for one in self.records) or "none yet"
            raise DetentError(f"fault {number}; expected: one of the last {NOTES}: {known}; look at the list of faults")
        pieces = [one for one in self._kept[number].pieces if len(one)]
        names = pieces[0].dtype.names or () if pieces else ()
        pieces = [one for one in pieces if one.dtype == pieces[0].dtype]  # the channels may have changed since
        columns = {name: np.concatenate([one[name] for one in pieces]).tolist() for name in names}
        periods = columns.pop("loop.periods", [])
        return {"time": [(one - record.period) * self._period for one in periods]} | columns


def describe_fault(record: Mapping[str, Any]) -> str:
    """A record for a terminal."""
    value = "" if record["value"] is None else format_quantity(record["value"], record["unit"], 4)
    limit = "" if record["limit"] is None else f", limit {format_quantity(record['limit'], record['unit'], 4)}"
    lines = [f"{record['number']}. {record['code']} at {record['time']:.3f} s: {record['text']}"]
    lines += [f"   measured {value}{limit}"] if value else []
    lines += [f"   position {record['position']}; {record['reaction']}"]
    lines += [f"   likely: {'; '.join(record['causes'])}", f"   to do: {'; '.join(record['steps'])}"]
    allowed = ", ".join((*record["allowed"], "stop", "disable"))
    return "\n".join([*lines, f"   allowed now: {allowed}"])
