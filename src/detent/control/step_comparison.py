"""What the envelope is compared with: ramps computed at every step, and none (stepper-envelope specification 3.7).

Both conventional methods know the extremes only, and one constant acceleration. They run on the registers of the
envelope's control unit, so that timer and rotor cannot tell them apart.
"""

import math

from detent.control.step_rule import ACCEL, CRUISE, DECEL, IDLE, REST, STEP, StepRule
from detent.kernel.registers import Registers, f8, f8_array, i8, i8_array, register, u1
from detent.kernel.step import bounded, hot_step

BRAKING_DISTANCE, PERMISSIBLE_FREQUENCY, CONSTANT_FREQUENCY = 1, 2, 3  # conventional A, conventional B, the naive drive
ZONES = 33
ROUNDING = 1e-6  # steps that rounding may add to a braking distance: a ramp of whole steps would brake one step early


class ComparisonParams(Registers):
    """A run of `steps` steps from the position `begin` in one direction."""

    method: u1 = register("0 envelope, 1 conventional A, 2 conventional B, 3 constant frequency", unit="code")
    begin: i8 = register("position of the start extreme", unit="count")
    steps: i8 = register("way to the stop extreme", unit="count")
    start_hz: f8 = register("start and stop frequency; the frequency of the naive drive", unit="Hz")
    acceleration: f8 = register("acceleration and deceleration", unit="step/s2")
    zones: i8 = register("stretches of equal limit", unit="count")
    edge: i8_array = register("step at which each stretch ends, counted from `begin`", unit="count", length=ZONES)
    limit: f8_array = register("frequency limit of each stretch", unit="Hz", length=ZONES)


class Comparison(Registers):
    """State of the computed ramp."""

    hz: f8 = register("frequency of the running step, 0 at rest", unit="Hz")
    zone: i8 = register("stretch of the next step", unit="count")


@hot_step
def braking_steps(p: ComparisonParams, hz: float) -> float:
    """Steps after this one that it takes to come down to the stop frequency: (f^2 - f_stop^2) / 2a."""
    return (hz * hz - p.start_hz * p.start_hz) / (2.0 * p.acceleration) - ROUNDING


@hot_step
@bounded(ZONES, "passes one stretch per turn")
def zone_limit(p: ComparisonParams, c: Comparison, made: int) -> float:
    """Limit of the step number `made`; the stretches are passed in order."""
    while c.zone < p.zones - 1 and made >= p.edge[c.zone]:
        c.zone += 1
    return p.limit[c.zone]


@hot_step
def by_braking_distance(p: ComparisonParams, c: Comparison, made: int) -> float:
    """Conventional A: brake as soon as the way left is not longer than the braking distance."""
    square = c.hz * c.hz
    raised = p.start_hz
    if made > 0:
        raised = math.sqrt(square + 2.0 * p.acceleration)
    raised = min(raised, zone_limit(p, c, made))
    left = p.steps - 1 - made
    if braking_steps(p, raised) <= left:
        return raised
    if braking_steps(p, c.hz) <= left:
        return c.hz
    return math.sqrt(max(square - 2.0 * p.acceleration, p.start_hz * p.start_hz))


@hot_step
def by_permissible_frequency(p: ComparisonParams, c: Comparison, made: int) -> float:
    """Conventional B: f_adm = sqrt(f_stop^2 + 2 a d) for the distance d to the nearer extreme, then the zone."""
    distance = min(made, p.steps - 1 - made)
    admissible = math.sqrt(p.start_hz * p.start_hz + 2.0 * p.acceleration * distance)
    return min(admissible, zone_limit(p, c, made))


@hot_step
def next_compared_step(p: ComparisonParams, c: Comparison, r: StepRule) -> int:
    """Decide about the next step by another method, and make it; IDLE, or STEP with its frequency [Hz] in `word`."""
    if r.start:
        r.start, r.active, r.direction = 0, 1, r.heading
        c.hz, c.zone = 0.0, 0
    made = (r.position - p.begin) * r.direction
    if not r.active or made >= p.steps:
        if r.active:
            r.event = 1
        r.active, r.state, r.word, c.hz = 0, REST, 0, 0.0
        return IDLE
    hz = p.start_hz
    if p.method == BRAKING_DISTANCE:
        hz = by_braking_distance(p, c, made)
    elif p.method == PERMISSIBLE_FREQUENCY:
        hz = by_permissible_frequency(p, c, made)
    r.state = CRUISE
    if hz != c.hz:
        r.state = ACCEL if hz > c.hz else DECEL
    c.hz = hz
    r.word = int(hz + 0.5)
    r.position += r.direction
    return STEP
