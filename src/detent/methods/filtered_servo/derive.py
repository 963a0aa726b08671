"""What follows from a filtered-servo specification: scales, constants of the method, and how the loop settles.

Symbols: ``r`` travel per radian, ``m`` moving mass, ``A`` share of the filter, ``B`` scale of the count, ``TS`` sample
period, ``K1`` position gain, ``K`` drive word to acceleration; sections are those of the filtered-servo specification.
"""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from detent.files.findings import Derived, quantity_figure
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.position import PositionSensor, Sensed
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.analysis.linear_system import LinearSystem
    from detent.analysis.sampled_loop import Response, SampledLoop
    from detent.analysis.transfer_function import ServoTransfer

RAMP_WINDOWS = 2000  # windows of a ramp that are computed at most: its beginning is forgotten by then
SETTLING_WINDOWS = 200  # windows after a ramp in which the largest count is looked for


def position_sensors(spec: FilteredServoSpec) -> dict[str, PositionSensor]:
    """The encoder on the motor shaft."""
    ends, window = (0.0, spec.limits.travel), max(1, spec.method.in_position)
    sensor = "incremental encoder on the motor shaft"
    return {"": PositionSensor(sensor=sensor, kind=Sensed.INCREMENTAL, scale=spec.pulse, ends=ends, window=window)}


class FilteredFigures:
    """The machine behind a specification, with the model of its loop."""

    def __init__(self, spec: FilteredServoSpec) -> None:
        self.spec = spec
        self.coefficient = 1.0 if spec.method.filter == "none" else spec.method.coefficient
        friction = spec.mechanics.friction
        viscous = min(friction.right.viscous, friction.left.viscous)
        decay = 1 / spec.motor_time_constant + viscous / spec.mass
        self.tau_m = 1 / decay if decay > 0 else math.inf
        self.static = max(friction.right.static, friction.left.static)
        self.coulomb = max(friction.right.coulomb, friction.left.coulomb)
        self.rate = spec.limits.speed / spec.pulse
        # Pulses of following error that friction holds at rest.
        self.resting_error = math.floor(self.static / spec.force_per_count / spec.method.position_gain)
        self._loop_constants: dict[str, float] = {
            "gain": spec.gain,
            "sample_period": spec.method.sample_period,
            "scale": spec.method.scale,
            "coefficient": self.coefficient,
            "position_gain": spec.method.position_gain,
        }

    @cached_property
    def loop(self) -> "SampledLoop":
        """Exact model of the sampled loop (3.7)."""
        from detent.analysis.sampled_loop import SampledLoop

        return SampledLoop(tau_m=self.tau_m, **self._loop_constants)

    @cached_property
    def transfer(self) -> "ServoTransfer":
        """Transfer function in continuous time (3.6)."""
        from detent.analysis.transfer_function import ServoTransfer

        return ServoTransfer.of_window(**self._loop_constants)

    @cached_property
    def gain_margin(self) -> float:
        """By how much the gain may grow until the loop no longer settles; below 1 it does not settle now."""
        return self.loop.stability_limit() / self.spec.gain

    @cached_property
    def ramp(self) -> "Response":
        """Answer of the loop, its drive unlimited, to the command's ramp up to limits.speed."""
        window, acceleration = self.spec.method.sample_period, self.spec.method.command_acceleration / self.spec.pulse
        ramp = min(self.rate / (acceleration * window), RAMP_WINDOWS) if acceleration > 0 else 0.0
        windows = math.ceil(ramp * (1 - 1e-9))
        rates = [max(0.0, self.rate - acceleration * window * (windows - k - 0.5)) for k in range(windows)]
        return self.loop.respond([*rates, *[self.rate] * SETTLING_WINDOWS])

    @property
    def largest_count(self) -> int:
        """Largest count of a window on that ramp [pulses]."""
        position = self.ramp.position
        return math.ceil(float((position[1:] - position[:-1]).max()) * (1 - 1e-9))

    @property
    def largest_error(self) -> float:
        """Largest following error on that ramp, with what friction adds [pulses]."""
        friction = self.coulomb / self.spec.force_per_count / self.spec.method.position_gain
        return float(self.ramp.following_error.max()) + friction

    @property
    def top_speed(self) -> float:
        """Speed that the largest drive word holds [m/s]; infinite where nothing slows the motor down."""
        holding = self.spec.holding_word
        left = self.spec.word_limit - holding(0.0)
        # The holding word grows evenly with speed.
        slope = holding(1.0) - holding(0.0)
        return left / slope if slope > 0 else math.copysign(math.inf, left)


def damping_of(loop: "SampledLoop") -> float:
    """Damping ratio of the least damped mode of a loop that swings; 1 where none does, below 0 where one grows."""
    poles = [complex(pole) for pole in loop.poles()]
    # A mode that changes its sign at each sample has no partner; one that is gone after a sample has no real part.
    return min((-pole.real / abs(pole) for pole in poles if pole.imag != 0 and math.isfinite(pole.real)), default=1.0)


def linear_loops(spec: FilteredServoSpec) -> "dict[str, LinearSystem]":
    """The loop of an axis, by where it is cut."""
    return {"speed": FilteredFigures(spec).loop.open_loop()}


def derive(spec: FilteredServoSpec) -> tuple[Derived, ...]:
    """Compute all derived figures, in the order they are read."""
    m = FilteredFigures(spec)
    return (*_drive(m), *_feedback(m), *_loop(m))


def _drive(m: FilteredFigures) -> Iterator[Derived]:
    """What a pulse is, and how many there are; forces, and the constants of the plant."""
    spec = m.spec
    yield quantity_figure("pulse", spec.pulse, "m", "travel per revolution / (4 cycles per revolution)")
    yield Derived("pulse rate at limits.speed", m.rate, "1/s", f"{m.rate:.5g} pulses/s", "speed / pulse")
    counted = spec.counted(spec.limits.speed)
    text = f"{counted} of {spec.most_counted} pulses in a sample"
    yield Derived("count at limits.speed", counted, "count", text, "pulse rate x TS, rounded up")
    yield quantity_figure("moving mass", spec.mass, "kg", "slide + (rotor + screw) / r^2")
    word = "supply / 2^(bits - 1) / R" if spec.drive.amplifier == "voltage" else "current per count"
    yield quantity_figure("force of one count", spec.force_per_count, "N", f"{word} x Kt / r")
    force = spec.word_limit * spec.force_per_count
    text = f"{format_quantity(force, 'N')} at {spec.word_limit:.4g} counts"
    yield Derived("largest force", force, "N", text, "full drive word, at most limits.effort")
    text = f"{spec.gain:.4g} pulses/s^2 per count"
    yield Derived("gain K", spec.gain, "1/s^2", text, "force of one count / m / pulse")
    if math.isfinite(m.tau_m):
        yield quantity_figure("mechanical time constant", m.tau_m, "s", "1 / (Kt Ke / (R J) + viscous / m)")
    error = m.resting_error
    formula = "static / (force of one count x K1), rounded down"
    yield Derived("error at rest", error, "count", f"|P| up to {error}", formula)


def _feedback(m: FilteredFigures) -> Iterator[Derived]:
    """The constants of 3.6: how the following error goes with speed; the filter alone (3.4)."""
    from detent.analysis.first_order_filter import cutoff_hz, equivalent_time_constant, noise_gain

    spec, method, coefficient, window = m.spec, m.spec.method, m.coefficient, m.spec.method.sample_period
    yield quantity_figure("K2", m.transfer.speed_gain, "s", "B x TS")
    constant = m.transfer.velocity_error_constant
    yield Derived("velocity-error constant KV", constant, "1/s", f"{constant:.4g} 1/s", "K1 / (B x TS)")
    error = spec.following_error(spec.limits.speed)
    most = (1 << (method.position_bits - 1)) - 1
    text = f"{error:.4g} of {most} pulses ({format_quantity(error * spec.pulse, 'm')})"
    formula = "(speed word B x TS x rate + word that holds the speed) / K1"
    yield Derived("following error at limits.speed", error, "count", text, formula)
    jump = coefficient * method.scale
    formula = "A x B: each count is uncertain by one"
    yield Derived("jump of the drive word for one pulse", jump, "count", f"{jump:.4g} x one count", formula)
    if coefficient == 1.0:
        return
    yield quantity_figure("filter time constant Tf", window / coefficient, "s", "TS / A")
    formula = "-TS / ln(1 - A)"
    yield quantity_figure("equivalent time constant", equivalent_time_constant(coefficient, window), "s", formula)
    cutoff = cutoff_hz(coefficient, window)
    if math.isfinite(cutoff):
        yield quantity_figure("filter corner, -3 dB", cutoff, "Hz", "asin(A / (2 sqrt(1 - A))) / (pi TS)")
    gain = noise_gain(coefficient)
    yield Derived("noise gain of the filter", gain, "", f"{gain:.3g}", "sqrt(A / (2 - A))")


def _loop(m: FilteredFigures) -> Iterator[Derived]:
    """How the loop settles (3.6, 3.7)."""
    spec, transfer = m.spec, m.transfer
    stiffness = spec.gain * spec.method.sample_period**2
    yield Derived(
        "K TS^2", stiffness, "", f"{stiffness:.4g}", "twice the pulses that a count of drive moves in a sample"
    )
    margin, limit = m.gain_margin, m.loop.stability_limit()
    if math.isfinite(limit):
        text = f"K = {limit:.5g} 1/s^2, {margin:.3g} x the gain"
        yield Derived("stability limit", limit, "1/s^2", text, "lowest K with a spectral radius of 1 (3.7)")
    radius = m.loop.spectral_radius()
    yield Derived("spectral radius", radius, "", f"{radius:.4f}", "largest eigenvalue magnitude per sample (3.7)")
    damping = damping_of(m.loop)
    yield Derived("damping of the loop", damping, "", f"{damping:.3g}", "least damped oscillatory mode")
    ratio = transfer.filter_ratio
    yield Derived("Tf / (K2 / K1)", ratio, "", f"{ratio:.3g}", "K1 / (A B); far below 1 for a first-order loop (3.6)")
    ratio = transfer.inertia_ratio
    formula = "far below 1 for a first-order loop (3.6)"
    yield Derived("sqrt(1 / (K1 K)) / (K2 / K1)", ratio, "", f"{ratio:.3g}", formula)
