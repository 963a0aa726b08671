"""Steps with registers of single precision: what firmware makes of them, and what it refuses."""

import math

from detent.kernel.registers import Registers, f4, f8, i8, real, register
from detent.kernel.single import alike, sqrt


class Mixed(Registers):
    """Registers of both precisions."""

    x: f4 = register("any number")
    y: f4 = register("any number")
    z: f8 = register("any number")
    n: i8 = register("any number", unit="count")


class Law(Registers):
    """Registers of whichever the axis has."""

    gain: real = register("a factor")
    limit: real = register("a limit", range=(1e-6, 0.1))
    place: f8 = register("a double in both")


# ---- inside of the language


def operators(r: Mixed, a: int) -> float:
    """All of singles, whole numbers and conversions; constants are whole."""
    first = r.x * r.y + r.x / (abs(r.y) + 1) - r.n * r.x
    first = min(max(first, -r.y), 2 * abs(r.x))
    r.x += first if a > 0 else 1
    r.z = r.x - alike(r.x, r.z)
    r.y = r.z + a
    return -first


def roots(r: Mixed, a: int) -> float:
    """Square roots, calls with singles, truth values."""
    r.y = sqrt(abs(r.x)) + halved(r.y)
    r.n = int(float(r.y)) if r.y and abs(r.y) < 1e18 else a
    return halved(r.x)


def halved(value: float) -> float:
    """Half of it, in its precision."""
    return value / 2


def comparisons(r: Mixed, a: int) -> int:
    """Beside constants that no single is equal to, the nearest on the right side decides."""
    bits = (1 if r.x < 0.1 else 0) + (2 if 0.1 < r.x else 0)  # noqa: SIM300 - both ways round
    bits += (4 if r.x <= 0.1 else 0) + (8 if r.x >= 0.1 else 0)
    bits += (16 if abs(r.x) < 1e300 else 0) + (32 if r.x == 0.5 else 0) + (64 if r.x == 0.1 else 0)
    return bits + (128 if r.x < r.y else 0) + (256 if r.x > a else 0) + (512 if r.x != r.z else 0)


def promoted(r: Mixed, a: int) -> None:
    """A single beside a double is one: told, and cast."""
    r.z = r.x * 0.1 + (r.x + r.y) * r.z
    r.y = r.z * a


ACCEPTED = (operators, roots, comparisons, promoted)


# ---- outside


def chosen(r: Mixed, _a: int) -> None:
    """A choice between both."""
    r.x = r.y if r.n > 0 else 0.0


def least(r: Mixed, _a: int) -> None:
    """The least of both."""
    r.x = min(r.y, r.z)


def named(r: Mixed, a: int) -> None:
    """One name for both."""
    value = r.x
    if a > 0:
        value = r.z
    r.y = value


def handed(r: Mixed, _a: int) -> None:
    """One parameter for both."""
    r.x = halved(r.y)
    r.z = halved(r.z)


def rooted(r: Mixed, _a: int) -> None:
    """A root of double precision."""
    r.x = math.sqrt(r.x)


def cut_off(r: Mixed, _a: int) -> None:
    """A whole number of a single."""
    r.n = int(r.x)


REFUSED = (chosen, least, named, handed, rooted, cut_off)
