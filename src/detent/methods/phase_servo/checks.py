"""What is checked in a phase-servo axis: contradictions between its keys, and cautions about what will surprise.

N is the number of steps per pitch; sections in brackets are those of the phase-servo specification.
"""

import math
from collections.abc import Iterator

from detent.axisfile import common_checks as common
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, Remedies, at_most, put
from detent.methods.phase_servo.derive import PhaseFigures, weakest_output
from detent.methods.phase_servo.schema import TABLE_ENTRIES, PhaseServoSpec
from detent.units import format_quantity as text

LONGEST_DISTANCE = 65535  # longest distance that the command counter holds [steps] (16 bits, 7)
WIDEST_SUM = 2**31 - 1  # largest sum of the arithmetic unit, which works with 32 bits
LONGEST_SUBSTEP = 1e-5  # longest step of the power series that makes the matrices of a tick [s] (`build.SUBSTEP`)
SERIES_SHARE = 0.25  # largest step of the power series, as a share of the fastest time constant (`plant.drive_train`)
PWM_RATIO = 20  # PWM frequency over electrical corner from which the ripple of the current is small (7)
OVERSHOOT = 4  # counts by which the speed may pass the velocity table after the acceleration (test 24)
CURRENT_STEP = 0.02  # share of the current limit by which the current may pass it before the comparator is asked again

LEAST_GAIN_MARGIN = 1.5
STIFF = 3.0  # gain margin below which a carriage that does not come to rest hunts; above it, it lacks damping
EDGE_LIMIT = 0.2  # largest displacement of an edge [turn of the carrier] (`sensing.phase_detector.JITTER_LIMIT`)
JITTER_PEAK = 3  # peak of the noise over its rms (`kernel.noise.bell`)
INTEGRAL_PACE = 1.5
"""Steps within 1 rad of the position loop above which the integral hunts: 1.3 with the literal clocks is quiet, 1.7
with two taps less than the default is not (7)."""

QUIET = 0.25
"""Displacement of an edge by noise with which a move counts a few pairs of pulses, of the dozens it bears [step]."""

remedy = Remedies(PhaseServoSpec)


# ---- contradictions


def _tracker(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The counters run over on their own, and the tracker follows limits.speed."""
    n, lag, fastest = spec.detector.counts, spec.detector.lag_counts, spec.step / spec.tick / (spec.detector.counts + 1)
    if n & (n - 1):
        allowed = "a power of two: the counters of carrier, tracker and absolute word run over on their own (2)"
        yield wrong("detector.counts", allowed, remedy.exactly("detector.counts", 1 << round(math.log2(n))))
    if spec.limits.speed >= fastest:
        keys = "limits.speed clock.oscillator detector.counts detector.pitches_per_revolution"
        allowed = f"below {text(fastest, 'm/s')}: the tracker follows one step in N + 1 = {n + 1} clocks (3.4)"
        yield wrong(keys, allowed, remedy.most("limits.speed", fastest * (1 - BARELY)))
    if lag >= n:
        allowed = f"below detector.counts, {n}; its default is N/4 - 1 = {n // 4 - 1}"
        yield wrong("detector.lag_counts detector.counts", allowed, remedy.most("detector.lag_counts", n - 1))


def _speed_counted(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The speed word holds the peak of the velocity table, and the table has one."""
    one, most, bits = spec.step / spec.sample_period, (1 << (spec.method.speed_bits - 1)) - 1, spec.method.speed_bits
    if spec.peak_count < 1:
        allowed = f"at least one pulse per speed sample, {text(one, 'm/s')}: the table would hold only zeros"
        yield wrong("limits.speed clock.sample_tap", allowed, remedy.least("limits.speed", one, "use a finer detector"))
    if spec.peak_count > most:
        yield wrong(
            "method.speed_bits limits.speed clock.sample_tap",
            f"wide enough for the peak of the velocity table, {spec.peak_count} pulses per sample: {bits} bits hold "
            f"{most}",
            remedy.least("method.speed_bits", spec.peak_count.bit_length() + 1, "lower limits.speed"),
        )


def _approach(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The absolute word leads to the target from the threshold on, spurious pulses included."""
    counts, threshold, spurious = spec.detector.counts, spec.method.threshold, spec.method.expected_spurious
    quarter, half = counts // 4, counts // 2
    if threshold >= quarter:
        allowed = f"below N/4 = {quarter}, where the absolute word folds back (3.5)"
        yield wrong("method.threshold detector.counts", allowed, remedy.most("method.threshold", quarter - 1))
    if threshold + spurious >= half > threshold:
        yield wrong(
            "method.expected_spurious method.threshold detector.counts",
            f"below N/2 - threshold = {half - threshold}: with {threshold} + {spurious} steps to go, N/2 = {half} "
            "or more, the absolute word leads to the next pitch (7)",
            remedy.most("method.expected_spurious", half - 1 - threshold),
        )


def _way(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The travel has a pitch, and fits the command counter; places lie on it."""
    travel, longest, pitch = spec.limits.travel, LONGEST_DISTANCE * spec.step, spec.pitch
    keys = "limits.travel detector.counts detector.pitches_per_revolution mechanics.pulley_circumference"
    if travel > longest * (1 + BARELY):
        allowed = f"up to {LONGEST_DISTANCE} steps, {text(longest, 'm')}: the command counter has 16 bits (7)"
        yield wrong(keys, allowed, remedy.most("limits.travel", longest))
    elif travel < pitch:
        allowed = f"at least a pitch of the detector, {text(pitch, 'm')}: the axis stops at whole pitches"
        yield wrong(keys, allowed, remedy.least("limits.travel", pitch))
    margin = spec.printing.left_margin
    places = {"mechanics.start_position": spec.mechanics.start_position, "print.left_margin": margin}
    yield from common.inside_travel(places, travel)
    if travel >= pitch:
        yield from common.home(remedy, spec.home, (0.0, travel), spec.limits.speed)
    reference = 0.0 if spec.home is None else spec.home.position
    point = round(reference / pitch) * pitch
    if abs(reference - point) > 0.5 * spec.step:
        yield wrong(
            "home.position detector.pitches_per_revolution mechanics.pulley_circumference",
            f"a positioning point, a whole number of pitches of the detector, {text(pitch, 'm')}; here "
            f"{reference / pitch:.5g}",
            remedy.exactly("home.position", point),
        )
    distance = spec.printing.character_pitch
    whole = max(1, round(distance / pitch))
    if abs(distance - whole * pitch) > 1e-3 * spec.step:
        yield wrong(
            "print.character_pitch detector.pitches_per_revolution mechanics.pulley_circumference",
            f"a whole number of pitches of the detector, {text(pitch, 'm')}: the axis stops there only; here "
            f"{distance / pitch:.5g}",
            remedy.exactly("print.character_pitch", whole * pitch, "use a finer detector"),
        )


def _words(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """Drive word and sums of the arithmetic unit hold what the gains make of the largest errors."""
    method, most = spec.method, (1 << (spec.drive.pwm_bits - 1)) - 1
    k1, k2, k3 = method.position_gains
    largest = spec.detector.counts // 4 + 1
    asked, fitting = k1 * k3 * largest, most // (k3 * largest)
    if asked > most:
        yield wrong(
            "method.position_gains drive.pwm_bits detector.counts",
            f"such that KP1 x KP3 x (N/4 + 1) = {asked} fits the drive word of {spec.drive.pwm_bits} bits, {most} (7)",
            put("method.position_gains", [fitting, k2, k3]) if fitting else "lower KP1, KP3 or detector.counts",
        )
    error = LONGEST_DISTANCE if method.final == "incremental" else largest
    sums = {
        "method.speed_gains": (method.speed_gains, spec.peak_count, 0),
        "method.position_gains": (method.position_gains, error, method.integral_limit),
    }
    for key, ((k1, k2, k3), setpoint, integral) in sums.items():
        inner = k1 * setpoint + integral + (k2 << (method.speed_bits - 1))
        if k3 * inner > WIDEST_SUM:
            allowed = f"such that the largest sum of the arithmetic unit, here {k3 * inner:.3g}, fits 32 bits"
            yield wrong(f"{key} method.speed_bits limits.speed", allowed, put(key, [k1, k2, WIDEST_SUM // inner]))


def _table(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The velocity table reaches its peak, and does not stop before the threshold; ready comes before stop."""
    top, last, first, key = spec.peak_count, TABLE_ENTRIES - 1, spec.method.threshold + 1, "method.table_acceleration"
    reached = spec.table_velocity(last)
    # The entry of a distance of n steps is floor(sqrt(2 a n / step) Tv + 1/2).
    one = spec.step / (2 * spec.sample_period**2) * (1 + BARELY)
    if reached < top:
        yield wrong(
            f"{key} limits.speed clock.sample_tap",
            f"large enough for the peak of {top} pulses per sample within the {TABLE_ENTRIES} entries of the velocity "
            f"table, which ends at {reached}",
            remedy.least(key, (top - 0.5) ** 2 * one / last, "lower limits.speed"),
        )
    if top >= 1 and spec.table_velocity(first) < 1:
        yield wrong(
            f"{key} method.threshold clock.sample_tap",
            f"large enough for one pulse per sample {first} steps before the end: the carriage would stop before it "
            f"reaches method.threshold, {first - 1}",
            remedy.least(key, 0.25 * one / first, "raise clock.sample_tap"),
        )
    method = spec.method
    if not method.stop_always_off and method.stop_time < method.ready_time + spec.tick:
        allowed = f"longer than method.ready_time, {text(method.ready_time, 's')}: ready comes first (4)"
        later = remedy.least("method.stop_time", method.ready_time + spec.tick)
        yield wrong("method.stop_time method.ready_time", allowed, later)


def _edges(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """The faults of detector and comparator leave the two edges of a cycle apart."""
    table, weakest = spec.detector, weakest_output(spec)
    # By the offset, where the secondary is weakest [turn]; 0.5 where it does not reach the offset at all.
    share = abs(table.offset_error) / weakest
    displaced = math.asin(share) / (2 * math.pi) if share < 1 else 0.5
    # Largest rms jitter that the offset leaves room for [s].
    room = max(0.0, EDGE_LIMIT - displaced) * table.counts * spec.tick / JITTER_PEAK * table.amplitude
    if displaced > EDGE_LIMIT:
        largest = min(0.45, weakest * math.sin(2 * math.pi * EDGE_LIMIT))
        nearer, largest = (remedy.least, -largest) if table.offset_error < 0 else (remedy.most, largest)
        yield wrong(
            "detector.offset_error detector.amplitude detector.gain_error detector.quadrature_error",
            f"such that an edge is displaced by at most {EDGE_LIMIT:g} turn, here {displaced:.3g}: the two "
            "edges of a cycle would meet",
            nearer("detector.offset_error", largest),
        )
    elif table.jitter > room:
        yield wrong(
            "detector.jitter detector.amplitude clock.oscillator detector.counts detector.offset_error",
            f"up to {text(room, 's')}: its peak of {JITTER_PEAK} times that and the offset displace an edge by at most "
            f"{EDGE_LIMIT:g} turn of the carrier",
            remedy.most("detector.jitter", room),
        )


def _machine(spec: PhaseServoSpec) -> Iterator[Contradiction]:
    """Motor, friction and disturbances can be simulated."""
    m, friction = PhaseFigures(spec), spec.mechanics.friction
    plant = common.Plant(m.resistance, spec.motor.inductance, m.force_per_ampere * m.volts_per_speed / m.mass, m.mass)
    yield from common.time_constants(plant, friction, SERIES_SHARE / min(spec.tick, LONGEST_SUBSTEP))
    yield from common.static_friction(common.sides(friction))
    yield from common.burst(spec.disturbance.lines.burst, spec.tick)


# Contradictions are reported in this order.
RULES = (_tracker, _speed_counted, _approach, _way, _words, _table, _edges, _machine)


# ---- cautions


def find_cautions(spec: PhaseServoSpec) -> Iterator[Caution]:
    """Look a phase-servo axis over."""
    machine = PhaseFigures(spec)
    for look in (_current, _force, _speed, _settling, _integral, _detector, _burst):
        yield from look(machine)


def _current(m: PhaseFigures) -> Iterator[Caution]:
    """PWM, comparator and supply keep the current near its limit."""
    ratio, step, limit, stall = m.pwm_hz / m.corner_hz, m.current_per_tick, m.spec.limits.effort, m.stall_current
    if ratio <= PWM_RATIO:
        value = f"{text(m.pwm_hz, 'Hz')}, {ratio:.3g} x the electrical corner"
        consequence = "the current ripples with the PWM and the motor runs hot"
        advice = remedy.least("motor.inductance", PWM_RATIO * m.resistance / (2 * math.pi * m.pwm_hz) * (1 + BARELY))
        yield Caution("PWM frequency", value, f"above {PWM_RATIO} x", consequence, advice)
    if step > CURRENT_STEP * limit:
        allowed = f"up to {100 * CURRENT_STEP:g} % of limits.effort, {text(CURRENT_STEP * limit, 'A')}"
        consequence = "the current passes its limit by that much before the comparator is asked again"
        advice = "raise clock.oscillator, or choose a motor of more inductance"
        yield Caution("current within a tick", text(step, "A"), allowed, consequence, advice)
    if stall < limit:
        yield Caution(
            "stall current",
            text(stall, "A"),
            f"above limits.effort, {text(limit, 'A')}",
            "the supply cannot drive enough current to reach the limit, and the axis is slower than the limit suggests",
            remedy.most("limits.effort", stall, "raise drive.supply"),
        )
    most = m.spec.motor.max_current
    lower = remedy.most("limits.effort", most or 0.0, "choose a larger motor")
    yield from common.overheating("current limit", min(limit, stall), most, lower)


def _force(m: PhaseFigures) -> Iterator[Caution]:
    """The force follows the velocity table, and in position mode the carriage can stop."""
    asked, available = m.spec.method.table_acceleration, m.acceleration
    if asked >= available:
        gentler = remedy.most("method.table_acceleration", available * (1 - BARELY), "raise limits.effort")
        value = f"{text(m.force_limit, 'N')}, for {max(0.0, available):.3g} m/s^2 against friction"
        allowed = f"above a m + friction, {text(asked * m.mass + m.coulomb, 'N')}"
        consequence = "the carriage cannot follow the velocity table and overshoots its target"
        yield Caution("force at the current limit", value, allowed, consequence, gentler)
    if m.switch_deceleration >= available > 0:
        yield Caution(
            "deceleration from the change of mode",
            f"{text(m.switch_deceleration, 'm/s^2')} from {text(m.switch_speed, 'm/s')} within "
            f"{text(m.switch_distance, 'm')}",
            f"below what the current limit gives against friction, {text(available, 'm/s^2')}",
            "the carriage overshoots its target, and at high speed the positioning point too",
            "raise method.threshold, or lower method.table_acceleration",
        )


def _speed(m: PhaseFigures) -> Iterator[Caution]:
    """The supply is enough for the peak speed; tracker and speed word hold a little more than that."""
    spec, top, most = m.spec, m.top_speed, (1 << (m.spec.method.speed_bits - 1)) - 1
    reached = spec.peak_count + OVERSHOOT
    if top < m.peak_speed:
        allowed = f"enough for the peak of the velocity table, {text(m.peak_speed, 'm/s')}"
        consequence = "back-EMF and friction leave no voltage reserve: the carriage never reaches the table's speed"
        advice = remedy.most("limits.speed", top, "raise drive.supply") if top > 0 else "raise drive.supply"
        yield Caution("supply", f"enough for {text(max(0.0, top), 'm/s')}", allowed, consequence, advice)
    lost, over = "pulses are lost and the move ends early or late", "the speed word overflows and drives the wrong way"
    for name, largest, consequence, other in (
        ("slew limit of the tracker", m.slew_backward / m.speed_per_count, lost, "raise clock.oscillator"),
        ("range of the speed word", most, over, "raise method.speed_bits"),
    ):
        if reached > largest:
            slower = math.floor(largest) - OVERSHOOT + 1
            fitting = slower * m.speed_per_count * (1 - BARELY)
            value = f"up to {spec.peak_count} + {OVERSHOOT} counts per sample"
            advice = remedy.most("limits.speed", fitting, other) if slower >= 2 else other
            yield Caution(f"speed above the table, {name}", value, f"up to {largest:.4g} counts", consequence, advice)


def _settling(m: PhaseFigures) -> Iterator[Caution]:
    """The position loop settles before the axis says that it is ready, and friction does not hold it off."""
    (k1, k2, k3), ready = m.spec.method.position_gains, m.spec.method.ready_time
    rest, arrived = m.breakaway_counts / (k1 * k3), f"up to {m.spec.arrived_steps} steps, which count as arrived"
    end, lower = (
        m.approach,
        "lower KP1, KP2 or KP3 of method.position_gains, or shorten the speed sample (clock.sample_tap)",
    )
    if m.gain_margin < LEAST_GAIN_MARGIN:
        value, consequence = f"{m.gain_margin:.3g}", "the carriage oscillates about its target, or barely settles"
        yield Caution("gain margin of the position loop", value, f"at least {LEAST_GAIN_MARGIN:g}", consequence, lower)
    elif math.isinf(end.settling) and m.gain_margin < STIFF:
        value, consequence = (
            f"{end.off_at_ready:.2g} steps",
            "it oscillates about its target by whole counts of the speed word",
        )
        yield Caution("carriage after ready", value, arrived, consequence, lower)
    elif end.overshoot > m.spec.arrived_steps:
        consequence = "the carriage overshoots and swings back after the axis has signalled ready"
        yield Caution("overshoot of a move", f"{end.overshoot:.2g} steps", arrived, consequence, _calmer(m))
    elif ready < end.settling:
        value = f"{text(ready, 's')}, when a move may be {end.off_at_ready:.2g} steps off"
        allowed = f"at least the settling from the change of mode, {text(end.settling, 's')}"
        advice = remedy.least("method.ready_time", end.settling)
        yield Caution("method.ready_time", value, allowed, "the axis signals ready before it has settled", advice)
    if rest > 2:
        value = f"{m.breakaway_counts:.3g} counts, {rest:.3g} steps of error"
        allowed = f"up to 2 steps, {2 * k1 * k3} counts"
        consequence = "friction holds the carriage off its target until the integral moves it"
        advice = put("method.position_gains", [math.ceil(m.breakaway_counts / (2 * k3)), k2, k3])
        yield Caution("breakaway drive", value, allowed, consequence, advice)


def _calmer(m: PhaseFigures) -> str:
    """What takes the overshoot away: a longer speed sample, a step of which is worth more damping."""
    tap = m.spec.clock.sample_tap + 1
    slower = PhaseFigures(m.spec.changed(clock={"sample_tap": tap}))
    gains = "raise KP2 of method.position_gains, and KS2 or KS3 of method.speed_gains with it"
    calm = slower.approach.overshoot <= m.spec.arrived_steps and slower.approach.settling <= m.spec.method.ready_time
    cures = calm and slower.gain_margin >= LEAST_GAIN_MARGIN
    return remedy.least("clock.sample_tap", tap, gains) if cures else gains


def _integral(m: PhaseFigures) -> Iterator[Caution]:
    """The integral is slow enough, comes to rest and is strong enough."""
    method, clock, k3 = m.spec.method, m.spec.clock, m.spec.method.position_gains[2]
    if not method.integrator or method.stop_always_off:
        return
    if m.integral_rate > INTEGRAL_PACE:
        tap = clock.integrate_tap + math.ceil(math.log2(m.integral_rate / INTEGRAL_PACE))
        value, allowed = f"{m.integral_rate:.3g} steps within 1 rad of the position loop", f"up to {INTEGRAL_PACE:g}"
        advice = remedy.least("clock.integrate_tap", tap, "raise KP1 of method.position_gains")
        yield Caution("rate of the integral", value, allowed, "under load the integral hunts indefinitely", advice)
    if method.dead_band == 0:
        value = "0 with the integrator in use"
        consequence = "the integral never settles: the carriage hunts across the boundary"
        yield Caution("method.dead_band", value, "at least 1 step", consequence, put("method.dead_band", 1))
    if method.integral_limit * k3 < m.breakaway_counts:
        value = f"{method.integral_limit}, worth {method.integral_limit * k3} counts of drive"
        allowed = f"enough to overcome static friction, {m.breakaway_counts:.3g} counts"
        consequence = "the integral cannot bring a carriage that friction holds to its target"
        advice = remedy.least("method.integral_limit", m.breakaway_counts / k3, "lower friction")
        yield Caution("method.integral_limit", value, allowed, consequence, advice)


def _detector(m: PhaseFigures) -> Iterator[Caution]:
    """The detector is aligned and quiet."""
    spec, table = m.spec, m.spec.detector
    n, lag = table.counts, table.lag_counts
    off, peak = lag - (n // 4 - 1), JITTER_PEAK * spec.edge_jitter / spec.tick
    if off:
        yield Caution(
            "detector.lag_counts",
            f"{lag}, {abs(off)} steps from N/4 - 1",
            f"N/4 - 1 = {n // 4 - 1}",
            f"the axis stops {abs(off)} steps {'right' if off > 0 else 'left'} of its positioning points"
            if 0 < lag < n // 2
            else "the absolute word rises there, and the axis stops in another place of the pitch",
            put("detector.lag_counts", n // 4 - 1),
        )
    if peak > QUIET:
        yield Caution(
            "detector.jitter",
            f"up to {peak:.2g} steps on an edge",
            f"up to {QUIET:g} step",
            "noise makes pairs of opposite pulses on the way, the distance counter counts both of them down, and a "
            "long move stops at another positioning point",
            remedy.most("detector.jitter", QUIET * spec.tick / JITTER_PEAK * table.amplitude),
        )


def _burst(m: PhaseFigures) -> Iterator[Caution]:
    """Pulses of the disturbances are no more than the protection is said to stand."""
    spec, lines, expected = m.spec, m.spec.disturbance.lines, m.spec.method.expected_spurious
    longest = spec.limits.travel / m.peak_speed + m.peak_speed / spec.method.table_acceleration
    expectation, burst = f"up to method.expected_spurious, {expected}", lines.burst
    pulses = (len(burst.ticks) or burst.count) if burst and burst.kind in {"+", "-", "remove"} else 0
    if pulses > expected:
        protected = pulses + spec.method.threshold < spec.detector.counts // 2
        yield Caution(
            "pulses of disturbance.lines.burst",
            f"{pulses}",
            expectation,
            "the protection is not specified for so many: within one move they may lead to another pitch",
            put("method.expected_spurious", pulses) if protected else f"use a burst of {expected} pulses or fewer",
        )
    rate = lines.inserted + lines.removed
    if rate * longest > max(1, expected):
        value = f"{rate * longest:.3g} in the longest move, {text(longest, 's')}"
        consequence = "the protection is not specified for so many: a long move may end in another pitch"
        advice = f"lower disturbance.lines.inserted and removed to {at_most(max(1, expected) / longest, 'Hz')} together"
        yield Caution("pulses of disturbance.lines", value, expectation, consequence, advice)
