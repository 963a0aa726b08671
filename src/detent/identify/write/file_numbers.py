"""What logs say in numbers of an axis file: identified constants, each with its interval, and the limits they show.

An axis file has forces, masses, and friction of two masses; a log shows what its effort did to the moving mass. So
the effort is converted to a force by what the file says of its drive, and what the file states beside a number, such as
the friction of the load, is taken off it.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from detent.axisfile.motion import unit_in
from detent.errors import DetentError
from detent.identify.analyse.sensors import estimate_resolution
from detent.identify.fit.constants import hanging_position
from detent.identify.fit.equations import Run, make_kernel
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import Identification
from detent.logs.log import Log
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec, DirectionTable, FrictionTable
from detent.units import format_quantity

NATIVE = {"linear": "N", "rotary": "N*m"}  # unit of an effort that an axis file has itself, by the motion of its axis
MOST_LOSS = 0.95  # largest share of the effort that a file can say is lost
# Unit of a constant in the file of a linear axis, by its kind; that of the others is N.
LINEAR_UNITS = {"mass": "kg", "viscous": "N*s/m", "stribeck": "m/s", "delay": "s", "spring": "N/m", "loss": ""}
_WAYS = ("positive", "negative")
WINDOW = 0.02  # half of the window of velocities and accelerations [s]
NEARLY_ALL = 0.999  # share of the samples whose speed and acceleration count: the rest may be noise


@dataclass(frozen=True, slots=True)
class Number:
    """A number of an axis file."""

    key: str  # dotted key
    value: float  # in `unit`; a pure number where that is empty
    unit: str  # SI unit
    note: str  # its interval and where it comes from
    trusted: bool = True  # False where the identification refused it
    name: str = ""  # of the constant it comes from; empty where it is a choice
    low: float = math.nan  # and high: ends of its 95 % interval, as the value
    high: float = math.nan

    @property
    def text(self) -> str:
        """The value as a file has it."""
        return f'"{format_quantity(self.value, self.unit, 6)}"' if self.unit else f"{self.value:.6g}"


@dataclass(frozen=True, slots=True)
class Scale:
    """How the effort of a log becomes the force of an axis file."""

    factor: float = 1.0  # force per effort
    drag: float = 0.0  # force per velocity that back-EMF takes, and that the log shows as viscous friction [N s/m]

    def in_file(self, found: Estimate, motion: str) -> Estimate:
        """An estimate as the file of an axis has it, and its unit there."""
        kind = found.name.partition(".")[0]
        f = 1.0 if kind in {"stribeck", "delay", "loss"} else self.factor
        less = self.drag if kind == "viscous" else 0.0
        value, low, high = (f * v - less for v in (found.value, found.low, found.high))
        unit = unit_in(motion, LINEAR_UNITS.get(kind, "N"))
        return replace(found, value=value, unit=unit, error=f * found.error, low=low, high=high)


def scale_of(spec: CascadeSpec, run: Run) -> Scale:
    """How the effort of a run becomes the force of an axis."""
    motion = "rotary" if run.is_rotary else "linear"
    if spec.axis.motion != motion:
        raise DetentError(
            f"{run.name}: got a position in {run.position_unit}; expected: {spec.unit('m')}, as {spec.axis.name} is a "
            f"{spec.axis.motion} axis; state the unit of the column, or name another axis file"
        )
    by_voltage = Scale(spec.effort_per_command, spec.back_emf_drag)
    scales = {NATIVE[motion]: Scale(), "1": by_voltage, "V": by_voltage}
    if spec.motor is not None:
        scales["A"] = Scale(spec.force_constant)
        if spec.drive.input == "voltage":
            scales["V"] = Scale(spec.force_constant / spec.motor.resistance, spec.back_emf_drag)
        if motion == "linear":
            scales["N*m"] = Scale(1.0 / spec.radius)
    if run.effort_unit in scales:
        return scales[run.effort_unit]
    role = "torque" if motion == "rotary" else "force"
    raise DetentError(
        f"{run.name}: got a {run.effort_name} in {run.effort_unit}; expected for {spec.axis.name}: "
        f"{', '.join(scales)}; give what it does in these, such as --column '{role}=COLUMN [35 {NATIVE[motion]}]' with "
        f"the {role} per {run.effort_unit}"
    )


def stated_constants(spec: CascadeSpec) -> dict[str, float]:
    """Constants of a whole axis as its file states them, by the names of the identification, in SI units."""
    mechanics = spec.mechanics
    frictions = (mechanics.friction, mechanics.load_friction)
    found = {
        "mass": spec.mass,
        "pendulum": mechanics.pendulum,
        "pendulum.across": 0.0,
        "delay": (spec.drive.delay + spec.encoder.delay) * spec.method.sample_period,
        "loss": mechanics.transmission_loss,
        "spring": 0.0,
    }
    fading = False
    for way, sign in zip(_WAYS, (1.0, -1.0), strict=True):
        tables = [_direction(f, way) for f in frictions]
        steady = sum(t.coulomb + sign * f.offset for t, f in zip(tables, frictions, strict=True))
        found[f"coulomb.{way}"] = steady + sign * mechanics.weight
        found[f"viscous.{way}"] = sum(t.viscous for t in tables)
        excess = sum(t.static - t.coulomb for t in tables if t.stribeck > 0)
        fading = fading or excess > 0
        found[f"static.{way}"] = found[f"coulomb.{way}"] + excess
    if fading:
        found["stribeck"] = max(_direction(mechanics.friction, way).stribeck for way in _WAYS)
    return found


def _direction(friction: FrictionTable, way: str) -> DirectionTable:
    return friction.positive if way == "positive" else friction.negative


@dataclass(frozen=True, slots=True)
class Contrast:
    """A constant that an axis file states outside of its interval.

    Attributes
    ----------
    name : str
        Name of the constant.
    stated : float
        Of the whole axis, by the file.
    found : Estimate
        The same by the logs, in the units of the file.
    """

    name: str
    stated: float
    found: Estimate

    def __str__(self) -> str:
        """Give it as one line."""
        unit = self.found.unit
        limits = f"{format_quantity(self.found.low, unit)} to {format_quantity(self.found.high, unit)}"
        return f"{self.name}: the file states {format_quantity(self.stated, unit)}, the log {limits}"


def contrasts(found: Identification, spec: CascadeSpec) -> list[Contrast]:
    """Constants that a file states outside of what was identified and is trusted."""
    scale, stated = scale_of(spec, found.runs[0]), stated_constants(spec)
    known = [scale.in_file(e, spec.axis.motion) for e in found.trusted if e.name in stated]
    return [Contrast(e.name, stated[e.name], e) for e in known if not e.holds(stated[e.name])]


class FileNumbers:
    """Identified constants as numbers of an axis file."""

    def __init__(self, found: Identification, base: CascadeSpec | None = None) -> None:
        run = found.runs[0]
        scale = Scale() if base is None else scale_of(base, run)
        self.motion = "rotary" if run.is_rotary else "linear"
        self._found, self._base = found, base
        self._known = {e.name: scale.in_file(e, self.motion) for e in found.estimates}
        self._trusted = {e.name for e in found.trusted}
        names = [one.name for one in found.logs]
        self._where = plain(names[0]) if len(names) == 1 else f"{len(names)} logs"

    def numbers(self) -> Iterator[Number]:
        """Every number, in the order of the file."""
        run, base = self._found.runs[0], self._base
        if "delay" in self._known:
            period = run.step if base is None else base.method.sample_period
            samples = round(self._value("delay") / period) - (0 if base is None else base.encoder.delay)
            within, text = float(min(max(samples, 0), MOST_SAMPLES)), f"samples of {format_quantity(period, 's')}; "
            yield self._make("drive.delay", within, "", "delay", text, period)
        yield self._mass()
        if "pendulum" in self._known:
            weight = math.hypot(self._value("pendulum"), self._value("pendulum.across"))
            place = 0.0 if self._found.constants is None else hanging_position(self._found.constants)
            text = "" if abs(place) < math.radians(1) else f"hangs at {format_quantity(place, 'rad', 3)} of the log; "
            yield self._make("mechanics.pendulum", weight, "N*m", "pendulum", text)
        if "loss" in self._known:
            share = min(max(self._value("loss"), 0.0), MOST_LOSS)
            yield self._make("mechanics.transmission_loss", share, "", "loss")
        yield from self._friction()

    def interval(self, name: str) -> str:
        """What is said of a constant's limits."""
        e = self._known[name]
        digits = 4
        while digits < 8 and e.low != e.high and f"{e.low:.{digits - 1}g}" == f"{e.high:.{digits - 1}g}":
            digits += 1
        low, high = (format_quantity(limit, e.unit, digits) for limit in (e.low, e.high))
        return f"95 %: {low} to {high}, {self._where}"

    def _unit(self, linear: str) -> str:
        return unit_in(self.motion, linear)

    def _value(self, name: str) -> float:
        return self._known[name].value if name in self._known else 0.0

    def _make(  # noqa: PLR0913 - a number, its constant, and the samples that a delay is counted in
        self, key: str, value: float, linear: str, name: str, text: str = "", period: float = 0.0
    ) -> Number:
        found, scale = self._known[name], 1.0 / period if period else 1.0
        low, high = (value + scale * (end - found.value) for end in (found.low, found.high))
        note, trusted = f"{text}{self.interval(name)}", name in self._trusted
        return Number(key, value, self._unit(linear), note, trusted, name, low, high)

    def _mass(self) -> Number:
        base, total = self._base, self._value("mass")
        if base is None:
            return self._make("mechanics.motor_mass", total, "kg", "mass")
        on_load = base.mechanics.coupling is not None or base.mechanics.load_mass > 0
        rest = base.motor_mass if on_load else base.mass - base.mechanics.motor_mass
        key = f"mechanics.{'load' if on_load else 'motor'}_mass"
        if total <= rest and "mass" in self._trusted:
            unit = self._unit("kg")
            raise DetentError(
                f"{base.axis.name}: got {format_quantity(total, unit)} for the total moving mass; expected: more than "
                f"{format_quantity(rest, unit)}, which the axis file states without {key}; correct the axis file"
            )
        text = f"with the other {format_quantity(rest, self._unit('kg'))} of this file; " if rest else ""
        return self._make(key, total - rest, "kg", "mass", text)

    def _friction(self) -> Iterator[Number]:
        """Friction of the motor's side: the whole without the load's and the weight."""
        base = self._base
        load = FrictionTable() if base is None else base.mechanics.load_friction
        weight = 0.0 if base is None else base.mechanics.weight
        needs: dict[str, float] = {}
        for way, sign in zip(_WAYS, (1.0, -1.0), strict=True):
            beside = _direction(load, way).coulomb + sign * (load.offset + weight)
            needs[way] = self._value(f"coulomb.{way}") - beside
        # Force that does not turn round: as stated where that leaves a friction in both directions, else the half.
        offset = 0.5 * (needs["positive"] - needs["negative"])
        stated = offset if base is None else base.mechanics.friction.offset
        if needs["positive"] >= stated and needs["negative"] >= -stated:
            offset = stated
        if base is None or offset != base.mechanics.friction.offset:
            trusted = {"coulomb.positive", "coulomb.negative"} <= self._trusted
            text = (
                "half of the difference between directions: in motion it cannot be separated from "
                "direction-dependent friction"
            )
            yield Number("mechanics.friction.offset", offset, self._unit("N"), text, trusted)
        for way, sign in zip(_WAYS, (1.0, -1.0), strict=True):
            yield from self._one_way(way, sign * offset, max(needs[way] - sign * offset, 0.0), _direction(load, way))

    def _one_way(self, way: str, offset: float, coulomb: float, load: DirectionTable) -> Iterator[Number]:
        """Friction in one direction."""
        table = f"mechanics.friction.{way}"
        if f"coulomb.{way}" not in self._known:
            return
        unit = self._unit("N")
        text = f"with the offset {format_quantity(coulomb + offset, unit)}; " if offset else ""
        yield self._make(f"{table}.coulomb", coulomb, "N", f"coulomb.{way}", text)
        yield from self._low_speed(way, offset, coulomb, load)
        if f"viscous.{way}" in self._known:
            value = self._value(f"viscous.{way}") - load.viscous
            text = "negative; " if value < 0 else ""
            yield self._make(f"{table}.viscous", max(value, 0.0), "N*s/m", f"viscous.{way}", text)

    def _low_speed(self, way: str, offset: float, coulomb: float, load: DirectionTable) -> Iterator[Number]:
        """Static friction of one direction, and where it ends."""
        table, name, base = f"mechanics.friction.{way}", f"static.{way}", self._base
        if name not in self._known:
            # The log shows none of its own: never below Coulomb friction.
            if base is None or _direction(base.mechanics.friction, way).static < coulomb:
                note, trusted = "none above Coulomb friction is visible in the log", f"coulomb.{way}" in self._trusted
                yield Number(f"{table}.static", coulomb, self._unit("N"), note, trusted)
            return
        on_load = load.static - load.coulomb if load.stribeck else 0.0
        excess = self._value(name) - self._value(f"coulomb.{way}") - on_load
        text = "with the offset; " if offset else ""
        yield self._make(f"{table}.static", coulomb + max(excess, 0.0), "N", name, text)
        if "stribeck" in self._known:
            trusted = {name, "stribeck"} <= self._trusted and self._known["stribeck"].low > 0.0
            found = self._make(f"{table}.stribeck", max(self._value("stribeck"), 0.0), "m/s", "stribeck")
            yield replace(found, trusted=trusted)


def plain(name: str) -> str:
    """A name that any comment or text can hold."""
    return "".join(c if c.isprintable() else "?" for c in name)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Where an axis may go, or went, and how fast, in m or rad."""

    lowest: float  # and highest: positions
    highest: float
    speed: float  # and acceleration: largest magnitudes [m/s, m/s^2]
    acceleration: float  # [m/s, m/s^2]
    start: float  # where it stands, in logs at the begin of the first
    is_rotary: bool  # True for angles
    # effort, period, resolution: of logs, the largest magnitude, the longest time between two samples [s], and the
    # coarsest way of a count of the encoder, 0 where none shows
    effort: float = 0.0
    period: float = 0.0
    resolution: float = 0.0
    grid: float = 0.0  # coarsest grid on which positions lie, where no counts show in their steps; 0 for none

    @property
    def way(self) -> float:
        """Distance between the extreme positions."""
        return self.highest - self.lowest


def see(runs: Sequence[Run]) -> Bounds:
    """Extremes of runs."""
    units = {run.position_unit for run in runs}
    if len(units) > 1 or not units <= {"m", "rad"}:
        got = " and ".join(sorted(units))
        raise DetentError(
            f"{runs[0].name}: got positions in {got}; expected: m or rad, the same in all logs; state the unit of the "
            "column, such as --column 'position=COLUMN [0.3125 um]' for counts"
        )
    # Largest speed and acceleration of each run, by a window that noise does not pass.
    extremes: list[list[float]] = []
    for run in runs:
        half = min(max(5, round(WINDOW / run.step)), (len(run.position) - 1) // 2)
        kernel, rows = make_kernel(half, run.step), np.arange(half, len(run.position) - half)
        motion = kernel.velocity(run.position, rows), kernel.acceleration(run.position, rows)
        extremes.append([float(np.quantile(np.abs(values), NEARLY_ALL)) for values in motion])
    return Bounds(
        lowest=min(float(run.position.min()) for run in runs),
        highest=max(float(run.position.max()) for run in runs),
        speed=max(speed for speed, _ in extremes),
        acceleration=max(rise for _, rise in extremes),
        effort=max(float(np.abs(run.effort).max()) for run in runs),
        start=float(runs[0].position[0]),
        period=max(run.step for run in runs),
        resolution=max(run.resolution for run in runs),
        is_rotary=runs[0].is_rotary,
    )


def grid_of(logs: Sequence[Log]) -> float:
    """Coarsest grid on which the positions of logs lie; 0 where there is none."""
    steps = [estimate_resolution(log.signals["position"]).step for log in logs]
    return max((step for step in steps if math.isfinite(step)), default=0.0)


def outwards(value: float, *, up: bool, size: float) -> float:
    """Round a value to two digits of a size, away from what it bounds.

    >>> outwards(0.2034, up=True, size=0.4), outwards(-0.2034, up=False, size=0.4)
    (0.21, -0.21)
    """
    if not size > 0.0:
        return value
    unit = 10.0 ** (math.floor(math.log10(size)) - 1)
    return float(f"{(math.ceil if up else math.floor)(value / unit) * unit:.12g}")
