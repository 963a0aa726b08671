"""Exact linear model of the cascade axis: plant, dead times, velocity by differences and both loops, at the samples.

    x(k+1) = Ad x(k) + Bd u(k)       plant between two samples, the amplifier's output u held
    v(k)   = v(k-1) + a [(q(k-d) - q(k-d-n)) / (n T) - v(k-1)]
    c(k)   = law of `control.cascade_law` on q(k-d), v(k)
    u(k)   = gain c(k-D)

x : current (where the winding has inductance), position and velocity of the motor, and of the load on its coupling
q, v, c : position and velocity read, command       d, D : delays of encoder and amplifier [samples]
n, a : span and filter of the velocity              T : sample period [s]

The command is not limited, counts are not rounded, both masses move, the flanks of a backlash touch, and a load that
hangs does so near its lowest place.
"""

import math
from functools import cached_property
from importlib import import_module
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.methods.cascade.schema import CascadeSpec
from detent.plant.linear_two_mass import linear_plant

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]

GRID = 4000  # frequencies at which an open loop is looked at, evenly spaced on a logarithmic scale
DECADES = 6  # of frequency, below half the sample rate
LARGEST_MARGIN = 1e3  # largest gain margin that is looked for
MARGIN_STEP = 1.2  # steps in which the limit of stability is approached


def machine_of(spec: CascadeSpec) -> Any:
    """Motor, coupling and load with the names of `plant.two_mass.TwoMassParams`, which would load compiled blocks."""
    mechanics, motor = spec.mechanics, spec.motor
    coupling = mechanics.coupling or SimpleNamespace(stiffness=0.0, damping=0.0, backlash=0.0)
    winding = SimpleNamespace(used=motor is not None and spec.drive.input == "voltage")
    if motor is not None and winding.used:
        winding.resistance, winding.inductance = motor.resistance, motor.inductance
        winding.max_current = spec.max_current
        winding.force_constant, winding.emf_constant = spec.force_constant, spec.emf_constant
    return SimpleNamespace(
        winding=winding,
        motor=SimpleNamespace(mass=spec.motor_mass, friction=mechanics.friction),
        load=SimpleNamespace(mass=mechanics.load_mass, friction=mechanics.load_friction),
        stiffness=coupling.stiffness,
        damping=coupling.damping,
        half_gap=0.5 * coupling.backlash,
        weight=mechanics.weight,
        pendulum=mechanics.pendulum,
        loss=mechanics.transmission_loss,
    )


class Margin(NamedTuple):
    """Where an open loop crosses a gain of 1."""

    crossover: float  # frequency at which the gain first falls below 1 [Hz]; 0 where it never does
    phase: float  # smallest phase margin over all crossings [rad]


class LinearLoop:
    """The closed loop."""

    def __init__(self, spec: CascadeSpec) -> None:
        self.spec = spec
        self.period = spec.method.sample_period
        frictions = (spec.mechanics.friction, spec.mechanics.load_friction)
        drags = [min(f.positive.viscous, f.negative.viscous) for f in frictions]
        self.plant = linear_plant(machine_of(spec), (drags[0], drags[1]))
        self.gain = spec.drive.voltage_gain if spec.drive.input == "voltage" else spec.effort_per_command
        # Encoders of both loops, and the places of the positions that they read.
        self.position_sensor, self.velocity_sensor = spec.encoder_of("position"), spec.encoder_of("velocity")
        places = {"motor": self.plant.motor, "load": self.plant.load}
        self.position_place = places[spec.method.feedback.position]
        self.velocity_place = places[spec.method.feedback.velocity]
        # Shares of a new velocity, and of a new velocity error of a PID, that their filters take over.
        self.velocity_share = smoothing(self.velocity_sensor.velocity_filter, self.period)
        self.derivative_share = smoothing(spec.method.derivative_filter, self.period)
        highest = math.log10(0.5 / self.period)
        self.frequencies = np.logspace(highest - DECADES, highest, GRID, endpoint=False)  # of the open loops [Hz]
        self._inner, outer = self._open_loops()
        # Margins; a PID has no velocity loop, which then never crosses a gain of 1.
        self.velocity_loop, self.position_loop = (_margin(self.frequencies, loop) for loop in (self._inner, outer))

    @cached_property
    def held(self) -> tuple[Numbers, Numbers]:
        """Ad and Bd: the plant from sample to sample."""
        expm: Any = import_module("scipy.linalg").expm
        size = len(self.plant.b)
        a = np.zeros((size + 1, size + 1))
        a[:size, :size], a[:size, size] = self.plant.a, self.plant.b
        whole = expm(a * self.period)
        return whole[:size, :size], whole[:size, size]

    def transition(self, more: float = 1.0) -> Numbers:
        """State from sample to sample, the reference at 0, with `more` times the gain.

        Behind the plant it holds what encoders and amplifier remember, the newest first, then the filtered velocity,
        the integral, and the filter of a PID's derivative. Quantities of a sample are rows over the state before it.
        """
        read = self.velocity_sensor
        sizes = [len(self.plant.b), self.position_sensor.delay, read.delay + read.velocity_span, self.spec.drive.delay]
        parts: list[Numbers] = np.split(np.eye(sum(sizes) + 3), np.cumsum(sizes))
        x, positions, places, commands, rest = parts
        positions = np.vstack([x[self.position_place], positions])
        places = np.vstack([x[self.velocity_place], places])
        velocity, integral, filtered = rest
        difference = (places[read.delay] - places[-1]) / (read.velocity_span * self.period)
        velocity = velocity + self.velocity_share * (difference - velocity)
        command, integral, filtered = self._law(positions[-1], velocity, integral, filtered)
        commands = np.vstack([command, commands])
        held, driven = self.held
        plant = held @ x + np.outer(driven, more * self.gain * commands[-1])
        after: Any = np.vstack([plant, positions[:-1], places[:-1], commands[:-1], velocity, integral, filtered])
        return after

    def _law(
        self, position: Numbers, velocity: Numbers, integral: Numbers, filtered: Numbers
    ) -> tuple[Numbers, Numbers, Numbers]:
        """Command, and its integral part and the filter of the derivative after the sample.

        What is not used stays 0: its own mode would be one that does not decay.
        """
        m = self.spec.method
        if m.structure == "cascade":
            error = -m.position_gain * position - velocity
            fast, slow, gain = m.velocity_gain * error, error, m.velocity_integral
            filtered = np.zeros_like(filtered)
        else:
            filtered = (1.0 - self.derivative_share) * filtered - self.derivative_share * velocity
            fast, slow, gain = -m.proportional * position + m.derivative * filtered, -position, m.integral
        integral = integral + self.period * (gain * slow) if gain > 0 else np.zeros_like(integral)
        return fast + integral, integral, filtered

    @cached_property
    def spectral_radius(self) -> float:
        """Largest factor by which a mode changes from sample to sample: below 1 the loop is stable."""
        return _radius(self.transition())

    @cached_property
    def gain_margin(self) -> float:
        """By how much the loop's gain may grow until it no longer settles; below 1 it does not settle now.

        At most `LARGEST_MARGIN`, at least its inverse, 0 where no gain so low lets it settle. An integral in both
        loops makes a loop that settles neither with much nor with little gain.
        """
        settles = self.spectral_radius < 1.0
        step = MARGIN_STEP if settles else 1.0 / MARGIN_STEP
        near = 1.0
        while 1.0 / LARGEST_MARGIN < near < LARGEST_MARGIN:
            far = near * step
            if (_radius(self.transition(far)) < 1.0) != settles:
                break
            near = far
        else:
            return LARGEST_MARGIN if settles else 0.0
        low, high = min(near, far), max(near, far)
        while high > low * 1.0001:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if _radius(self.transition(middle)) < 1.0 else (low, middle)
        return low

    def _open_loops(self) -> tuple[Phasors, Phasors]:
        """Velocity loop, and position loop with that inside it closed; of a PID no velocity loop, and all of it."""
        m, read, z = self.spec.method, self.velocity_sensor, np.exp(2j * np.pi * self.frequencies * self.period)
        held, driven = self.held
        size, span = len(driven), float(read.velocity_span)
        through = z[:, None, None] * np.eye(size) - held
        x = np.linalg.solve(through, np.broadcast_to(driven[:, None], (GRID, size, 1)).astype(np.complex128))[:, :, 0]
        x = x * (self.gain * z ** -float(self.spec.drive.delay))[:, None]
        position = x[:, self.position_place] * z ** -float(self.position_sensor.delay)
        velocity = x[:, self.velocity_place] * z ** -float(read.delay) * (1 - z**-span) / (span * self.period)
        velocity, summed = velocity * _filter(z, self.velocity_share), self.period * z / (z - 1.0)
        if m.structure == "pid":
            lead = m.derivative * _filter(z, self.derivative_share)
            return np.zeros_like(z), (m.proportional + m.integral * summed) * position + lead * velocity
        law = m.velocity_gain + m.velocity_integral * summed
        return law * velocity, m.position_gain * law * position / (1.0 + law * velocity)

    def velocity_level(self, frequency: float) -> float:
        """Gain of the open velocity loop at a frequency [Hz] below half the sample rate."""
        return float(np.interp(frequency, self.frequencies, np.abs(self._inner)))


def smoothing(time_constant: float, period: float) -> float:
    """Share of a new value that a first-order filter takes over at a sample; as `system.smoothing`, not compiled."""
    return -math.expm1(-period / time_constant) if time_constant > 0.0 else 1.0


def _filter(z: Phasors, share: float) -> Phasors:
    """Response of the first-order filter."""
    return share / (1.0 - (1.0 - share) / z)


def _radius(transition: Numbers) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(transition))))


def _margin(frequencies: Numbers, loop: Phasors) -> Margin:
    """First crossover and smallest phase margin of an open loop."""
    gain = np.log(np.maximum(np.abs(loop), 1e-300))
    places = np.flatnonzero(np.signbit(gain[1:]) != np.signbit(gain[:-1]))
    falling = places[gain[places] >= 0.0]
    if not len(falling):
        return Margin(0.0, math.pi)
    share = gain[places] / (gain[places] - gain[places + 1])
    phase = np.unwrap(np.angle(loop))
    # An open loop is as far from -1 as its phase is from an odd multiple of 180 deg.
    at = phase[places] + share * (phase[places + 1] - phase[places])
    margins = np.mod(at, 2 * np.pi) - np.pi
    first = falling[0]
    crossover = frequencies[first] * (frequencies[first + 1] / frequencies[first]) ** share[places == first][0]
    return Margin(float(crossover), float(margins[np.argmin(np.abs(margins))]))
