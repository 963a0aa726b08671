"""What follows from a cascade specification: masses, resonances, dead time, bandwidths, what the drive can do.

Symbols: ``m`` all that moves, ``m1``, ``m2`` what moves at motor and load, ``k``, ``d`` stiffness and damping of the
coupling, ``T`` sample period, ``Kp``, ``Kv`` gains of position and velocity loop, ``v``, ``a`` limits.
"""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from detent.files.findings import Derived, quantity_figure
from detent.methods.cascade.schema import CascadeSpec, FrictionTable
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.methods.cascade.loop import LinearLoop


def dead_time(spec: CascadeSpec) -> float:
    """Time from a motion until the drive acts on its velocity [s].

    Hold of a sample, delays of encoder and amplifier, half the span of the velocity and its filter.
    """
    table = spec.velocity_encoder
    samples = 0.5 + spec.drive.delay + table.delay + 0.5 * table.velocity_span
    return samples * spec.method.sample_period + table.velocity_filter


class Machine:
    """The machine behind a specification, with the model of its loops."""

    def __init__(self, spec: CascadeSpec) -> None:
        self.spec = spec
        self.frictions: tuple[FrictionTable, FrictionTable] = (spec.mechanics.friction, spec.mechanics.load_friction)
        self.speed = spec.limits.speed
        self.per_command = spec.effort_per_command

    @cached_property
    def loop(self) -> "LinearLoop":
        """Exact linear model of both loops."""
        from detent.methods.cascade.loop import LinearLoop

        return LinearLoop(self.spec)

    @property
    def is_stable(self) -> bool:
        """Whether every mode of the loops decays."""
        return self.loop.spectral_radius < 1.0

    @property
    def anti_resonance(self) -> float:
        """The load swings against the motor held still [rad/s]; 0 for a rigid axis."""
        coupling = self.spec.mechanics.coupling
        return 0.0 if coupling is None else math.sqrt(coupling.stiffness / self.spec.mechanics.load_mass)

    @property
    def resonance(self) -> float:
        """Both masses swing against each other [rad/s]; 0 for a rigid axis."""
        coupling = self.spec.mechanics.coupling
        return 0.0 if coupling is None else math.sqrt(coupling.stiffness * self.inverse_mass)

    @property
    def inverse_mass(self) -> float:
        """Sum of the inverse masses [1/kg]."""
        return 1.0 / self.spec.motor_mass + 1.0 / self.spec.mechanics.load_mass

    @property
    def damping(self) -> float:
        """Damping ratio of that swing."""
        coupling = self.spec.mechanics.coupling
        return 0.0 if coupling is None else 0.5 * coupling.damping * self.inverse_mass / self.resonance

    def resisting(self, sense: int, speed: float) -> float:
        """Force that holds a speed [m/s] in the direction `sense`, 1 or -1, without back-EMF [N]."""
        force = sense * self.spec.mechanics.weight
        for friction in self.frictions:
            table = friction.positive if sense > 0 else friction.negative
            force += table.coulomb + table.viscous * speed + sense * friction.offset
        return force

    @property
    def holding(self) -> float:
        """Force that holds the load against its weight, hanging loads at a quarter turn [N]."""
        return abs(self.spec.mechanics.weight) + self.spec.mechanics.pendulum

    def needed(self, speed: float, acceleration: float = 0.0) -> float:
        """Force of the motor at a speed [m/s] and an acceleration [m/s^2] in the harder direction [N]."""
        resisting = max(self.resisting(1, speed), self.resisting(-1, speed), 0.0)
        return resisting + self.spec.mechanics.pendulum + self.spec.mass * acceleration

    def available(self, speed: float) -> float:
        """Largest force behind the transmission at a speed [m/s]; a voltage drive's falls by the back-EMF [N]."""
        spec = self.spec
        by_voltage = spec.largest_command * self.per_command - spec.back_emf_drag * speed
        return max(0.0, min(spec.largest_effort, by_voltage)) * (1.0 - spec.mechanics.transmission_loss)

    def command(self, force: float, speed: float) -> float:
        """Command for a force behind the transmission [N] at a speed [m/s] [V]."""
        passed = force / (1.0 - self.spec.mechanics.transmission_loss)
        return (passed + self.spec.back_emf_drag * speed) / self.per_command

    def breaking(self, weight: float) -> float:
        """Force that breaks the axis loose in the harder direction, with a weight [N] along the axis [N]."""
        forward = backward = 0.0
        for friction in self.frictions:
            forward += max(friction.positive.static, friction.positive.coulomb) + friction.offset
            backward += max(friction.negative.static, friction.negative.coulomb) - friction.offset
        return max(forward + weight, backward - weight)

    def _left(self, sense: int) -> float:
        """Command at limits.speed that feed-forward leaves to the loops [V]."""
        shares, drag = self.spec.method.feed_forward, self.spec.back_emf_drag
        viscous = coulomb = mean = 0.0
        for friction in self.frictions:
            table = friction.positive if sense > 0 else friction.negative
            viscous += table.viscous
            mean += 0.5 * (friction.positive.viscous + friction.negative.viscous)
            coulomb += table.coulomb + sense * friction.offset
        force = (viscous + drag) * self.speed - shares.viscous * (mean + drag) * self.speed
        beyond = coulomb if self.speed <= shares.dead_band else (1 - shares.coulomb) * coulomb
        return (force + beyond + sense * (1 - shares.weight) * self.spec.mechanics.weight) / self.per_command

    @property
    def following_error(self) -> float:
        """Largest following error at limits.speed once it is steady, pendulum aside [m]."""
        method = self.spec.method
        behind = (1 - method.feed_forward.velocity) * self.speed
        left = [self._left(sense) for sense in (1, -1)]
        if method.structure == "pid":
            if method.integral > 0:
                return 0.0
            return max(abs(one + method.derivative * behind) / method.proportional for one in left)
        lags = [0.0, 0.0] if method.velocity_integral > 0 else [one / method.velocity_gain for one in left]
        return max(abs(behind + lag) for lag in lags) / method.position_gain

    @property
    def velocity_demand(self) -> float:
        """Largest velocity demand at limits.speed once it is steady [m/s]; of a PID, which has none, 0."""
        method = self.spec.method
        if method.structure == "pid":
            return 0.0
        lags = [self._left(sense) / method.velocity_gain for sense in (1, -1)]
        return self.speed + (0.0 if method.velocity_integral > 0 else max(*lags, 0.0))

    @property
    def stiffness(self) -> float:
        """Force per error at rest without the integral [N/m]."""
        method = self.spec.method
        gain = method.proportional if method.structure == "pid" else method.velocity_gain * method.position_gain
        return gain * self.per_command

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
        left = 1 - self.spec.method.feed_forward.weight
        held = self.breaking(left * self.spec.mechanics.weight) + abs(left) * self.spec.mechanics.pendulum
        return held / self.stiffness

    @property
    def counted_velocity(self) -> float:
        """Velocity that one count in a span means [m/s]."""
        table = self.spec.velocity_encoder
        return table.resolution / (table.velocity_span * self.spec.method.sample_period)

    @property
    def jump(self) -> float:
        """Command by which one count of the velocity moves the drive [V]."""
        method = self.spec.method
        by_velocity = method.velocity_gain
        smoothed = self.loop.velocity_share
        if method.structure == "pid":
            by_velocity = method.derivative * self.loop.derivative_share
        return by_velocity * smoothed * self.counted_velocity


def derive(spec: CascadeSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    machine = Machine(spec)
    groups = (_masses, _swings, _clocks, _drive, _loops, _errors)
    return tuple(figure for group in groups for figure in group(machine))


def _figure(machine: Machine, name: str, value: float, linear: str, formula: str) -> Derived:
    """Figure in a unit of the axis's motion."""
    return quantity_figure(name, value, machine.spec.unit(linear), formula)


def _masses(machine: Machine) -> Iterator[Derived]:
    """What moves."""
    spec = machine.spec
    name = "moment of inertia" if spec.axis.motion == "rotary" else "mass"
    formula = "motor_mass + load_mass" + ("" if spec.motor is None else " + rotor / (travel per radian)^2")
    yield _figure(machine, f"moving {name} m", spec.mass, "kg", formula)
    if spec.mechanics.coupling is not None:
        yield _figure(
            machine, f"{name} on the motor's side m1", spec.motor_mass, "kg", formula.replace(" + load_mass", "")
        )


def _swings(machine: Machine) -> Iterator[Derived]:
    """Both masses on their coupling."""
    if machine.spec.mechanics.coupling is None:
        return
    yield quantity_figure("anti-resonance", machine.anti_resonance / (2 * math.pi), "Hz", "sqrt(k / m2) / 2 pi")
    yield quantity_figure("resonance", machine.resonance / (2 * math.pi), "Hz", "sqrt(k (1/m1 + 1/m2)) / 2 pi")
    formula = "d (1/m1 + 1/m2) / (2 x 2 pi resonance)"
    yield Derived("damping of the resonance", machine.damping, "", f"{machine.damping:.3g}", formula)


def _clocks(machine: Machine) -> Iterator[Derived]:
    """Sampling and dead time."""
    formula = "T (1/2 + drive.delay + encoder's delay + velocity_span / 2) + velocity_filter"
    yield quantity_figure("dead time of the velocity loop", dead_time(machine.spec), "s", formula)
    if machine.spec.velocity_encoder.resolution > 0:
        formula = "resolution / (velocity_span x T)"
        yield _figure(machine, "velocity of one count", machine.counted_velocity, "m/s", formula)


def _drive(machine: Machine) -> Iterator[Derived]:
    """What the drive can do, and what the limits need of it."""
    spec, speed, acceleration = machine.spec, machine.speed, machine.spec.limits.acceleration
    if spec.motor is not None:
        yield _figure(machine, "motor speed at limits.speed", speed / spec.radius, "rad/s", "v / travel per radian")
    formula = "of converter, drive.max_current and limits.effort the least"
    yield quantity_figure("largest command", spec.largest_command, "V", formula)
    what = "torque" if spec.axis.motion == "rotary" else "force"
    yield _figure(
        machine, f"largest {what}", spec.largest_effort, "N", "at standstill, by the largest command and current"
    )
    hardest = machine.needed(speed, acceleration)
    yield _figure(machine, f"{what} of an acceleration", hardest, "N", "m a + friction at limits.speed + weight")
    yield quantity_figure("command of an acceleration", machine.command(hardest, speed), "V", "that, and back-EMF")
    if spec.motor is not None and spec.drive.input == "current":
        current = hardest / spec.force_constant
        formula = "R x current of an acceleration + back-EMF at limits.speed: the amplifier needs as much"
        voltage = spec.motor.resistance * current + spec.emf_constant * speed
        yield quantity_figure("voltage of the motor", voltage, "V", formula)
    if machine.holding > 0:
        yield quantity_figure("command that holds the weight", machine.holding / machine.per_command, "V", "at rest")
    yield quantity_figure("time of an acceleration", speed / acceleration, "s", "v / a, jerk aside")
    way = speed**2 / (2 * acceleration)
    yield _figure(machine, "way of an acceleration", way, "m", "v^2 / (2 a), jerk aside")


def _loops(machine: Machine) -> Iterator[Derived]:
    """Bandwidths and margins of the exact linear model."""
    loop = machine.loop
    for name, margin in (("velocity loop", loop.velocity_loop), ("position loop", loop.position_loop)):
        if margin.crossover > 0:
            formula = "the open loop's gain falls below 1; dead times, filters and resonance included"
            yield quantity_figure(f"bandwidth of the {name}", margin.crossover, "Hz", formula)
            text = format_quantity(margin.phase, "rad", 3)
            yield Derived(f"phase margin of the {name}", margin.phase, "rad", text, "smallest over all crossings")
    formula = "factor of the whole loop's gain at which a mode no longer decays"
    yield Derived("gain margin", loop.gain_margin, "", f"{loop.gain_margin:.3g}", formula)


def _errors(machine: Machine) -> Iterator[Derived]:
    """How the axis follows and how it rests."""
    method = machine.spec.method
    if method.structure == "pid":
        formula = "(command left by feed-forward + Kd (1 - share) v) / proportional; 0 with an integral"
    else:
        formula = "((1 - share) v + command left by feed-forward / Kv, unless there is an integral) / Kp"
    yield _figure(machine, "following error at limits.speed", machine.following_error, "m", formula)
    if machine.integrates:
        return
    formula = "static friction and weight not fed forward / stiffness of the loop at rest"
    yield _figure(machine, "error at rest", machine.resting_error, "m", f"up to: {formula}")
