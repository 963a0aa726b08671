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
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.analysis.count_edge import EdgeCycle, edge_cycle
from detent.analysis.linear_system import LinearSystem, gain_limit
from detent.analysis.margins import Margins, Places, around, margins_of, one_of
from detent.analysis.sampled_plant import Fraction, fraction, held, polynomial, times
from detent.axisfile.elementwise import is_array, least
from detent.methods.cascade.schema import CascadeSpec, EncoderTable
from detent.plant.linear_two_mass import linear_plant

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]

LARGEST_MARGIN = 1e3  # largest gain margin that is looked for
SWINGING = 1.0 - 1e-3  # of the largest factor of a mode: those that neither decay nor grow at the gain margin


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


class LimitCycle(NamedTuple):
    """How a loop beyond its gain margin swings."""

    frequency: float  # [Hz]
    motor: float  # peak to peak [m]
    load: float


class LinearLoop:
    """The closed loop.

    Of many axes of one file, whose values are arrays of shape (n,), it has plants, responses and margins; its matrices
    are those of one.
    """

    def __init__(self, spec: CascadeSpec, count: int = 0) -> None:
        self.spec, self.count = spec, count  # 0: one axis
        self.period = spec.method.sample_period
        frictions = (spec.mechanics.friction, spec.mechanics.load_friction)
        drags = [least(f.positive.viscous, f.negative.viscous) for f in frictions]
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

    @cached_property
    def margins(self) -> dict[str, Margins]:
        """Margins by the place of the cut; of many axes arrays of shape (n,)."""
        near = np.broadcast_to(self._resonances, (self.count or 1, self._resonances.shape[-1]))
        found = margins_of(self._cut_everywhere, near, self.period)
        return dict(zip(self.cuts, found if self.count else map(one_of, found), strict=True))

    @property
    def velocity_loop(self) -> Margins:
        """Margins of the velocity loop; a PID has none, which then never crosses a gain of 1."""
        return self.margins.get("velocity", Margins(0.0, math.pi, math.inf, math.inf, 1.0, 0.0))

    @property
    def position_loop(self) -> Margins:
        """Margins of the position loop around it; of a PID, of its only loop."""
        return self.margins[self.cuts[-1]]

    @property
    def sensitivity(self) -> tuple[float, float]:
        """Ms at the command, largest magnitude of 1/(1 + L) where the amplifier sees both loops, and where [Hz]."""
        return self.margins["command"].sensitivity, self.margins["command"].peak

    @cached_property
    def _resonances(self) -> Numbers:
        """Frequencies inside the resonances of the plants [Hz], shape (k,) or (n, k)."""
        modes = np.linalg.eigvals(self.plant.a)
        hangs = is_array(self.spec.mechanics.pendulum) or self.spec.mechanics.pendulum > 0.0
        pairs = (modes.shape[-1] - (not hangs)) // 2  # a place that nothing pulls is no part of one
        order = np.argsort(-modes.imag, axis=-1, kind="stable")[..., :pairs]
        return around(np.take_along_axis(modes, order, axis=-1).astype(np.complex128), self.period)

    def _cut_everywhere(self, frequencies: Numbers, which: Places) -> Phasors:
        """The open loops of some axes at frequencies [Hz], in the order of `cuts`."""
        inner, outer = self._open_loops(frequencies, which)
        each = (self._at_cut(cut, inner, outer) for cut in self.cuts)
        return np.stack([np.broadcast_to(one, (len(which), one.shape[-1])) for one in each])

    @cached_property
    def held(self) -> tuple[Numbers, Numbers]:
        """Ad and Bd: the plant from sample to sample."""
        moved, driven = self._held
        apart, together = self._apart
        return np.eye(len(driven)) + times(times(together, moved), apart), together @ driven

    @cached_property
    def loaded(self) -> Numbers:
        """What a force of 1 N on the load adds to the state in a sample."""
        force = np.zeros_like(self.plant.b)
        coupled = self.plant.load != self.plant.motor
        force[self.plant.load + 1] = 1.0 / (self.spec.mechanics.load_mass if coupled else self.spec.mass)
        return self._apart[1] @ self._moved(force)[1]

    @cached_property
    def _held(self) -> tuple[Numbers, Numbers]:
        """The same in the coordinates of `_apart`, without the part that stays."""
        return self._moved(self.plant.b)

    def _moved(self, driven: Numbers) -> tuple[Numbers, Numbers]:
        apart, together = self._apart
        a = times(times(apart, self.plant.a), together)
        return held(a, times(apart, driven[..., None])[..., 0], self.period)

    @cached_property
    def _apart(self) -> tuple[Numbers, Numbers]:
        """From the state to one with the load's place over the motor's, and back; all but places per sample, or so.

        Whatever the coupling, a place that nothing pulls then acts on nothing, to the last bit.
        """
        motor, load = self.plant.motor, self.plant.load
        apart = np.eye(self.plant.b.shape[-1])
        together = apart.copy()
        if load != motor:
            apart[[load, load + 1], [motor, motor + 1]], together[[load, load + 1], [motor, motor + 1]] = -1.0, 1.0
        scale = np.full(len(apart), 2.0 ** round(math.log2(self.period)))
        scale[[motor, load]] = 1.0
        return scale[:, None] * apart, together / scale

    @cached_property
    def sensors(self) -> dict[str, EncoderTable]:
        """The encoders of the loops, by the place at which what each is off by is put in."""
        if self.position_sensor is self.velocity_sensor:
            return {"counts of the position": self.position_sensor}
        return {"counts of the position": self.position_sensor, "counts of the velocity": self.velocity_sensor}

    def transition(self, more: float = 1.0) -> Numbers:
        """State from sample to sample, the reference at 0, with `more` times the gain.

        Behind the plant it holds what encoders and amplifier remember, the newest first, then the filtered velocity,
        the integral, and the filter of a PID's derivative.
        """
        return self._sample("", more)[0][:, :-1]

    @property
    def cuts(self) -> tuple[str, ...]:
        """Places at which the loops can be cut open."""
        return ("command",) if self.spec.method.structure == "pid" else ("command", "velocity", "position")

    def open_loop(self, cut: str) -> LinearSystem:
        """The loop that is cut open at a place, as matrices."""
        after, out = self._sample(cut)
        a, b, c, d = after[:, :-1], after[:, -1:], out[None, :-1], out[None, -1:]
        quick, known = None, None
        if cut in self.cuts:
            quick, known = partial(self._cut_open, cut), lambda: self.margins[cut]
        return LinearSystem(a=a, b=b, c=c, d=d, dt=self.period, name=f"{cut} loop", quick=quick, known=known)

    def _cut_open(self, cut: str, frequencies: Numbers) -> Phasors:
        """The same at frequencies [Hz], from the response of the plant."""
        return self._at_cut(cut, *self._open_loops(frequencies))

    def _at_cut(self, cut: str, inner: Phasors, outer: Phasors) -> Phasors:
        """One of both loops; at the command both."""
        return {"velocity": inner, "position": outer}.get(cut, inner + _product(outer, 1.0 + inner))

    @property
    def edge(self) -> EdgeCycle | None:
        """The longest cycle across the edge of a count of the position's encoder, for a count of 1."""
        after, out = self._sample("encoder")
        return edge_cycle(after[:, :-1], after[:, -1], out[0, :-1], out[1, :-1], float(out[1, -1]))

    def _sample(self, cut: str, more: float = 1.0) -> tuple[Numbers, Numbers]:
        """What a sample makes of the state and of what is put in at a cut: the state after it, and what comes out.

        Quantities of a sample are rows over the state before it and, last, what is put in. Cut at the encoder, the
        place that it is to read and the command come out. Where all loops stay closed, a force on the "load" moves it,
        and what an encoder is off by ("counts of the position", "counts of the velocity") moves the command.
        """
        read = self.velocity_sensor
        sizes = [len(self.plant.b), self.position_sensor.delay, read.delay + read.velocity_span, self.spec.drive.delay]
        parts: list[Numbers] = np.split(np.eye(sum(sizes) + 4), np.cumsum(sizes))
        x, positions, places, commands, rest = parts
        velocity, integral, filtered, put_in = rest
        at_encoder, shared = cut == "encoder", self.position_sensor is self.velocity_sensor
        off = [put_in if self.sensors.get(cut) is one else 0.0 * put_in for one in (self.position_sensor, read)]
        positions = np.vstack([put_in if at_encoder else x[self.position_place] + off[0], positions])
        places = np.vstack([put_in if at_encoder and shared else x[self.velocity_place] + off[1], places])
        difference = (places[read.delay] - places[-1]) / (read.velocity_span * self.period)
        velocity = velocity + self.velocity_share * (difference - velocity)
        position_meas = {"position": put_in, "velocity": 0.0 * put_in}.get(cut, positions[-1])
        velocity_meas = put_in if cut == "velocity" else velocity
        command, integral, filtered = self._law(position_meas, velocity_meas, integral, filtered)
        out = -{"position": positions[-1], "velocity": velocity}.get(cut, command)
        out = np.vstack([x[self.position_place], command]) if at_encoder else out
        out = x[self.plant.load] if cut == "load" else command if cut in self.sensors else out
        commands = np.vstack([put_in if cut == "command" else command, commands])
        held, driven = self.held
        plant = held @ x + np.outer(driven, more * self.gain * commands[-1])
        plant += np.outer(self.loaded, put_in) if cut == "load" else 0.0
        after: Any = np.vstack([plant, positions[:-1], places[:-1], commands[:-1], velocity, integral, filtered])
        return after, out

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
        return gain_limit(lambda more: _radius(self.transition(more)), LARGEST_MARGIN)

    @cached_property
    def limited(self) -> LimitCycle | None:
        """How a loop swings that does not settle: as far as its limit lets it; None where it settles, or nowhere.

        The limit weakens a swinging command by N(r) = 2/pi (asin r + r sqrt(1 - r^2)), r its share that passes
        (Gelb, Vander Velde 1968, section 2.3), until the loop is at its gain margin.
        """
        margin = self.gain_margin
        if not 0.0 < margin < 1.0:
            return None
        modes = np.linalg.eigvals(self.transition(margin))
        frequency = float(np.abs(np.angle(modes[np.abs(modes) > SWINGING * np.max(np.abs(modes))])).max())
        if frequency == 0.0:
            return None
        low, high = 0.0, 1.0
        while high - low > 1e-9:
            middle = 0.5 * (low + high)
            weaker = 2.0 / math.pi * (math.asin(middle) + middle * math.sqrt(1.0 - middle * middle))
            low, high = (middle, high) if weaker < margin else (low, middle)
        passed = margin / high * self.spec.largest_command  # fundamental of what the limit lets through
        held, driven = self.held
        through = np.exp(1j * frequency) * np.eye(len(driven)) - held
        states = np.abs(np.linalg.solve(through, self.gain * passed * driven.astype(np.complex128)))
        places = states[[self.plant.motor, self.plant.load]]
        return LimitCycle(frequency / (math.tau * self.period), *(2.0 * places).tolist())

    def _open_loops(self, frequencies: Numbers, which: Places | None = None) -> tuple[Phasors, Phasors]:
        """Velocity loop, and position loop with that inside it closed; of a PID no velocity loop, and all of it."""
        m, (position, velocity, summed) = self.spec.method, self.paths(frequencies, which)
        if m.structure == "pid":
            law = _of(m.proportional, which) + _of(m.integral, which) * summed
            return np.zeros_like(position), _product(law, position) + _of(m.derivative, which) * velocity
        law = _of(m.velocity_gain, which) + _of(m.velocity_integral, which) * summed
        inner = _product(law, velocity)
        return inner, _of(m.position_gain, which) * _product(law, position) / (1.0 + inner)

    def paths(self, frequencies: Numbers, which: Places | None = None) -> tuple[Phasors, Phasors, Phasors]:
        """What the gains stand between, at frequencies [Hz]: from a command to the position and to the velocity.

        Both as they are read; the velocity of a PID behind its derivative's filter. Third, the sum of an integral.
        Of many axes those `which` are asked for, shape (n,), at frequencies of shape (k,) or (n, k).
        """
        read, half = self.velocity_sensor, np.pi * self.period * frequencies
        sine, cosine = np.sin(half), np.cos(half)
        less = _phasors(-2.0 * sine * sine, 2.0 * sine * cosine)  # z - 1, though z be near 1
        places, shared = self._driven(less, which), self.position_sensor is self.velocity_sensor
        late = _delay(half, self.spec.drive.delay, which)
        at = _product(late, _delay(half, self.position_sensor.delay, which))
        position = _of(self.gain, which) * _product(at, places[0])
        same = shared and self.position_place == self.velocity_place
        if not same:
            at = _product(late, _delay(half, read.delay, which))
        span = read.velocity_span
        difference = (1.0 - _delay(half, span, which)) / (span * self.period)
        speed = _product(difference, _filter(less, self.velocity_share))
        if self.spec.method.structure == "pid":
            speed = _product(speed, _filter(less, self.derivative_share))
        if same:
            return position, _product(position, speed), self.period * (1.0 + less) / less
        velocity = _of(self.gain, which) * _product(_product(at, speed), places[-1])
        return position, velocity, self.period * (1.0 + less) / less

    def _driven(self, less: Phasors, which: Places | None) -> list[Phasors]:
        """The positions of the plant that are read, to what the amplifier puts out; one where they are the same."""
        above, below = (one if which is None or one.ndim == each else one[which]
                        for one, each in zip(self._fraction, (2, 1), strict=True))  # fmt: skip
        powers = [np.ones_like(less), less]
        while len(powers) < below.shape[-1]:
            powers.append(powers[-1] * less)
        divided = 1.0 / polynomial(below, powers)
        return [_product(polynomial(above[..., k, :], powers), divided) for k in range(above.shape[-2])]

    @cached_property
    def _fraction(self) -> Fraction:
        """The same as polynomials."""
        places = dict.fromkeys((self.position_place, self.velocity_place))
        return fraction(*self._held, self._apart[1][list(places)])

    def velocity_level(self, frequency: float) -> float:
        """Gain of the open velocity loop at a frequency [Hz] below half the sample rate."""
        return float(np.abs(self._open_loops(np.array([frequency]))[0][0]))


def smoothing(time_constant: float, period: float) -> float:
    """Share of a new value that a first-order filter takes over at a sample; as `system.smoothing`, not compiled."""
    return -math.expm1(-period / time_constant) if time_constant > 0.0 else 1.0


def _filter(less: Phasors, share: float) -> Phasors:
    """Response of the first-order filter to z - 1."""
    return share * (1.0 + less) / (less + share)


def _product(first: Phasors, second: Phasors) -> Phasors:
    """Of two that have a name: NumPy multiplies by a large one that has none in place, which rounds another way."""
    return first * second


def _phasors(real: Numbers, imaginary: Numbers) -> Phasors:
    found = np.empty(real.shape, np.complex128)
    found.real, found.imag = real, imaginary
    return found


def _delay(half: Numbers, samples: Any, which: Places | None) -> Phasors:
    """Response of a dead time, to half the angle that a sample is."""
    angle = -2.0 * _of(samples, which) * half
    return _phasors(np.cos(angle), np.sin(angle))


def _of(value: Any, which: Places | None) -> Any:
    """A value of some axes, to be put beside frequencies."""
    return value[which][:, None] if which is not None and is_array(value) else value


def _radius(transition: Numbers) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(transition))))


def linear_loops(spec: CascadeSpec) -> dict[str, LinearSystem]:
    """The loops of an axis, by where they are cut."""
    loop = LinearLoop(spec)
    return {cut: loop.open_loop(cut) for cut in loop.cuts}
