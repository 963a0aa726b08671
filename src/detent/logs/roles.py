"""What a column of a recording can be, and what its name says about it."""

import difflib
import re
from dataclasses import dataclass
from functools import lru_cache

from detent.logs.log_units import split_heading

_MOTION = (("m", "rad", "count"), ("m/s", "rad/s", "count/s"), ("m/s^2", "rad/s^2", "count/s^2"))
EFFORTS = ("force", "torque", "current", "voltage", "command")  # what can drive an axis, nearest to its mechanics first


@dataclass(frozen=True, slots=True)
class Role:
    """What a signal is."""

    name: str  # key of the signal
    meaning: str  # what it is, for messages and the documentation
    # units that it may have behind the border: of an axis that moves straight, of one that turns, in counts
    units: tuple[str, ...]
    # what columns of it are called, the most telling first: words in small letters, to be found whole and in order
    names: tuple[str, ...]


ROLES: dict[str, Role] = {
    role.name: role
    for role in (
        Role("time", "time", ("s",), ("t", "time", "timestamp", "time stamp", "stamp", "zeit", "elapsed", "clock")),
        Role("reference", "position asked for", _MOTION[0],
             ("reference position", "position reference", "pos ref", "position ref", "ref", "reference", "setpoint",
              "set point", "sollwert", "goal position", "target position", "demand position", "goal", "target",
              "desired", "demand", "commanded position", "position command", "qg", "qref", "xref")),
        Role("position_load", "position by a second encoder, at the load", _MOTION[0],
             ("load position", "position load", "load encoder", "encoder load", "enc load", "load angle", "enc 2",
              "encoder 2", "enc2", "position 2", "pos 2", "encoder2", "pos2")),
        Role("position", "position as measured", _MOTION[0],
             ("position meas", "measured position", "actual position", "position", "pos", "enc", "encoder", "angle",
              "theta", "phi", "measured", "measured motor", "actual", "istwert", "enc1", "encoder1", "pos1", "qm", "q",
              "x")),
        Role("velocity", "velocity as measured", _MOTION[1],
             ("velocity meas", "measured velocity", "actual velocity", "velocity", "speed", "vel", "omega", "rpm", "qd",
              "dq", "v")),
        Role("acceleration", "acceleration as measured", _MOTION[2], ("acceleration", "accel", "acc", "qdd", "ddq")),
        Role("force", "force of the drive on the axis", ("N",), ("motor force", "force", "thrust")),
        Role("torque", "torque of the motor", ("N*m",), ("motor torque", "torque", "tau", "moment", "drehmoment")),
        Role("current", "current of the motor", ("A",), ("motor current", "current", "iq", "i q", "amps", "i")),
        Role("supply", "voltage that supplies the drive", ("V",),
             ("supply", "supply voltage", "bus voltage", "vbus", "v bus", "dc link", "input volts", "input voltage",
              "battery", "vin")),
        Role("voltage", "voltage at the motor or its amplifier", ("V",),
             ("motor voltage", "voltage", "volts", "u")),
        Role("command", "word to the drive, such as a duty cycle", ("",),
             ("control signal", "controlsignal", "control", "pwm", "duty", "duty cycle", "command", "cmd", "load",
              "effort", "input signal", "inputsignal", "drive")),
        Role("temperature", "temperature of the motor", ("K",), ("motor temperature", "temperature", "temp")),
        Role("enabled", "1 while the drive is on", ("",), ("torque enable", "enable", "enabled", "torque enabled")),
    )
}  # fmt: skip
"""Every role by its name; the order is that in which columns are looked for."""

DERIVED = frozenset(
    {"error", "err", "deviation", "lag", "term", "index", "sample", "number", "count", "gain", "filtered"}
)
"""Words in the name of a column that say that it is computed from others, or is none of these."""

_MARKS = {
    "velocity": {"velocity", "speed", "vel"},
    "acceleration": {"acceleration", "accel", "acc"},
    "enabled": {"enable", "enabled"},
}
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")
_LEAST_FUZZY = 6


@lru_cache(4096)
def words_of(name: str) -> tuple[str, ...]:
    """Words of a column's name, in small letters.

    >>> words_of("inputSignal"), words_of("goal_position"), words_of("enc1")
    (('input', 'signal'), ('goal', 'position'), ('enc', '1'))
    """
    return tuple(token.lower() for token in _TOKEN.findall(name))


def rank(name: str, role: str) -> int | None:
    """How well the name of a column fits a role.

    >>> rank("Time", "time"), rank("Current Error", "current"), rank("enconder", "position") is not None
    (1, None, True)
    """
    words = words_of(name)
    if not words or DERIVED & set(words):
        return None
    names = ROLES[role].names
    fitting = (place for place, known in enumerate(names) if _contains(words, known))
    return next((place for place in fitting if not _means_other(words, names[place], role)), None)


def is_time(name: str) -> bool:
    """True for the name of a column that holds the time, with its unit or without."""
    return rank(split_heading(name)[0], "time") is not None


def _contains(words: tuple[str, ...], known: str) -> bool:
    """True where the known words stand whole and in their order in a name; a single letter must be all of it."""
    sought = words_of(known)
    if sum(map(len, sought)) <= 1:
        return words == sought
    rest = iter(words)
    return all(any(_is_same(word, wanted) for word in rest) for wanted in sought) or "".join(words) == "".join(sought)


def _is_same(word: str, wanted: str) -> bool:
    """True for a word, or a long one that is misspelled."""
    is_long = len(wanted) >= _LEAST_FUZZY
    return word == wanted or (is_long and difflib.SequenceMatcher(None, word, wanted).ratio() > 0.88)


def _means_other(words: tuple[str, ...], known: str, role: str) -> bool:
    """True where other words of a name say that it is something else, as in target velocity."""
    others = set(words) - set(words_of(known))
    if any(others & marks for meant, marks in _MARKS.items() if role != meant):
        return True
    asked = {"target", "goal", "reference", "ref", "desired", "setpoint", "demand", "demanded", "commanded"}
    return role in {"position", "velocity", "acceleration", "current", "force", "torque"} and bool(others & asked)
