"""Units in the headings of recordings: found, and turned into factors to SI.

A unit may carry a number: ``"0.3125 um"`` says that one unit of the column is 0.3125 µm, as for a column of encoder
counts. Counts themselves (``count``, ``steps``, ``pulses``) stay counts where nothing says how long one is.
"""

import re
from typing import NamedTuple

from detent.units import MAX_TEXT, QuantityError, parse_quantity

COUNT_WORDS = frozenset(
    {"count", "counts", "cnt", "cnts", "cts", "inc", "incs", "increments", "pulses", "pulse", "ticks", "steps", "step"}
)
"""Words with which headings name counts."""

_WRITTEN_AS = {
    "°": "deg", "°/s": "deg/s", "degrees": "deg", "degree": "deg", "radians": "rad", "rads": "rad/s", "rad_s": "rad/s",
    "deg_s": "deg/s", "m_s": "m/s", "mm_s": "mm/s", "um_s": "um/s", "m_s2": "m/s^2", "mps": "m/s", "sec": "s",
    "secs": "s", "seconds": "s", "msec": "ms", "millis": "ms", "micros": "us", "usec": "us", "Nm": "N*m",
    "mNm": "mN*m", "Ncm": "N*cm", "kNm": "kN*m", "volt": "V", "volts": "V", "amp": "A", "amps": "A", "percent": "%",
    "1/min": "rpm", "U/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "RPM": "rpm", "rps": "turn/s", "rev/s": "turn/s",
    "rev": "turn", "bit": "bits", "LSB": "lsb",
}  # fmt: skip
"""Ways of writing units that are common in headings, and what the parser of units calls them."""

_NO_UNIT = frozenset({"", "-", "1", "none", "lsb", "raw", "pu", "p.u."})
_BITS = re.compile(r"([0-9]{1,2}) ?bits?", re.IGNORECASE)
_NUMBERED = re.compile(r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)\s*(.*)", re.DOTALL)
_OF_TURNS = re.compile(r"rad|deg|turn|rpm|revol|arc|grad")
_GRAVITIES = frozenset({"g", "g0", "gn"})
_CELSIUS, _FAHRENHEIT = (1.0, 273.15), (5 / 9, 459.67 * 5 / 9)
_TEMPERATURES = {"K": (1.0, 0.0), "degC": _CELSIUS, "C": _CELSIUS, "degF": _FAHRENHEIT, "F": _FAHRENHEIT}
_BRACKETED = re.compile(r"(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*", re.DOTALL)
_AFTER_NAME = (re.compile(r"(.*?\S)\s*[/,]\s*(\S+)"), re.compile(r"(.*\S)[_ ](\S+)"))
_SUFFIXES = frozenset(
    {"s", "ms", "us", "ns", "sec", "m", "mm", "um", "nm", "cm", "in", "rad", "deg", "rpm", "turn", "rev", "V", "mV",
     "A", "mA", "N", "Nm", "mNm", "K", "degC", "rads", "rad_s", "deg_s", "m_s", "mm_s", "um_s", "m_s2", "usec", "msec",
     "m/s", "mm/s", "rad/s", "deg/s", "m/s^2"}
)  # fmt: skip
"""Units that the last word of a name may be."""


class Conversion(NamedTuple):
    """``value = factor * number + offset``, the value in `unit`."""

    unit: str
    factor: float
    offset: float = 0.0


def split_heading(cell: str) -> tuple[str, str]:
    """Name and unit of a heading; an empty unit where it states none.

    >>> split_heading("position [mm]"), split_heading("time(ms)"), split_heading("enc1_mm"), split_heading("t/s")
    (('position', 'mm'), ('time', 'ms'), ('enc1', 'mm'), ('t', 's'))
    >>> split_heading("motor.velocity")
    ('motor.velocity', '')
    """
    match = _BRACKETED.fullmatch(cell)
    if match and match[1]:
        return match[1], match[2]
    for length, pattern in ((1, _AFTER_NAME[0]), (2, _AFTER_NAME[1]), (1, _AFTER_NAME[1])):
        match = pattern.fullmatch(cell)
        if match is None:
            continue
        name, unit = match[1], match[2]
        if length == 2:  # a unit of two words, as in speed_mm_s
            name, _, before = name.rpartition("_")
            unit = f"{before}_{unit}"
        if name and (unit in _SUFFIXES or unit.lower() in COUNT_WORDS):
            return name, unit
    return cell, ""


def is_unit(text: str) -> bool:
    """True for a text that a row of units could hold."""
    return text in _NO_UNIT or any(find_conversion(text, unit) is not None for unit in _COMMON_TARGETS)


def bits_of(unit: str) -> int | None:
    """Width of a number whose heading gives its bits for a unit, as ``8bits``."""
    match = _BITS.fullmatch(unit.strip())
    return int(match[1]) if match else None


def find_conversion(text: str, unit: str) -> Conversion | None:
    """How numbers in a unit become numbers in another; None where the text is no unit of this kind.

    >>> find_conversion("0.5 mm", "m")
    Conversion(unit='m', factor=0.0005, offset=0.0)
    >>> find_conversion("steps", "count"), find_conversion("steps", "m")
    (Conversion(unit='count', factor=1.0, offset=0.0), None)
    """
    match = _NUMBERED.fullmatch(text.strip())
    number, name = (match[1], match[2]) if match else ("1", text.strip())
    if len(text) > MAX_TEXT:
        return None
    name = _WRITTEN_AS.get(name, name).replace("µ", "u").replace("μ", "u").replace("°", "deg")
    if unit == "K":  # steps of several degrees do not exist
        return Conversion("K", *_TEMPERATURES[name]) if name in _TEMPERATURES and float(number) == 1 else None
    if unit == "":
        as_it_stands = float(number) if name.lower() in _NO_UNIT else None
        factor = {"%": float(number) / 100, "bits": 1.0}.get(name, as_it_stands)
    elif unit.startswith("count"):
        head, slash, rest = name.partition("/")
        factor = float(number) if head.lower() in COUNT_WORDS and f"count{slash}{rest}" == unit else None
    else:
        factor = _by_parser(number, name, unit)
    return None if factor is None else Conversion(unit, factor)


def _by_parser(number: str, name: str, unit: str) -> float | None:
    """Factor of a number in any unit of a physical quantity."""
    if unit == "m/s^2" and name in _GRAVITIES:
        return float(number) * 9.80665
    if ("rad" in unit) != bool(_OF_TURNS.search(name)):
        return None  # the parser takes angles and counts for pure numbers
    try:
        return parse_quantity(f"{number} {name}", unit)
    except QuantityError:
        return None


_COMMON_TARGETS = ("s", "m", "count", "V", "A", "N", "rad", "m/s", "rad/s", "m/s^2", "N*m", "K", "")
