"""The rows of a store: each a frozen dataclass, whose first field is its key (`live.sealed`)."""

from dataclasses import dataclass

from detent.files.text import shown

VERSION = 1  # of the meaning of the rows
MOST_POSITIONS = 1000  # of a table
MOST_EDITS = 500  # changed entries that can be undone
MOST_NAME = 80  # characters
LARGEST = (1 << 63) - 1  # counts
COUNTERS = ("moves", "distance", "enabled", "faults", "starts")  # counts of way; microseconds enabled


NAME = f"1 to {MOST_NAME} characters of one line without blanks around them"


def is_name(text: str) -> bool:
    """Whether a position may have this name: what is shown and typed as it is."""
    return 0 < len(text) <= MOST_NAME and text == text.strip() and text.isprintable() and shown(text) == text


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
