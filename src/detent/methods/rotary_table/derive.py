"""What follows from a rotary-table specification: counts and words, drive, following error, jog, detector.

Symbols: ``G`` motor turns per table turn, ``T`` period of the absolute angle, ``v`` limits.speed, ``a``
limits.acceleration, ``J`` inertia at the motor, ``tau`` time constant of the velocity loop, ``Kp`` position gain;
sections are those of the rotary-table specification. Angles are those of the table.
"""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from detent.files.findings import Derived, count_figure, quantity_figure
from detent.methods.position import PositionSensor, Sensed
from detent.methods.rotary_table.loop import HeldLoop
from detent.methods.rotary_table.schema import FineTable, RotaryTableSpec
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.analysis.linear_system import LinearSystem

TICK = 1e-4  # base tick [s] (`methods.rotary_table.system`)

POINTS = 256  # places of a turn at which the errors of a resolver are looked at, those of `kernel.turn_table`


def position_sensors(spec: RotaryTableSpec) -> dict[str, PositionSensor]:
    """Two resolvers that show the angle within the turn; their zero is that of the calibration (3.1)."""
    fine, coarse = spec.detector.fine, spec.detector.coarse
    sensor = (
        f"resolvers of {fine.counts} and {coarse.counts} counts, gear 1:{spec.ratio}, "
        f"calibrated at {fine.mounting!r} rad and {coarse.mounting!r} rad"
    )
    window = max(1, spec.method.in_position)
    return {
        "": PositionSensor(
            sensor=sensor, kind=Sensed.ABSOLUTE, scale=spec.count, unit="rad", band=spec.period, window=window
        )
    }


class TableFigures:
    """The machine behind a specification."""

    def __init__(self, spec: RotaryTableSpec) -> None:
        drive, method, mechanics, fine = spec.drive, spec.method, spec.mechanics, spec.detector.fine
        self.spec, self.gain, self.speed = spec, method.position_gain, spec.limits.speed
        self.loop = HeldLoop(
            self.gain, 1 - drive.droop, drive.time_constant, method.strobe_period, method.interrupt_delay
        )
        # What droop and friction take at limits.speed [N m].
        self.resisting_torque = spec.viscous * self.speed * spec.ratio + mechanics.coulomb
        # Least speed word whose torque at standstill is above static friction [count].
        per_word = spec.stiffness * spec.speed_per_word * spec.ratio
        self.breaking_word = math.floor(mechanics.static / per_word) + 1
        # Largest deviation at which the table stays at rest [count]: S4 is rounded to a word too small.
        least = (self.breaking_word - 0.5) * spec.speed_per_word / self.gain / spec.count
        self.resting_error = max(0, math.ceil(least * (1 - 1e-9)) - 1)
        self.noise = math.ceil(fine.noise / math.tau * fine.counts)  # largest error of an angle by it [count]
        self.latency_way = self.speed * method.task_period  # in a period of the timer task at limits.speed [rad]
        # Largest sum of errors with which the motor turns still come out right [rad] (3.1).
        self.allowed_coarse_error = math.pi / spec.ratio - math.tau / spec.detector.coarse.counts - spec.count
        # Largest angle error of the table against the fine resolver's angle, which no loop sees [rad].
        self.table_error = 0.5 * mechanics.backlash + mechanics.eccentricity + resolver_error(fine) / spec.ratio

    @cached_property
    def is_stable(self) -> bool:
        """Whether every mode of the loop decays."""
        return self.loop.spectral_radius < 1.0

    def overshoot(self, speed: float) -> float:
        """Way by which the table passes a target that it comes to at this speed [rad]."""
        acceleration = self.spec.limits.acceleration
        return acceleration * self.loop.stop(speed / acceleration)[0]

    @cached_property
    def peak_acceleration(self) -> float:
        """Largest acceleration of the table over that of its command."""
        return self.loop.stop(math.inf)[1]

    def word_at(self, speed: float) -> float:
        """Speed word that holds a speed of the table [rad/s] against droop and friction [count]."""
        against = self.spec.mechanics.coulomb / self.spec.stiffness / self.spec.ratio
        return (speed / (1 - self.spec.drive.droop) + against) / self.spec.speed_per_word

    def following_error(self, speed: float) -> float:
        """Deviation with which the table follows at a steady speed [rad]."""
        return self.word_at(speed) * self.spec.speed_per_word / self.gain

    @property
    def accelerating_torque(self) -> float:
        """Largest torque while the table is accelerated to limits.speed [N m]."""
        motor = self.spec.limits.acceleration * self.peak_acceleration * self.spec.ratio
        return self.spec.inertia * motor + self.resisting_torque

    def peak_word(self, speed: float) -> float:
        """Largest speed word after an acceleration to a speed of the table [rad/s] [count]."""
        return self.word_at(speed) + self.overshoot(speed) * self.gain / self.spec.speed_per_word

    def deviation(self, torque: float) -> float:
        """Deviation that holds a torque at the motor [rad]: neither loop has an integral part."""
        return torque / self.spec.stiffness / self.spec.ratio / self.gain

    @property
    def held_away(self) -> float:
        """Largest distance from its target at which friction, a load and noise can hold a table at rest [rad]."""
        load, counts = self.spec.disturbance.load, self.resting_error + self.noise + self.spec.method.in_position
        pushed = 0.0 if load is None else self.deviation(abs(load.torque) / self.spec.ratio)
        return counts * self.spec.count + pushed

    @property
    def coarse_errors(self) -> dict[str, float]:
        """Largest errors of the coarse word against the fine one, by their source [rad]."""
        fine, coarse = self.spec.detector.fine, self.spec.detector.coarse
        errors = {
            "backlash": 0.5 * coarse.backlash,
            "eccentricity": coarse.eccentricity,
            "alignment": abs(coarse.alignment_error),
            "windings and comparator": resolver_error(coarse),
            "noise": coarse.noise,
            "fine resolver": (resolver_error(fine) + fine.noise) / self.spec.ratio,
        }
        return {name: error for name, error in errors.items() if error > 0}


def resolver_error(table: FineTable) -> float:
    """Largest error of a resolver's angle by its windings and comparator [rad].

    As `sensing.phase_detector.fill_errors` has it, on the same places of a turn.
    """
    if not (table.gain_error or table.quadrature_error or table.offset_error):
        return 0.0
    worst = 0.0
    for k in range(POINTS):
        x = math.tau * k / POINTS
        a = (1 + table.gain_error) * math.cos(x) - math.sin(table.quadrature_error) * math.sin(x)
        b = math.cos(table.quadrature_error) * math.sin(x)
        late = math.asin(max(-1.0, min(1.0, table.offset_error / math.hypot(a, b))))
        worst = max(worst, abs(math.remainder(math.atan2(b, a) - x, math.tau) + late))
    return worst


def weakest_output(table: FineTable) -> float:
    """Smallest amplitude of a resolver's output over a turn, of the nominal one.

    The smaller singular value of ``(1 + g, -sin q; 0, cos q)``, by which the windings give sine and cosine.
    """
    gain, cos, sin = 1 + table.gain_error, math.cos(table.quadrature_error), math.sin(table.quadrature_error)
    return (math.hypot(gain + cos, sin) - math.hypot(gain - cos, sin)) / 2


def arc_seconds(angle: float) -> str:
    """Write a small angle [rad] in degrees and in seconds of arc."""
    return f"{format_quantity(angle, 'rad')} ({3600 * math.degrees(angle):.4g} seconds of arc)"


def counted(counts: int) -> str:
    """Write a number of counts."""
    return f"{counts} count{'' if counts == 1 else 's'}"


def linear_loops(spec: RotaryTableSpec) -> "dict[str, LinearSystem]":
    """The loop of an axis, by where it is cut."""
    return {"position": TableFigures(spec).loop.open_loop()}


def derive(spec: RotaryTableSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    machine = TableFigures(spec)
    loop = _loop(machine) if spec.method.position_control else ()
    return (*_words(machine), *_drive(machine), *loop, *_motion(machine), *_detector(machine))


def _words(machine: TableFigures) -> Iterator[Derived]:
    """What a count is, and a word; strobe, interrupt and task."""
    spec, method = machine.spec, machine.spec.method
    yield Derived("period T", spec.period, "count", f"{spec.period} counts", "G x fine counts: a turn of the table")
    yield Derived("count", spec.count, "rad", arc_seconds(spec.count), "360 deg / T")
    yield quantity_figure("speed of one word", spec.speed_per_word, "rad/s", "full speed / largest word / G")
    formula = "motor.max_speed or drive.full_speed, the lower one, / G"
    yield quantity_figure("largest table speed", spec.largest_speed, "rad/s", formula)
    per_interrupt = machine.speed * method.strobe_period / spec.count
    text = f"{per_interrupt:.4g} counts in an interrupt"
    yield Derived("distance per interrupt at limits.speed", per_interrupt, "count", text, "v x strobe period / count")
    least = spec.count / method.strobe_period
    formula = "count / 2^(fraction bits) / strobe period"
    yield quantity_figure("slowest jog", least / (1 << method.fraction_bits), "rad/s", formula)
    formula = "count / strobe period: below it D is at standstill in some interrupts"
    yield quantity_figure("slowest jog with a count in each interrupt", least, "rad/s", formula)
    passes = method.task_period / method.strobe_period
    yield Derived("interrupts in a pass of the task", passes, "", f"{passes:.4g}", "task period / strobe period")
    turn = math.tau / machine.speed / method.strobe_period
    yield Derived("interrupts in a turn at limits.speed", turn, "", f"{turn:.4g}", "360 deg / v / strobe period")


def _drive(machine: TableFigures) -> Iterator[Derived]:
    """Inertia, stiffness, acceleration."""
    spec, speed, acceleration = machine.spec, machine.speed, machine.spec.limits.acceleration
    yield quantity_figure("inertia at the motor J", spec.inertia, "kg*m^2", "rotor + gear + table / G^2")
    yield quantity_figure("stiffness of the velocity loop", spec.stiffness, "N*m*s/rad", "(1 - droop) x J / tau")
    yield quantity_figure("acceleration time", speed / acceleration, "s", "v / a")
    formula = "v^2 / (2 a), to limits.speed or from it to rest"
    yield quantity_figure("acceleration distance", speed**2 / (2 * acceleration), "rad", formula)
    if machine.spec.method.position_control and machine.is_stable:
        formula = f"J x G x {machine.peak_acceleration:.3g} a, as the loop swings, + droop and friction at limits.speed"
        yield quantity_figure("acceleration torque", machine.accelerating_torque, "N*m", formula)


def _loop(machine: TableFigures) -> Iterator[Derived]:
    """How the table follows, and how the loop settles."""
    loop = machine.loop
    error = machine.following_error(machine.speed)
    formula = "(v / (1 - droop) + Coulomb friction / (stiffness x G)) / Kp"
    yield quantity_figure("following error at limits.speed", error, "rad", formula)
    ideal = 1 / (2 * math.sqrt(loop.gain * loop.share * loop.time_constant))
    yield Derived("damping without sampling", ideal, "", f"{ideal:.3g}", "1 / (2 sqrt(Kp (1 - droop) tau))")
    formula = "least damped oscillatory mode, with strobe period and interrupt delay"
    yield Derived("damping of the loop", loop.damping, "", f"{loop.damping:.3g}", formula)
    limit = loop.largest_gain(0.0)
    text = f"Kp = {limit:.4g} 1/s, {limit / loop.gain:.3g} x the gain"
    yield Derived("stability limit", limit, "1/s", text, "lowest Kp at which a mode does not decay")
    if machine.is_stable:
        passed = machine.overshoot(machine.speed)
        formula = "at a stop from limits.speed; by as much the following error grows after an acceleration"
        yield quantity_figure("overshoot", passed, "rad", formula)


def _motion(machine: TableFigures) -> Iterator[Derived]:
    """Cycle and rollover of a jog; what is in position, and how the table rests."""
    spec, method = machine.spec, machine.spec.method
    yield quantity_figure("cycle of a jog", math.tau / machine.speed, "s", "T / v: one rollover in each")
    way = machine.latency_way
    formula = "v x task period: the pass that sees less than T comes up to that late"
    yield Derived("latency of a rollover", way, "rad", f"0 to {format_quantity(way, 'rad')}", formula)
    window = method.in_position * spec.count
    text = f"+-{arc_seconds(window)} for {format_quantity(method.in_position_time, 's')}"
    yield Derived("in position", window, "rad", text, "in_position x count")
    if method.position_control:
        error = machine.resting_error
        formula = "S4 rounded below the least word that moves the table, over Kp"
        yield Derived("deviation at rest", error, "count", f"up to {counted(error)}", formula)
    load = spec.disturbance.load
    if load is not None and method.position_control:
        error = abs(machine.deviation(load.torque / spec.ratio))
        yield quantity_figure("deviation under the load", error, "rad", "torque / G / (stiffness x G x Kp)")


def _detector(machine: TableFigures) -> Iterator[Derived]:
    """Composition and conversion (3.1)."""
    spec, detector = machine.spec, machine.spec.detector
    allowed = machine.allowed_coarse_error
    text = f"+-{format_quantity(allowed, 'rad')}"
    yield Derived("allowed coarse error", allowed, "rad", text, "180 deg / G - 360 deg / coarse counts - count")
    errors = machine.coarse_errors
    if errors:
        total = sum(errors.values())
        yield Derived("coarse error", total, "rad", f"up to {format_quantity(total, 'rad')}", " + ".join(errors))
    if machine.table_error > 0:
        formula = "gear's backlash / 2 + eccentricity + fine resolver / G: outside the loop"
        yield quantity_figure("angle error of the table", machine.table_error, "rad", formula)
    fine, coarse = detector.fine.counts / detector.clock, detector.coarse.counts / detector.clock
    yield quantity_figure("fine conversion", fine, "s", "fine counts / clock: a period of the excitation")
    if coarse != fine:
        yield quantity_figure("coarse conversion", coarse, "s", "coarse counts / clock: a period of the excitation")
    way = machine.speed * fine / spec.count
    formula = "v x fine conversion: the word of a strobe is up to that old"
    yield count_figure("distance per conversion at limits.speed", way, formula)
