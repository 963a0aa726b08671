"""The rows of a store: each a frozen dataclass, whose first field is its key (`live.sealed`)."""

from dataclasses import dataclass

VERSION = 1  # of the meaning of the rows
MOST_POSITIONS = 1000  # of a table
MOST_EDITS = 2000  # changed entries that can be undone
MOST_NAME = 80  # characters
LARGEST = (1 << 63) - 1  # counts
COUNTERS = ("moves", "distance", "enabled", "faults", "starts")  # counts of way; microseconds enabled


@dataclass(frozen=True, slots=True)
class Meaning:
    """One of the things without which a count is no place: scale, travel, sensor; and where the store was written."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Motion:
    """The journal of motion: a single row."""

    phase: str  # "moving" or "parked"
    trust: str  # of the position in `counts`
    counts: int  # where the axis is at rest, or where its motion began
    at: str


@dataclass(frozen=True, slots=True)
class Reference:
    """A reference that was found."""

    number: int
    by: str  # how: "index", "contact", a person's word
    counts: int  # position that it gave
    reading: str  # of an absolute sensor at that moment; empty without one
    at: str


@dataclass(frozen=True, slots=True)
class Position:
    """An entry of the position table."""

    name: str
    counts: int
    tolerance: int  #: counts
    reference: int  #: number of the reference by which it was taught; 0 where it was typed in before any
    taught: str  #: when
    used: str = ""  #: when the axis was last sent there


@dataclass(frozen=True, slots=True)
class Edit:
    """A change of one entry; those of one step were made together."""

    number: int
    step: int
    undone: int
    name: str
    before: str  # the entry as JSON; empty where there was none
    after: str


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant that was identified."""

    name: str
    value: float
    unit: str
    source: str  #: from where: a run, a file, a person
    at: str


@dataclass(frozen=True, slots=True)
class Counter:
    """A counter."""

    name: str
    value: int


KINDS = (Meaning, Motion, Reference, Position, Edit, Constant, Counter)
