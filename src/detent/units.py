"""Quantities with units, at the border: text in, SI number out, and back to text for messages.

Axis files and job files are the only places where units other than SI are met: their loaders use `parse_quantity`.
Conversion is exact: factors are ratios of whole numbers, and the result is the double nearest to the true value, so
that ``"3 in"`` and ``"76.2 mm"`` are the same number. Pint is imported at the first conversion.
"""

import math
import re
from fractions import Fraction
from functools import cache
from typing import Any

MAX_TEXT = 80  # longest quantity read, in characters: what is longer is refused before pint sees it

KINDS: dict[str, tuple[str, str]] = {
    "m": ("a length", "12 mm"),
    "m/s": ("a velocity", "600 mm/s"),
    "m/s^2": ("an acceleration", "10 m/s^2"),
    "m/s^3": ("a jerk", "200 m/s^3"),
    "s": ("a time", "5 ms"),
    "Hz": ("a frequency", "20 kHz"),
    "kg": ("a mass", "1.1 kg"),
    "kg*m^2": ("a moment of inertia", "260 g*cm^2"),
    "N": ("a force", "7.5 N"),
    "N*s/m": ("a viscous friction coefficient", "0.4 N*s/m"),
    "N/m": ("a stiffness", "20 N/um"),
    "N/V": ("a force per voltage", "35 N/V"),
    "N*m/A": ("a torque constant", "0.241 N*m/A"),
    "V": ("a voltage", "38 V"),
    "V*s/rad": ("a voltage per angular velocity", "25.2 V/krpm"),
    "V*s/m": ("a voltage per velocity", "240 V*s/m"),
    "V/m": ("a voltage per length", "5 V/mm"),
    "V/rad": ("a voltage per angle", "2 V/deg"),
    "V/(m*s)": ("a voltage per length and time", "50 V/(mm*s)"),
    "V/(rad*s)": ("a voltage per angle and time", "20 V/(deg*s)"),
    "ohm": ("a resistance", "12 ohm"),
    "H": ("an inductance", "12 mH"),
    "A": ("a current", "1.5 A"),
    "A/V": ("a current per voltage", "2 A/V"),
    "rad": ("an angle", "5 deg"),
    "rad/s": ("an angular velocity", "60 deg/s"),
    "rad/s^2": ("an angular acceleration", "300 deg/s^2"),
    "rad/s^3": ("an angular jerk", "5000 deg/s^3"),
    "N*m": ("a torque", "60 mN*m"),
    "N*m*s/rad": ("a viscous friction coefficient of rotation", "2 mN*m*s/rad"),
    "N*m/rad": ("a torsional stiffness", "300 N*m/rad"),
    "N*m/V": ("a torque per voltage", "0.2 N*m/V"),
    "rpm": ("a rotary speed", "3000 rpm"),
    "%": ("a percentage", "+10 %"),
}
"""Name and example of each unit a file may ask for, as they appear in messages."""

DEGREE = Fraction("3.1415926535897932384626433832795028841971693993751") / 180  # [rad], with pint's digits of pi
COMMON_UNITS: dict[str, dict[str, Fraction]] = {
    "m": {"cm": Fraction(1, 100), "mm": Fraction(1, 1000), "um": Fraction(1, 10**6), "in": Fraction(127, 5000)},
    "m/s": {"mm/s": Fraction(1, 1000), "in/s": Fraction(127, 5000)},
    "m/s^2": {"mm/s^2": Fraction(1, 1000)},
    "Hz": {"kHz": Fraction(1000), "MHz": Fraction(10**6)},
    "s": {"ms": Fraction(1, 1000), "us": Fraction(1, 10**6)},
    "kg": {"g": Fraction(1, 1000)},
    "kg*m^2": {"kg*cm^2": Fraction(1, 10**4), "g*m^2": Fraction(1, 1000), "g*cm^2": Fraction(1, 10**7)},
    "N*s/m": {"kN*s/m": Fraction(1000)},
    "N/m": {"N/mm": Fraction(1000), "N/um": Fraction(10**6)},
    "N*m/A": {"mN*m/A": Fraction(1, 1000)},
    "V": {"mV": Fraction(1, 1000)},
    "V/m": {"V/mm": Fraction(1000), "kV/m": Fraction(1000)},
    "H": {"mH": Fraction(1, 1000), "uH": Fraction(1, 10**6)},
    "A": {"mA": Fraction(1, 1000)},
    "N*m": {"N*cm": Fraction(1, 100), "mN*m": Fraction(1, 1000)},
    "N*m*s/rad": {"mN*m*s/rad": Fraction(1, 1000)},
    "rad": {"deg": DEGREE},
    "rad/s": {"deg/s": DEGREE, "rpm": 6 * DEGREE},
    "rad/s^2": {"deg/s^2": DEGREE},
    "rad/s^3": {"deg/s^3": DEGREE},
}
"""Factors met in nearly every file, by target unit, beside that unit itself: with these alone a file is read without
waiting for pint's import and its table of units (0.4 s). A test holds each of them to pint's."""

IN_DEGREES = {"rad": "deg", "rad/s": "deg/s", "rad/s^2": "deg/s^2", "rad/s^3": "deg/s^3"}  # as people read them

_NUMBER_THEN_UNIT = re.compile(
    r"\s*([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)\s*(\S.*)?", re.DOTALL
)
# Products of units and of their powers by one digit; brackets hold such a product, and have no power themselves. Pint
# would work powers of powers out, which takes 40 characters to last for ever.
_FACTOR = r"[A-Za-zµμΩ]+(?:\^-?[0-9])?"
_PRODUCT = rf"{_FACTOR}(?: *[*/ ] *{_FACTOR})*"
_UNIT_TEXT = re.compile(rf"(?:{_FACTOR}|\( *{_PRODUCT} *\))(?: *[*/ ] *(?:{_FACTOR}|\( *{_PRODUCT} *\)))*")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?[0-9]+,[0-9]+(?![,0-9])")  # and no second one, which would part thousands
_OUNCE_OR_POUND = re.compile(r"\b(oz|lb)\b")


class QuantityError(ValueError):
    """A text is not a quantity of the kind that a unit measures."""

    def __init__(self, reason: str, unit: str, remedy: str = "") -> None:
        kind, example = describe_kind(unit)
        self.reason = reason
        self.allowed = f'{kind} such as "{example}"'
        self.remedy = remedy or f'write {kind} as "{example}"'
        super().__init__(f"{reason}; expected: {self.allowed}; try: {self.remedy}")


def describe_kind(unit: str) -> tuple[str, str]:
    """Name and example of what `unit` measures: ``"m"`` gives ``("a length", "12 mm")``."""
    return KINDS.get(unit, (f"a quantity in {unit}", f"1 {unit}"))


def parse_quantity(text: str, unit: str) -> float:
    """Read a quantity such as ``"12 mm"`` as a number of `unit`.

    >>> parse_quantity("3 in", "m")
    0.0762
    >>> parse_quantity("-2.5 %", "%")
    -0.025
    """
    match = _NUMBER_THEN_UNIT.fullmatch(text) if len(text) <= MAX_TEXT else None
    if match is None:
        raise QuantityError(f'"{text[:MAX_TEXT]}" is not a number with a unit', unit)
    if _DECIMAL_COMMA.match(text):
        remedy = f'write a decimal point: "{text.strip().replace(",", ".", 1)}"'
        raise QuantityError(f'the decimal comma of "{text.strip()}"', unit, remedy)
    number, unit_text = match.group(1), match.group(2)
    if unit_text is None:
        remedy = f'write the unit after the number, as in "{describe_kind(unit)[1]}"'
        raise QuantityError(f"the bare number {number}", unit, remedy)
    value = Fraction(number) * _conversion_factor(unit_text.strip(), unit)
    try:
        return float(value)
    except OverflowError:
        raise QuantityError(f'"{text.strip()}" is beyond any number', unit) from None


def format_quantity(value: float, unit: str, digits: int = 4) -> str:
    """Write an SI value for people, with a prefix that keeps the number short.

    >>> format_quantity(0.0762, "m")
    '76.2 mm'
    >>> format_quantity(0.1, "%")
    '10 %'
    """
    if unit == "%":
        return f"{value * 100:.{digits}g} %"
    if unit in IN_DEGREES:
        shown, name = in_degrees(value, unit)
        return f"{shown:.{digits}g} {name}"
    if unit == "":
        return f"{value:.{digits}g}"
    scale, prefixed = _prefixed(abs(float(f"{value:.{digits}g}")), unit)
    return f"{value / scale:.{digits}g} {prefixed}"


def format_place(value: float, unit: str) -> str:
    """Write a position for people: what rounding has left of a zero, below a picometre or a picoradian, is none.

    >>> format_place(4.2e-18, "m"), format_place(0.1234567, "m")
    ('0 m', '123.457 mm')
    """
    return format_quantity(round(value, 12) + 0.0, unit, 6)


def in_unit_of(value: float, unit: str, like: str, digits: int = 4) -> str:
    """Write an SI value in the unit that a text has, spaced as there; with a prefix of its own if that has none.

    >>> in_unit_of(0.9123, "kg", "850 g"), in_unit_of(0.07, "m", "3in")
    ('912.3 g', '2.756in')
    """
    match = _NUMBER_THEN_UNIT.fullmatch(like)
    if match is None or not match[2]:
        return format_quantity(value, unit, digits)
    shown = float(value / _conversion_factor(match[2].strip(), unit))
    return f"{shown:.{digits}g}{like[match.end(1) : match.start(2)]}{match[2].rstrip()}"


def in_degrees(value: float, unit: str) -> tuple[float, str]:
    """An angle as people read it, and the unit of that: degrees, or rpm from ten turns a second.

    >>> in_degrees(math.pi, "rad/s"), in_degrees(200 * math.pi, "rad/s")
    ((180.0, 'deg/s'), (6000.0, 'rpm'))
    """
    degrees = math.degrees(value)
    if unit == "rad/s" and abs(degrees) >= 3600:
        return degrees / 6, "rpm"
    return degrees, IN_DEGREES[unit]


def _prefixed(size: float, unit: str) -> tuple[float, str]:
    """Choose the prefix of a unit for a value of this size; returns (scale, prefixed unit)."""
    if unit == "kg":
        return (1.0, "kg") if size >= 1 or size == 0 else (1e-3, "g")
    if unit == "kg*m^2":
        # Rotor inertias are printed in g*cm^2 in every catalogue.
        return (1e-7, "g*cm^2") if 0 < size < 1e-3 else (1.0, unit)
    if size == 0 or not math.isfinite(size):
        return 1.0, unit
    largest = 0 if unit in {"m", "m/s", "m/s^2", "m/s^3", "s"} else 6
    exponent = max(-9, min(largest, 3 * math.floor(math.log10(size) / 3)))
    prefix = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M"}[exponent]
    return 10.0**exponent, prefix + unit


@cache
def _registry() -> Any:
    """Load pint's units once, with factors as exact fractions, and nothing kept in files that others may damage."""
    import pint

    make_registry: Any = pint.UnitRegistry  # its annotations do not know registries of exact fractions
    return make_registry(non_int_type=Fraction)


@cache
def _conversion_factor(unit_text: str, unit: str) -> Fraction:
    """How many `unit` one `unit_text` is, exactly."""
    if unit == "%" or unit_text == "%":
        if unit == unit_text:
            return Fraction(1, 100)
        raise QuantityError(f'the unit "{unit_text}"', unit)
    common = Fraction(1) if unit == unit_text and unit in KINDS else COMMON_UNITS.get(unit, {}).get(unit_text)
    if common is not None:
        return common
    if "rad" in unit and re.search(r"[hH]z\b|[hH]ertz", unit_text):
        # Pint takes 1 Hz for 1 rad/s: silently wrong by 2 pi.
        raise QuantityError(f'the ambiguous unit "{unit_text}"', unit, "write rad/s, rpm or turn/s instead of Hz")
    if unit == "Hz" and re.search(r"rad|deg|turn|rev|rpm|cycle", unit_text):
        raise QuantityError(f'the ambiguous unit "{unit_text}"', unit, "write Hz, kHz or MHz")
    return _pint_factor(unit_text, unit)


def _meant(unit_text: str, unit: str) -> str:
    """The usual unit of what `unit` measures that differs by signs and capitals only; empty where there is none.

    >>> _meant("mms", "m/s"), _meant("mm/sec^2", "m/s^2"), _meant("kg", "m/s")
    ('mm/s', 'mm/s^2', '')
    """
    known = [unit, *COMMON_UNITS.get(unit, {}), describe_kind(unit)[1].split(" ", 1)[-1]]
    plain = {_letters(name): name for name in reversed(known)}
    return plain.get(_letters(unit_text.replace("sec", "s")), "")


def _letters(unit_text: str) -> str:
    """Letters and powers of a unit, without what joins them."""
    return re.sub(r"[^a-zµΩ%0-9]", "", unit_text.lower())


def _pint_factor(unit_text: str, unit: str) -> Fraction:
    """Ask pint for the factor; every way it can fail becomes a `QuantityError`."""
    example = describe_kind(unit)[1]
    meant = _meant(unit_text, unit)
    did_you_mean = f'did you mean "{meant}"?'
    unknown = QuantityError(
        f'the unknown unit "{unit_text}"', unit, did_you_mean if meant else f'use a unit as in "{example}"'
    )
    spelled = re.sub(r"[·.]", "*", unit_text).replace("**", "^").replace("²", "^2")
    if not _UNIT_TEXT.fullmatch(spelled):
        raise unknown
    import pint

    registry = _registry()
    try:
        factor = registry.Quantity(Fraction(1), registry.parse_units(spelled)).to(unit).magnitude
    except pint.DimensionalityError:
        remedy = did_you_mean if meant else f'use a unit of the same dimension as in "{example}"'
        if "N" in unit and _OUNCE_OR_POUND.search(spelled):
            remedy = "oz and lb are masses; write the forces as ozf and lbf"
        raise QuantityError(f'the unit "{unit_text}", which measures something else', unit, remedy) from None
    except Exception as error:
        # Pint reports a malformed unit by half a dozen kinds of exception; to the user all mean the same.
        raise unknown from error
    return Fraction(factor)
