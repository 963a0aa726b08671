"""How the page writes numbers, directions and tables."""

from dataclasses import dataclass
from math import degrees as to_degrees
from math import isinf, isnan, pi

from markupsafe import Markup

from detent.page.parts import INCH

GAP = "\u202f"  # narrow space that does not break: between a number and its unit, and between thousands


def count(value: int, word: str = "", plural: str = "") -> str:
    """Write a whole number with groups of three digits, and the word it counts.

    >>> count(2912, "line").replace(GAP, " ")
    '2 912 lines'
    """
    digits = f"{value:,}".replace(",", GAP)
    if not word:
        return digits
    return f"{digits} {word if value == 1 else plural or word + 's'}"


def further(value: int, word: str) -> str:
    """Begin a sentence about what is left out.

    >>> further(1, "line"), further(12, "line")
    ('1 further line is', '12 further lines are')
    """
    return f"{count(value, 'further ' + word)} {'is' if value == 1 else 'are'}"


def number(value: float | None, digits: int = 3) -> str:
    """Write a number with so many significant digits and no exponent; "-" for None and NaN.

    >>> number(0.38249), number(1234.6), number(170.0), number(None)
    ('0.382', '1235', '170', '\u2013')
    """
    if value is None or isnan(value):
        return "\u2013"
    if isinf(value):
        return "\u221e" if value > 0 else "\u2212\u221e"
    if value == 0:
        return "0"
    if value == round(value) and abs(value) < 1e15:
        return str(round(value)).replace("-", "\u2212")
    # The power of ten after rounding: 9.996 is 10.0, not 10.00.
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    places = max(0, digits - 1 - exponent)
    return f"{value:.{places}f}".replace("-", "\u2212")


def duration(seconds: float) -> str:
    """Write a time as a person says it.

    >>> [duration(value).replace(GAP, " ") for value in (0.1334, 31.42, 125.0, 3780.0)]
    ['0.133 s', '31.4 s', '2 min 05 s', '1 h 03 min']
    """
    if seconds < 99.95:
        return f"{number(seconds)}{GAP}s"
    if seconds < 3599.5:
        minutes, rest = divmod(round(seconds), 60)
        return f"{minutes}{GAP}min {rest:02d}{GAP}s"
    hours, rest = divmod(round(seconds / 60), 60)
    return f"{hours}{GAP}h {rest:02d}{GAP}min"


def milliseconds(seconds: float) -> str:
    """Write a time in milliseconds, with its unit."""
    return f"{number(seconds * 1e3)}{GAP}ms"


def length(value: float) -> str:
    """Write a small length [m] in micrometres, and one that is not small in millimetres.

    >>> [length(value).replace(GAP, " ") for value in (5.69e-6, 0.4219e-3, 0.0994)]
    ['5.7 µm', '422 µm', '99.4 mm']
    """
    if abs(value) >= 1e-3:
        return f"{number(value * 1e3)}{GAP}mm"
    return f"{number(value * 1e6, 2 if abs(value) < 10e-6 else 3)}{GAP}µm"


ARCSEC = pi / 180 / 3600  # a second of arc [rad]
SMALL = 360 * ARCSEC  # angles below this are written in seconds of arc [rad]


def degrees(value: float, digits: int = 3) -> str:
    """Write an angle [rad] or a speed [rad/s] in degrees, without its unit.

    >>> degrees(pi), degrees(0.0349)
    ('180', '2.00')
    """
    # Radians of a round figure of degrees come back as one.
    return number(round(to_degrees(value), 9), digits)


def angle(value: float) -> str:
    """Write a small angle in seconds of arc, and one that is not small in degrees.

    >>> [angle(value).replace(GAP, " ") for value in (1.704e-5, 0.0017, 0.0349)]
    ['3.5 arcsec', '351 arcsec', '2.00 deg']
    """
    if abs(value) >= SMALL:
        return f"{degrees(value)}{GAP}deg"
    seconds = round(value / ARCSEC, 6)
    return f"{number(seconds, 2 if abs(seconds) < 10 else 3)}{GAP}arcsec"


@dataclass(frozen=True, slots=True)
class CountUnit:
    """The smallest way that an axis knows: its size [m or rad] and what it is called, "step" or "pulse"."""

    size: float
    word: str

    @property
    def words(self) -> str:
        """The plural."""
        return self.word + "s"

    def counts(self, value: float) -> str:
        """Write a way in counts, with two digits.

        >>> CountUnit(6.61e-6, "step").counts(5.69e-6), CountUnit(5e-6, "pulse").counts(5e-6)
        ('0.86 steps', '1 pulse')
        """
        text = number(value / self.size, 2)
        return f"{text} {self.word if text == '1' else self.words}"


def inches_per_second(speed: float) -> str:
    """Write a speed [m/s] in in/s, without its unit."""
    return number(round(abs(speed) / INCH, 2))


def arrow(direction: int) -> Markup:
    """An arrow to the right for +1, to the left for -1, in the colour of the direction."""
    name, sign = ("right", "\u2192") if direction > 0 else ("left", "\u2190")
    return Markup('<span class="arrow {}">{} {}</span>').format(name, sign, name)


def percent(share: float) -> str:
    """Write a share in percent, with three digits: 5.74 %, and two where it is small."""
    if isnan(share):
        return "\u2013"
    value = 100 * share
    return f"{number(value, 3 if value >= 0.1 else 2)}{GAP}%"
