"""What follows from a phase-servo specification: the consistency arithmetic of section 7, as figures.

Symbols: ``r`` pulley radius, ``R`` resistance of motor and bridge, ``m`` moving mass, ``k`` force per ampere, ``N``
steps per pitch, ``M`` bits of the drive word, ``Tv`` speed sample period, ``f`` reference clock, ``a`` deceleration of
the velocity table; sections are those of the phase-servo specification.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from detent.files.findings import Derived, count_figure, quantity_figure
from detent.methods.phase_servo.schema import TABLE_ENTRIES, PhaseServoSpec
from detent.methods.position import PositionSensor, Sensed
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.analysis.sampled_loop import SampledLoop

STIFFEST = 1e3
"""Steps per sample that a step of error may be worth for the exact model of the loop to be worth its numbers."""

SUBSTEPS = 8
"""Steps of a speed sample, at least, in which an approach is computed."""

PHASES = 6
"""Places within a speed sample at which an approach begins."""

LONGEST_LOOK = 12
"""Time for which it is looked at from the change of mode, over the inverse of the loop's natural frequency."""

MOST_STEPS = 1500  # of an approach at most


def position_sensors(spec: PhaseServoSpec) -> dict[str, PositionSensor]:
    """The resolver: its word is absolute within a pitch."""
    counts, lag = spec.detector.counts, spec.detector.lag_counts
    return {
        "": PositionSensor(
            sensor=f"resolver of {counts} counts a pitch, lag {lag}", kind=Sensed.BAND, scale=spec.step,
            ends=(0.0, spec.limits.travel), band=counts, window=spec.arrived_steps,
        )
    }  # fmt: skip


class PhaseFigures:
    """The machine behind a specification, in the units of its logic."""

    def __init__(self, spec: PhaseServoSpec) -> None:
        motor, mechanics, friction, drive = spec.motor, spec.mechanics, spec.mechanics.friction, spec.drive
        self.spec = spec
        self.radius = mechanics.pulley_circumference / (2 * math.pi)
        self.resistance = motor.resistance + drive.bridge_resistance
        self.mass = mechanics.carriage_mass + (motor.rotor_inertia + mechanics.pulley_inertia) / self.radius**2
        self.force_per_ampere = motor.torque_constant / self.radius
        self.volts_per_speed = motor.back_emf_constant / self.radius
        self.coulomb = max(friction.right.coulomb, friction.left.coulomb)
        self.static = max(friction.right.static, friction.left.static)
        # One count of the drive word changes the mean of a sawtooth between -ES and +ES by this (3.9).
        self.volts_per_count = 2 * drive.supply / (1 << drive.pwm_bits)
        # Drive word that breaks the carriage loose [counts].
        self.breakaway_counts = self.static / self.force_per_ampere * self.resistance / self.volts_per_count
        self.pwm_hz = spec.clock.oscillator / (1 << drive.pwm_bits)  # frequency of the sawtooth [Hz]
        self.corner_hz = self.resistance / (2 * math.pi * motor.inductance)  # electrical corner R/(2 pi L) [Hz]
        self.stall_current = drive.supply / self.resistance  # of one side of the supply at standstill [A]
        # Largest change of the current within a tick [A]: full supply and back-EMF together on the winding.
        self.current_per_tick = (drive.supply + self.volts_per_speed * spec.limits.speed) / motor.inductance * spec.tick
        # Largest force at standstill [N]: that of the current limit, or of the stall current if that is less.
        self.force_limit = min(spec.limits.effort, self.stall_current) * self.force_per_ampere
        # What the largest force does against friction [m/s^2]; below 0 if it does not overcome it.
        self.acceleration = (self.force_limit - self.coulomb) / self.mass
        # Speed at which back-EMF and friction take all of the supply [m/s]; below 0 if friction alone does.
        self.top_speed = (drive.supply - self.coulomb / self.force_per_ampere * self.resistance) / self.volts_per_speed
        self._fill_motion(spec)
        self._fill_loops(spec)

    def _fill_motion(self, spec: PhaseServoSpec) -> None:
        """What the counters make of speeds, and the end of a move."""
        self.speed_per_count = spec.step / spec.sample_period  # one pulse per sample [m/s]
        self.peak_speed = spec.peak_count * self.speed_per_count  # largest velocity of the table [m/s]
        # Fastest motion to the right and to the left that the tracker follows [m/s] (3.4); guaranteed is the latter.
        self.slew_forward = spec.step / spec.tick / (spec.detector.counts - 1)
        self.slew_backward = spec.step / spec.tick / (spec.detector.counts + 1)
        # Speed at the change of mode [m/s]: the entry before it, and half a count that the speed word cannot tell.
        self.switch_speed = (spec.table_velocity(spec.method.threshold + 1) + 0.5) * self.speed_per_count
        self.switch_distance = spec.method.threshold * spec.step  # way that is left then [m]
        self.switch_deceleration = self.switch_speed**2 / (2 * self.switch_distance)  # even, to the target [m/s^2]

    def _fill_loops(self, spec: PhaseServoSpec) -> None:
        """Both loops, without the delay of the sample."""
        (_, speed_k2, speed_k3), (k1, k2, k3) = spec.method.speed_gains, spec.method.position_gains
        friction, window = spec.mechanics.friction, spec.sample_period
        # Acceleration per count of the drive word [steps/s^2].
        self.gain = self.volts_per_count / self.resistance * self.force_per_ampere / self.mass / spec.step
        # Rate at which back-EMF and viscous friction alone bring the carriage to rest [1/s].
        viscous = min(friction.right.viscous, friction.left.viscous)
        self.decay = (self.force_per_ampere * self.volts_per_speed / self.resistance + viscous) / self.mass
        self.velocity_loop = speed_k2 * speed_k3 * self.gain * window  # bandwidth in speed mode [rad/s]
        self.position_loop = math.sqrt(k1 * k3 * self.gain)  # natural frequency in position mode [rad/s]
        self.damping = (k2 * k3 * self.gain * window + self.decay) / (2 * self.position_loop)  # ratio in position mode
        # Steps by which a running integral moves the carriage within 1 rad of the position loop.
        self.integral_rate = spec.clock.oscillator / 2**spec.clock.integrate_tap / k1 / self.position_loop

    @cached_property
    def _loop(self) -> "SampledLoop | None":
        """Position mode, the winding's lag neglected; None for a loop too stiff to be worth the numbers."""
        from detent.analysis.sampled_loop import SampledLoop

        k1, k2, k3 = self.spec.method.position_gains
        window, gain = self.spec.sample_period, k3 * self.gain
        if k1 * gain * window * min(window, 1 / self.decay) > STIFFEST:
            return None
        return SampledLoop(gain=gain, sample_period=window, scale=k2, position_gain=k1, tau_m=1 / self.decay)

    @cached_property
    def gain_margin(self) -> float:
        """By how much the gain may grow until position mode no longer settles."""
        return 0.0 if self._loop is None else self._loop.stability_limit() / self._loop.gain

    @cached_property
    def approach(self) -> "Approach":
        """How moves end."""
        return approach(self)


@dataclass(frozen=True, slots=True)
class Approach:
    """The last part of a move, in the worst of the ways in which it was tried; NaN where speed mode does not end."""

    overshoot: float  # how far position mode takes the carriage beyond its target [step]
    settling: float  # from the change of mode until it counts as arrived for good [s]; infinite if it does not
    off_at_ready: float  # how far off its target it may be when the axis says that it is ready, or later [step]


def approach(m: PhaseFigures) -> Approach:
    """The last steps of speed mode and position mode, with all that the exact model of the loop leaves out.

    That are whole counts of the speed word, whole steps of error, friction and the winding's lag. Side by side go moves
    that come along the table from four times the threshold, and one from rest a pitch away; the speed sample begins
    anywhere. A move to the left is the mirror image, but for a pulse that comes a step later: so is the second.
    """
    spec, window, method = m.spec, m.spec.sample_period, m.spec.method
    (s1, s2, s3), (k1, k2, k3), threshold = method.speed_gains, method.position_gains, method.threshold
    lag = spec.motor.inductance / m.resistance
    steps = max(SUBSTEPS, min(math.ceil(4 * window / lag), 4 * SUBSTEPS))  # of a sample
    dt, share = window / steps, -math.expm1(-window / steps / lag)
    push, rub = (force / m.mass / spec.step * dt for force in (m.force_per_ampere, m.coulomb))
    half, limit = 1 << (spec.drive.pwm_bits - 1), min(spec.limits.effort, m.stall_current)
    starts = np.array([4 * threshold, 4 * threshold + 1, max(spec.detector.counts, threshold + 2)])
    table = np.array([spec.table_velocity(n) for n in range(int(starts.max()) + 2)])
    x, begun = np.repeat(0.05 - starts, PHASES), np.tile(np.arange(PHASES) / PHASES, len(starts))
    v = np.repeat(np.where(starts == starts[2], 0, table[starts]) / window, PHASES)
    i, word, opened = np.zeros(len(x)), np.round(v * window), np.floor(x - v * begun * window)
    closes, switched = np.round((1 - begun) * steps), np.full(len(x), -1)
    look = min(math.ceil(LONGEST_LOOK / m.position_loop / dt), MOST_STEPS)
    places: list[NDArray[np.float64]] = []
    for k in range(2 * MOST_STEPS):
        place = np.floor(x)
        left = np.clip(-place, 0, len(table) - 1).astype(int)
        switched = np.where((switched < 0) & (left <= threshold), k, switched)
        in_position = switched >= 0
        if in_position.all() and (k >= switched.max() + look or (k % steps == 0 and not (v.any() or word.any()))):
            break
        error = -place - (place >= 0) if method.corrector else -place - 1
        u = np.where(in_position, k3 * (k1 * error - k2 * word), s3 * (s1 * table[left] - s2 * word))
        volts = np.clip(u, -half, half - 1) * m.volts_per_count - m.volts_per_speed * spec.step * v
        i = np.clip(i + (volts / m.resistance - i) * share, -limit, limit)
        v = v + push * i
        v = np.sign(v) * np.maximum(np.abs(v) - rub, 0.0)
        x = x + v * dt
        places.append(x)
        at_sample, place = (k + 1 - closes) % steps == 0, np.floor(x)
        word, opened = np.where(at_sample, place - opened, word), np.where(at_sample, place, opened)
    way = np.array(places)
    ends = [way[k : k + look, n] for n, k in enumerate(switched) if 0 <= k < len(way)]
    if not ends:
        return Approach(math.nan, math.nan, math.nan)
    outside = [np.flatnonzero(np.abs(end) > spec.arrived_steps) for end in ends]
    last = max(int(out[-1]) + 1 if len(out) else 0 for out in outside)
    ready = round(method.ready_time / dt)
    return Approach(
        overshoot=max(0.0, *(float(end.max()) for end in ends)),
        settling=math.inf if last > 0.75 * look else last * dt,
        off_at_ready=max(float(np.abs(end[min(ready, 3 * len(end) // 4) :]).max()) for end in ends),
    )


def weakest_output(spec: PhaseServoSpec) -> float:
    """Least amplitude of the detector's secondary over the electrical angle x, over its nominal.

    It is ``hypot((1 + g) cos x - sin q sin x, cos q sin x)`` (gain error g, quadrature error q;
    `sensing.phase_detector.fill_errors`), which is least at the smaller singular value of that matrix.
    """
    gain, q = 1 + spec.detector.gain_error, spec.detector.quadrature_error
    # Singular values: squares add up to (1 + g)^2 + 1, their product is (1 + g) cos q.
    total, product = gain**2 + 1, gain * math.cos(q)
    least = math.sqrt(max(0.0, total - math.sqrt(max(0.0, total**2 - 4 * product**2))) / 2)
    return least * spec.detector.amplitude


def derive(spec: PhaseServoSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    m = PhaseFigures(spec)
    return (*_logic(m), *_motion(m), *_loops(m))


def _speed(name: str, value: float, formula: str, step: float) -> Derived:
    text = f"{format_quantity(value, 'm/s')} ({value / step:.5g} steps/s)"
    return Derived(name, value, "m/s", text, formula)


def _logic(m: PhaseFigures) -> Iterator[Derived]:
    """Lengths, clocks, what one count of each word is; how fast the carriage may be, and how far it may go."""
    spec = m.spec
    yield quantity_figure("pitch", spec.pitch, "m", "pulley circumference / pitches per revolution")
    yield quantity_figure("step", spec.step, "m", "pitch / N")
    yield quantity_figure("reference clock", 1 / spec.tick, "Hz", "oscillator / 2, the base tick")
    yield quantity_figure("carrier", 1 / spec.tick / spec.detector.counts, "Hz", "reference clock / N")
    yield quantity_figure("speed sample period", spec.sample_period, "s", f"2^{spec.clock.sample_tap} / oscillator")
    period = 2**spec.clock.integrate_tap / spec.clock.oscillator
    yield quantity_figure("integration period", period, "s", f"2^{spec.clock.integrate_tap} / oscillator")
    yield quantity_figure("one count of the drive word", m.volts_per_count, "V", "2 ES / 2^M")
    k3 = spec.method.position_gains[2]
    yield quantity_figure("one unit of the integral", k3 * m.volts_per_count, "V", "KP3 counts of the drive word")
    yield _speed("one count of the speed word", m.speed_per_count, "step / Tv", spec.step)
    yield _speed("slew limit, right", m.slew_forward, "f / (N - 1) steps/s", spec.step)
    yield _speed("slew limit, left", m.slew_backward, "f / (N + 1) steps/s", spec.step)
    share = m.peak_speed / m.slew_backward
    formula = f"{spec.peak_count} counts x step / Tv, {100 * share:.3g} % of the slew limit"
    yield _speed("peak speed", m.peak_speed, formula, spec.step)
    bits = spec.peak_count.bit_length() + 1
    yield Derived("speed word", bits, "bit", f"{bits} of {spec.method.speed_bits} bits", "peak and sign")
    steps = spec.limits.travel / spec.step
    text = f"{steps:.6g} steps ({math.floor(spec.limits.travel / spec.pitch + 1e-9)} pitches) of 65535"
    yield Derived("longest distance", steps, "step", text, "limits.travel / step")
    spare = spec.detector.counts // 2 - spec.method.threshold - 1
    yield Derived("tolerated spurious pulses", spare, "count", f"up to {spare} in a move", "below N/2 - threshold")


def _motion(m: PhaseFigures) -> Iterator[Derived]:
    """The velocity table and what happens at its end; forces, voltages, and how fast things happen."""
    spec = m.spec
    distance = bisect_left(range(TABLE_ENTRIES - 1), spec.peak_count, key=spec.table_velocity)
    formula = f"floor(sqrt(2 a n step) / step x Tv + 1/2), n up to {TABLE_ENTRIES - 1}"
    text = f"{spec.peak_count} counts from {distance} steps on"
    yield Derived("peak of the velocity table", distance, "step", text, formula)
    formula = "entry above the threshold + 1/2 count"
    yield _speed("speed at the change of mode", m.switch_speed, formula, spec.step)
    way = format_quantity(m.switch_distance, "m")
    yield quantity_figure(
        "deceleration after the change of mode", m.switch_deceleration, "m/s^2", f"v^2 / 2 / {way} (threshold x step)"
    )
    if math.isfinite(m.approach.settling):
        formula = f"until a move stays within {spec.arrived_steps} steps, with whole counts, friction and winding"
        yield quantity_figure("settling after the change of mode", m.approach.settling, "s", formula)
    supply, resistance = spec.drive.supply, m.resistance
    yield quantity_figure("moving mass", m.mass, "kg", "carriage + (rotor + pulley) / r^2")
    yield quantity_figure("force at the current limit", m.force_limit, "N", "limits.effort x k")
    yield quantity_figure("acceleration against friction", m.acceleration, "m/s^2", "(force - coulomb) / m")
    yield quantity_figure("stall current", m.stall_current, "A", "supply / R")
    emf = m.volts_per_speed * m.peak_speed
    yield quantity_figure("back-EMF at peak speed", emf, "V", f"Ke / r x peak speed, of {format_quantity(supply, 'V')}")
    constant = spec.motor.inductance / resistance
    yield quantity_figure("electrical time constant", constant, "s", "L / R")
    ratio = m.pwm_hz / m.corner_hz
    text = f"{format_quantity(m.pwm_hz, 'Hz')} ({ratio:.3g} x the electrical corner)"
    formula = f"oscillator / 2^M, corner R / (2 pi L) = {format_quantity(m.corner_hz, 'Hz')}"
    yield Derived("PWM frequency", m.pwm_hz, "Hz", text, formula)


def _loops(m: PhaseFigures) -> Iterator[Derived]:
    """Bandwidths and what friction is worth."""
    for name, value, formula in (
        ("velocity loop", m.velocity_loop, "KS2 KS3 x (count of the drive word) k / (R m) / (count of the speed word)"),
        ("position loop", m.position_loop, "sqrt(KP1 KP3 x (count of the drive word) k / (R m) / step)"),
    ):
        yield Derived(name, value, "rad/s", f"{value:.4g} rad/s", formula)
    if math.isfinite(m.approach.overshoot):
        formula = "from the last steps of speed mode, with whole counts, friction and winding"
        over = m.approach.overshoot
        text = f"{over:.2g} steps, {format_quantity(over * m.spec.step, 'm')}"
        yield Derived("overshoot of a move", over, "step", text, formula)
    formula = "(KP2 KP3 velocity feedback + back-EMF) / (2 x position loop), without delays"
    yield Derived("damping of the position loop", m.damping, "", f"{m.damping:.3g}", formula)
    yield count_figure("breakaway drive", m.breakaway_counts, "static x R / k / (count of the drive word)")
    k1, _, k3 = m.spec.method.position_gains
    yield count_figure("drive of one step", k1 * k3, "KP1 x KP3")
