"""What follows from a cascade specification: masses, resonances, dead time, bandwidths, what the drive can do.

Symbols: ``m`` the moving mass, ``m1``, ``m2`` what moves at motor and load, ``k``, ``d`` stiffness and damping of the
coupling, ``T`` sample period, ``Kp``, ``Kv`` gains of position and velocity loop, ``v``, ``a`` limits.
"""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from detent.files.findings import Derived, quantity_figure
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.position import PositionSensor, Sensed
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.methods.cascade.loop import LinearLoop


def position_sensors(spec: CascadeSpec) -> dict[str, PositionSensor]:
    """The encoder of the position loop; one that reads the position itself is kept in nanometres or nanoradians."""
    scale = spec.encoder_of("position").resolution or 1e-9
    sensor = f"incremental encoder of the {spec.method.feedback.position}"
    window = max(1, round(spec.method.in_position / scale))
    return {
        "": PositionSensor(
            sensor=sensor, kind=Sensed.INCREMENTAL, scale=scale, unit=spec.unit("m"),
            ends=(spec.limits.lowest, spec.highest), window=window, held=spec.brake is not None,
        )
    }  # fmt: skip


def dead_time(spec: CascadeSpec) -> float:
    """Time from a motion until the drive acts on its velocity [s]: hold, delays, half the velocity's span, filter."""
    table = spec.encoder_of("velocity")
    samples = 0.5 + spec.drive.delay + table.delay + 0.5 * table.velocity_span
    return samples * spec.method.sample_period + table.velocity_filter


def grain(spec: CascadeSpec) -> float:
    """A count of the position loop's encoder; of an ideal one a fiftieth of the in-position window [m]."""
    return spec.encoder_of("position").resolution or 0.02 * spec.method.in_position


class CascadeFigures:
    """The machine behind a specification, with the model of its loops."""

    def __init__(self, spec: CascadeSpec) -> None:
        self.spec = spec
        self.speed = spec.limits.speed
        self.per_command = spec.effort_per_command

    def figure(self, name: str, value: float, linear: str, formula: str) -> Derived:
        """A figure in the unit of the axis, by that of a linear axis."""
        return quantity_figure(name, value, self.spec.unit(linear), formula)

    @cached_property
    def loop(self) -> "LinearLoop":
        """Exact linear model of both loops."""
        from detent.methods.cascade.loop import LinearLoop

        return LinearLoop(self.spec)

    @property
    def anti_resonance(self) -> float:
        """The load swings against the motor held still [Hz]; 0 for a rigid axis."""
        return 1 / self.spec.swing if self.spec.swing else 0.0

    def needed(self, speed: float, acceleration: float = 0.0) -> float:
        """Force of the motor at a speed [m/s] and an acceleration [m/s^2] in the harder direction [N]."""
        spec, mechanics = self.spec, self.spec.mechanics
        sides = [(sense * mechanics.weight, spec.friction(sense)) for sense in (1, -1)]
        resisting = [weight + one.coulomb + one.viscous * speed for weight, one in sides]
        return max(*resisting, 0.0) + mechanics.pendulum + spec.mass * acceleration

    def available(self, speed: float) -> float:
        """Largest force behind the transmission at a speed [m/s]; a voltage drive's falls by the back-EMF [N]."""
        spec = self.spec
        by_voltage = spec.largest_command * self.per_command - spec.back_emf_drag * speed
        return max(0.0, min(spec.largest_effort, by_voltage)) * (1.0 - spec.mechanics.transmission_loss)

    def breaking(self, share: float = 1.0) -> float:
        """Force that breaks the axis loose in the harder direction, with a share of its weight [N]."""
        weight, pendulum = share * self.spec.mechanics.weight, abs(share) * self.spec.mechanics.pendulum
        return max(self.spec.friction(1).static + weight, self.spec.friction(-1).static - weight) + pendulum

    def _left(self, sense: int) -> float:
        """Command at limits.speed that feedforward leaves to the loops, and an integral does not take over [V]."""
        if self.integrates:
            return 0.0
        spec, shares, friction = self.spec, self.spec.method.feed_forward, self.spec.friction(sense)
        drag = spec.back_emf_drag
        force = (friction.viscous + drag) * self.speed - shares.viscous * (spec.viscous + drag) * self.speed
        beyond = friction.coulomb if self.speed <= shares.dead_band else (1 - shares.coulomb) * friction.coulomb
        return (force + beyond + sense * (1 - shares.weight) * spec.mechanics.weight) / self.per_command

    @property
    def following_error(self) -> float:
        """Largest following error at limits.speed once it is steady, pendulum aside [m]."""
        method = self.spec.method
        behind = (1 - method.feed_forward.velocity) * self.speed
        left = [self._left(sense) for sense in (1, -1)]
        if method.structure == "cascade":
            return max(abs(behind + one / method.velocity_gain) for one in left) / method.position_gain
        held = [abs(one + method.derivative * behind) / method.proportional for one in left]
        return 0.0 if self.integrates else max(held)

    @property
    def velocity_demand(self) -> float:
        """Largest velocity demand at limits.speed once it is steady [m/s]; of a PID, which has none, 0."""
        method = self.spec.method
        left = max(self._left(1), self._left(-1), 0.0)
        return 0.0 if method.structure == "pid" else self.speed + left / method.velocity_gain

    @property
    def integrates(self) -> bool:
        """Whether an integral takes the error at rest away."""
        method = self.spec.method
        return (method.integral if method.structure == "pid" else method.velocity_integral) > 0

    @property
    def resting_error(self) -> float:
        """Largest error at which static friction and weight still hold the axis [m]; 0 with an integral."""
        if self.integrates:
            return 0.0
        method = self.spec.method
        gain = method.proportional if method.structure == "pid" else method.velocity_gain * method.position_gain
        return self.breaking(1 - method.feed_forward.weight) / (gain * self.per_command)

    @property
    def counted_velocity(self) -> float:
        """Velocity that one count in a span means [m/s]."""
        table = self.spec.encoder_of("velocity")
        return table.resolution / (table.velocity_span * self.spec.method.sample_period)

    @property
    def jump(self) -> float:
        """Command by which one count of the velocity moves the drive [V]."""
        method, gain = self.spec.method, self.spec.method.velocity_gain
        if method.structure == "pid":
            gain = method.derivative * self.loop.derivative_share
        return gain * self.loop.velocity_share * self.counted_velocity


def derive(spec: CascadeSpec) -> Iterator[Derived]:
    """All derived figures, in the order they are read."""
    machine = CascadeFigures(spec)
    for group in (_masses, _swings, _clocks, _drive, _loops, _errors):
        yield from group(machine)


def _masses(m: CascadeFigures) -> Iterator[Derived]:
    """What moves."""
    name = "moment of inertia" if m.spec.axis.motion == "rotary" else "mass"
    rotor = "" if m.spec.motor is None else " + rotor / (travel per radian)^2"
    yield m.figure(f"moving {name} m", m.spec.mass, "kg", f"motor_mass + load_mass{rotor}")
    if m.spec.mechanics.coupling is not None:
        yield m.figure(f"motor-side {name} m1", m.spec.motor_mass, "kg", f"motor_mass{rotor}")


def _swings(m: CascadeFigures) -> Iterator[Derived]:
    """Both masses on their coupling."""
    spec, coupling = m.spec, m.spec.mechanics.coupling
    if coupling is None:
        return
    inverse = 1.0 / spec.motor_mass + 1.0 / spec.mechanics.load_mass
    resonance = math.sqrt(coupling.stiffness * inverse)
    damping = 0.5 * coupling.damping * inverse / resonance
    yield m.figure("anti-resonance", m.anti_resonance, "Hz", "sqrt(k / m2) / 2 pi")
    yield m.figure("resonance", resonance / (2 * math.pi), "Hz", "sqrt(k (1/m1 + 1/m2)) / 2 pi")
    formula = "d (1/m1 + 1/m2) / (2 x 2 pi resonance)"
    yield Derived("damping ratio of the resonance", damping, "", f"{damping:.3g}", formula)


def _clocks(m: CascadeFigures) -> Iterator[Derived]:
    """Sampling and dead time."""
    formula = "T (1/2 + drive.delay + encoder's delay + velocity_span / 2) + velocity_filter"
    yield m.figure("dead time of the velocity loop", dead_time(m.spec), "s", formula)
    if m.spec.encoder_of("velocity").resolution > 0:
        yield m.figure("velocity resolution", m.counted_velocity, "m/s", "resolution / (velocity_span x T)")


def _drive(m: CascadeFigures) -> Iterator[Derived]:
    """What the drive can do, and what the limits need of it."""
    spec, speed, acceleration = m.spec, m.speed, m.spec.limits.acceleration
    if spec.motor is not None:
        yield m.figure("motor speed at limits.speed", speed / spec.radius, "rad/s", "v / travel per radian")
    formula = "the smallest limit of converter, drive.max_current and limits.effort"
    yield m.figure("largest command", spec.largest_command, "V", formula)
    what = "torque" if spec.axis.motion == "rotary" else "force"
    formula = "at standstill, from the largest command and current"
    yield m.figure(f"largest {what}", spec.largest_effort, "N", formula)
    hardest = m.needed(speed, acceleration)
    yield m.figure(f"acceleration {what}", hardest, "N", "m a + friction at limits.speed + weight")
    command = (hardest / (1.0 - spec.mechanics.transmission_loss) + spec.back_emf_drag * speed) / m.per_command
    yield m.figure("acceleration command", command, "V", "for this force, plus back-EMF")
    if spec.motor is not None and spec.drive.input == "current":
        voltage = spec.motor.resistance * (hardest / spec.force_constant) + spec.emf_constant * speed
        formula = "R x acceleration current + back-EMF at limits.speed: the supply must provide this"
        yield m.figure("motor voltage", voltage, "V", formula)
    if spec.holding > 0:
        yield m.figure("command that holds the weight", spec.holding / m.per_command, "V", "at rest")
    yield m.figure("acceleration time", speed / acceleration, "s", "v / a, jerk neglected")
    yield m.figure("acceleration distance", speed**2 / (2 * acceleration), "m", "v^2 / (2 a), jerk neglected")


def _loops(m: CascadeFigures) -> Iterator[Derived]:
    """Bandwidths and margins of the exact linear model."""
    for name, margin in (("velocity loop", m.loop.velocity_loop), ("position loop", m.loop.position_loop)):
        if margin.crossover > 0:
            formula = "gain crossover of the open loop; dead times, filters and resonance included"
            yield m.figure(f"bandwidth of the {name}", margin.crossover, "Hz", formula)
            text = format_quantity(margin.phase, "rad", 3)
            yield Derived(f"phase margin of the {name}", margin.phase, "rad", text, "smallest over all gain crossovers")
    formula = "factor on the overall loop gain at which a mode no longer decays"
    yield Derived("gain margin", m.loop.gain_margin, "", f"{m.loop.gain_margin:.3g}", formula)
    if m.loop.spectral_radius < 1.0:
        level, peak = m.loop.sensitivity
        formula = "largest 1/|1 + L|, both loops cut open where the amplifier sees them"
        yield Derived("Ms at the command", level, "", f"{level:.3g}", formula)
        yield m.figure("frequency of Ms", peak, "Hz", "where a disturbance is amplified most")


def _errors(m: CascadeFigures) -> Iterator[Derived]:
    """How the axis follows and how it rests."""
    formula = "((1 - share) v + command not fed forward / Kv, 0 with an integral) / Kp"
    if m.spec.method.structure == "pid":
        formula = "(command not fed forward + Kd (1 - share) v) / proportional; 0 with an integral"
    yield m.figure("following error at limits.speed", m.following_error, "m", formula)
    if not m.integrates:
        formula = "at most: static friction and weight not fed forward / static loop stiffness"
        yield m.figure("error at rest", m.resting_error, "m", formula)
