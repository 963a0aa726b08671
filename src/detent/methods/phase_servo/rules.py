"""What must hold between keys of the phase-servo method.

As in the print head's rules, a rule is reported at the first of its keys that the file states, and a remedy names the
nearest value that would do. N is the number of steps per pitch; sections are those of the phase-servo specification.
"""

import math
from collections.abc import Callable, Iterator

from detent.axisfile.common_rules import Plant, burst, inside_travel, static_friction, time_constants
from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, offer, put
from detent.methods.phase_servo.detector import JITTER_PEAK, edge_separation
from detent.methods.phase_servo.schema import TABLE_ENTRIES, PhaseServoSpec
from detent.units import format_quantity

LONGEST_DISTANCE = 65535
"""Longest distance that the command counter holds [steps] (16 bits, 7)."""

WIDEST_SUM = 2**31 - 1
"""Largest sum of the arithmetic unit, which works with 32 bits."""

LONGEST_SUBSTEP = 1e-5
"""Longest step of the power series that makes the matrices of a tick [s] (`build.SUBSTEP`)."""

SERIES_SHARE = 0.25
"""Largest step of the power series, as a share of the fastest time constant (`plant.drive_train`)."""


def _steps_per_pitch(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    counts = spec.detector.counts
    if counts & (counts - 1):
        yield Contradiction(
            ("detector.counts",),
            "a power of two: the counters of carrier, tracker and absolute word run over on their own (2)",
            offer(PhaseServoSpec, "detector.counts", 1 << round(math.log2(counts))),
        )


def _speed_tracked(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    n, speed = spec.detector.counts, spec.limits.speed
    fastest = spec.step / spec.tick / (n + 1)
    if speed >= fastest:
        oscillator = 2 * speed * (n + 1) / spec.step * (1 + BARELY)
        yield Contradiction(
            ("limits.speed", "clock.oscillator", "detector.counts", "detector.pitches_per_revolution"),
            f"below {format_quantity(fastest, 'm/s')}: the tracker follows one step in N + 1 = {n + 1} clocks (3.4)",
            either(
                offer(PhaseServoSpec, "limits.speed", at_most(fastest * (1 - BARELY), "m/s")),
                f"raise clock.oscillator to {at_least(oscillator, 'Hz')}",
            ),
        )


def _speed_counted(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    one = spec.step / spec.sample_period
    if spec.peak_count < 1:
        tap = math.ceil(math.log2(spec.step * spec.clock.oscillator / spec.limits.speed * (1 + BARELY)))
        yield Contradiction(
            ("limits.speed", "clock.sample_tap"),
            f"at least one pulse per speed sample, {format_quantity(one, 'm/s')}: the table would hold only zeros",
            either(
                offer(PhaseServoSpec, "limits.speed", at_least(one, "m/s")),
                offer(PhaseServoSpec, "clock.sample_tap", tap),
            )
            or "use a finer detector",
        )
    most = (1 << (spec.method.speed_bits - 1)) - 1
    if spec.peak_count > most:
        bits = spec.peak_count.bit_length() + 1
        yield Contradiction(
            ("method.speed_bits", "limits.speed", "clock.sample_tap"),
            f"wide enough for the peak of the velocity table, {spec.peak_count} pulses per sample: "
            f"{spec.method.speed_bits} bits hold {most}",
            either(
                offer(PhaseServoSpec, "method.speed_bits", bits),
                offer(PhaseServoSpec, "limits.speed", at_most((most + 1) * one * (1 - BARELY), "m/s")),
            ),
        )


def _threshold(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    quarter, threshold = spec.detector.counts // 4, spec.method.threshold
    if threshold >= quarter:
        yield Contradiction(
            ("method.threshold", "detector.counts"),
            f"below N/4 = {quarter}, where the absolute word folds back (3.5)",
            offer(PhaseServoSpec, "method.threshold", quarter - 1),
        )


def _protection(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    half, threshold, spurious = spec.detector.counts // 2, spec.method.threshold, spec.method.expected_spurious
    if threshold + spurious >= half > threshold:
        lower = half - 1 - spurious
        yield Contradiction(
            ("method.expected_spurious", "method.threshold", "detector.counts"),
            f"below N/2 - threshold = {half - threshold}: with {threshold} + {spurious} steps to go, N/2 = {half} "
            "or more, the absolute word leads to the next pitch (7)",
            either(
                offer(PhaseServoSpec, "method.expected_spurious", half - 1 - threshold),
                offer(PhaseServoSpec, "method.threshold", lower),
            ),
        )


def _way(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    travel, longest = spec.limits.travel, LONGEST_DISTANCE * spec.step
    keys = ("limits.travel", "detector.counts", "detector.pitches_per_revolution", "mechanics.pulley_circumference")
    if travel > longest * (1 + BARELY):
        yield Contradiction(
            keys,
            f"up to {LONGEST_DISTANCE} steps, {format_quantity(longest, 'm')}: the command counter has 16 bits (7)",
            either(offer(PhaseServoSpec, "limits.travel", at_most(longest, "m")), "use a coarser detector"),
        )
    elif travel < spec.pitch:
        yield Contradiction(
            keys,
            f"at least a pitch of the detector, {format_quantity(spec.pitch, 'm')}: the axis stops at whole pitches",
            either(offer(PhaseServoSpec, "limits.travel", at_least(spec.pitch, "m")), "use a finer detector"),
        )


def _drive_word(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    k1, k2, k3 = spec.method.position_gains
    largest, most = spec.detector.counts // 4 + 1, (1 << (spec.drive.pwm_bits - 1)) - 1
    asked = k1 * k3 * largest
    if asked > most:
        k1, bits = most // (k3 * largest), asked.bit_length() + 1
        yield Contradiction(
            ("method.position_gains", "drive.pwm_bits", "detector.counts"),
            f"such that KP1 x KP3 x (N/4 + 1) = {asked} fits the drive word of {spec.drive.pwm_bits} bits, {most} (7)",
            either(
                put("method.position_gains", [k1, k2, k3]) if k1 >= 1 else "",
                offer(PhaseServoSpec, "drive.pwm_bits", bits),
            )
            or "lower KP1, KP3 or detector.counts",
        )


def _sums(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    method = spec.method
    speed = 1 << (method.speed_bits - 1)
    error = LONGEST_DISTANCE if method.final == "incremental" else spec.detector.counts // 4 + 1
    sums = {
        "method.speed_gains": (method.speed_gains, spec.peak_count, 0),
        "method.position_gains": (method.position_gains, error, method.integral_limit),
    }
    for key, ((k1, k2, k3), setpoint, integral) in sums.items():
        inner = k1 * setpoint + integral + k2 * speed
        if k3 * inner > WIDEST_SUM:
            yield Contradiction(
                (key, "method.speed_bits", "limits.speed"),
                f"such that the largest sum of the arithmetic unit, here {k3 * inner:.3g}, fits 32 bits",
                put(key, [k1, k2, WIDEST_SUM // inner]),
            )


def _table_end(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    top, last = spec.peak_count, TABLE_ENTRIES - 1
    reached = spec.table_velocity(last)
    if reached < top:
        # The entry of a distance of n steps is floor(sqrt(2 a n / step) Tv + 1/2).
        needed = ((top - 0.5) / spec.sample_period) ** 2 * spec.step / (2 * last) * (1 + BARELY)
        slower = (reached + 1) * spec.step / spec.sample_period * (1 - BARELY)
        yield Contradiction(
            ("method.table_acceleration", "limits.speed", "clock.sample_tap"),
            f"large enough for the peak of {top} pulses per sample within the {TABLE_ENTRIES} entries of the velocity "
            f"table, which ends at {reached}",
            either(
                offer(PhaseServoSpec, "method.table_acceleration", at_least(needed, "m/s^2")),
                offer(PhaseServoSpec, "limits.speed", at_most(slower, "m/s")),
            ),
        )


def _table_start(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    first = spec.method.threshold + 1
    if spec.peak_count >= 1 and spec.table_velocity(first) < 1:
        needed = (0.5 / spec.sample_period) ** 2 * spec.step / (2 * first) * (1 + BARELY)
        yield Contradiction(
            ("method.table_acceleration", "method.threshold", "clock.sample_tap"),
            f"large enough for one pulse per sample {first} steps before the end: the carriage would stop before it "
            f"reaches method.threshold, {spec.method.threshold}",
            offer(PhaseServoSpec, "method.table_acceleration", at_least(needed, "m/s^2")) or "raise clock.sample_tap",
        )


def _one_shots(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    method = spec.method
    if not method.stop_always_off and method.stop_time < method.ready_time + spec.tick:
        yield Contradiction(
            ("method.stop_time", "method.ready_time"),
            f"longer than method.ready_time, {format_quantity(method.ready_time, 's')}: ready comes first (4)",
            offer(PhaseServoSpec, "method.stop_time", at_least(method.ready_time + spec.tick, "s")),
        )


def _lag(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    n = spec.detector.counts
    if spec.detector.lag_counts >= n:
        yield Contradiction(
            ("detector.lag_counts", "detector.counts"),
            f"below detector.counts, {n}",
            either(
                offer(PhaseServoSpec, "detector.lag_counts", n - 1), f"leave it out: it is then N/4 - 1 = {n // 4 - 1}"
            ),
        )


def _edges(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    edges = edge_separation(spec)
    if edges.displaced > edges.limit:
        nearest = at_most(edges.largest_offset, "%")
        yield Contradiction(
            ("detector.offset_error", "detector.amplitude", "detector.gain_error", "detector.quadrature_error"),
            f"such that an edge is displaced by at most {edges.limit:g} turn, here {edges.displaced:.3g}: the two "
            "edges of a cycle would meet",
            offer(
                PhaseServoSpec,
                "detector.offset_error",
                nearest.replace('"', '"-', 1) if spec.detector.offset_error < 0 else nearest,
            ),
        )
    elif spec.detector.jitter > edges.largest_jitter:
        yield Contradiction(
            ("detector.jitter", "detector.amplitude", "clock.oscillator", "detector.counts", "detector.offset_error"),
            f"up to {format_quantity(edges.largest_jitter, 's')}: its peak of {JITTER_PEAK} times that and the offset "
            f"displace an edge by at most {edges.limit:g} turn of the carrier",
            offer(PhaseServoSpec, "detector.jitter", at_most(edges.largest_jitter, "s")),
        )


def _places(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    positions = {
        "mechanics.start_position": spec.mechanics.start_position,
        "print.left_margin": spec.printing.left_margin,
    }
    yield from inside_travel(positions, spec.limits.travel)


def _character_pitch(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    distance, pitch = spec.printing.character_pitch, spec.pitch
    whole = max(1, round(distance / pitch))
    if abs(distance - whole * pitch) > 1e-3 * spec.step:
        yield Contradiction(
            ("print.character_pitch", "detector.pitches_per_revolution", "mechanics.pulley_circumference"),
            f"a whole number of pitches of the detector, {format_quantity(pitch, 'm')}: the axis stops there only; "
            f"here {distance / pitch:.5g}",
            offer(PhaseServoSpec, "print.character_pitch", f'"{format_quantity(whole * pitch, "m", digits=12)}"')
            or "use a finer detector",
        )


def _machine(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    radius = spec.mechanics.pulley_circumference / (2 * math.pi)
    motor = spec.motor
    mass = spec.mechanics.carriage_mass + (motor.rotor_inertia + spec.mechanics.pulley_inertia) / radius**2
    coupling = motor.torque_constant * motor.back_emf_constant / radius**2 / mass
    plant = Plant(motor.resistance + spec.drive.bridge_resistance, motor.inductance, coupling, mass)
    yield from time_constants(plant, spec.mechanics.friction, SERIES_SHARE / min(spec.tick, LONGEST_SUBSTEP))


def _friction(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    yield from static_friction(spec.mechanics.friction)


def _burst(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    yield from burst(spec.disturbance.lines.burst, spec.tick)


RULES: tuple[Callable[[PhaseServoSpec], Iterator[Contradiction]], ...] = (
    _steps_per_pitch,
    _speed_tracked,
    _speed_counted,
    _threshold,
    _protection,
    _way,
    _drive_word,
    _sums,
    _table_end,
    _table_start,
    _one_shots,
    _lag,
    _edges,
    _places,
    _character_pitch,
    _machine,
    _friction,
    _burst,
)
"""The rules, in the order in which their contradictions are told."""
