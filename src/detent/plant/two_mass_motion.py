"""One tick of motor and load: a Runge-Kutta step, or several where a mass stops or a flank is met.

The mechanics have no exact solution: the Stribeck curve and the pendulum are not linear, and there would be a matrix
for each of 18 regimes (direction of each mass or its standstill, contact or not). Within a regime the equations are
smooth: the classical Runge-Kutta step has order 4, and `linear_two_mass.fastest_rate` says whether the tick is short
enough. At the end of a regime the tick is split: the moment at which a mass comes to rest or a flank is met is found to
rounding, so that the order is not lost there. A mass that stops and is pushed on within the same step shows in its way:
the parabola through both velocities with that way goes below 0, and the tick is split there. A mass at rest stays
exactly there until the force on it is beyond its static friction; this is asked at the beginning of a tick, and of each
piece of one.
"""

from detent.kernel.step import hot_step, step
from detent.plant.dc_winding import flowing_current
from detent.plant.stribeck import is_dry
from detent.plant.two_mass import State, TwoMass, TwoMassParams, find_senses, flow

MOTOR_REVERSES, LOAD_REVERSES, POSITIVE_FLANK, NEGATIVE_FLANK = 1, 2, 3, 4  # ends of a regime; a flank is met or left
PIECES = 8  # regimes in one tick at most; what is left of it then runs to its end in the last one
ROOT_STEPS = 40  # steps of the search for the moment of an event; some six are usual


@hot_step
def gap_left(p: TwoMassParams, side: int, twist: float) -> float:
    """Way until a flank is met, or until those in contact part [m]; below 0 it has been passed."""
    if p.half_gap == 0.0:
        return 1.0
    return p.half_gap - abs(twist) if side == 0 else twist * side - p.half_gap


@step
def flank_left(p: TwoMassParams, side: int, flank: int, twist: float) -> float:
    """Way until this flank, 1 or -1, is met or left [m]; below 0 it has been passed.

    Each flank is an event of its own: within one tick the axis may leave one and meet the other.
    """
    if side == -flank or p.half_gap == 0.0:
        return 1.0
    return p.half_gap - twist * flank if side == 0 else twist * flank - p.half_gap


@hot_step
def accept(p: TwoMassParams, r: TwoMass, after: State) -> None:
    """Take the state over."""
    current, r.motor.position, r.motor.velocity, r.load.position, r.load.velocity = after
    r.current = flowing_current(p.winding, r.effort, current, r.motor.velocity)


@hot_step
def lowest_of(sense: int, before: float, after: float, way: float) -> float:
    """Share of a step at which a mass has turned round if it moves on in its direction at both ends; 1 if it has not.

    Its velocity is taken for the parabola with these ends [m/s] and this mean [m/s].
    """
    begin = before * sense
    bend = 3.0 * (begin + after * sense) - 6.0 * way * sense
    slope = after * sense - begin - bend
    if begin > 0.0 and slope < 0.0 and slope * slope > 4.0 * bend * begin and -slope < 2.0 * bend:
        return -0.5 * slope / bend
    return 1.0


@hot_step
def lowest(p: TwoMassParams, r: TwoMass, after: State, h: float) -> float:
    """Share of a step of `h` [s] at which the first mass has turned round that moves on at its end; 1 if none has."""
    m, n = r.motor, r.load
    share = lowest_of(m.sense, m.velocity, after[2], (after[1] - m.position) / h)
    if p.stiffness == 0.0:
        return share
    return min(share, lowest_of(n.sense, n.velocity, after[4], (after[3] - n.position) / h))


@hot_step
def move_masses(p: TwoMassParams, r: TwoMass) -> None:
    """One tick with the effort and the external force in `r`."""
    find_senses(p, r)
    after = flow(p, r, p.period)
    reversal = after[2] * r.motor.sense < 0.0 or after[4] * r.load.sense < 0.0
    if reversal or gap_left(p, r.side, after[1] - after[3]) < 0.0 or lowest(p, r, after, p.period) < 1.0:
        move_in_pieces(p, r)
    else:
        accept(p, r, after)


@step
def flow_piece(p: TwoMassParams, r: TwoMass, h: float) -> State:
    """`flow` where it is called too often to be written out each time: in a tick of several regimes."""
    return flow(p, r, h)


@step
def left_of_regime(p: TwoMassParams, r: TwoMass, event: int, after: State) -> float:
    """What falls below 0 when `event` ends the regime of `r`: a speed [m/s] or a way [m]."""
    if event >= POSITIVE_FLANK:
        return flank_left(p, r.side, 1 if event == POSITIVE_FLANK else -1, after[1] - after[3])
    if event == LOAD_REVERSES:
        return after[4] * r.load.sense if p.stiffness > 0.0 and is_dry(p.load.friction) else 0.0
    dry = p.loss > 0.0 or r.brake > 0.0 or is_dry(p.motor.friction) or (p.stiffness == 0.0 and is_dry(p.load.friction))
    return after[2] * r.motor.sense if dry else 0.0


@step
def first_event(p: TwoMassParams, r: TwoMass, before: State, after: State) -> int:
    """What ends the regime first on the way from `before` to `after`, as straight lines show it; 0 nothing."""
    first, least = 0, 2.0
    for event in range(MOTOR_REVERSES, NEGATIVE_FLANK + 1):
        end = left_of_regime(p, r, event, after)
        if end < 0.0:
            begin = max(left_of_regime(p, r, event, before), 0.0)
            share = begin / (begin - end)
            if share < least:
                first, least = event, share
    return first


@step
def time_of_event(p: TwoMassParams, r: TwoMass, event: int, before: State, h: float) -> float:
    """Time until `event` [s], which comes within `h` [s]: by regula falsi with halved ends (Illinois method)."""
    early, late = 0.0, h
    begin = left_of_regime(p, r, event, before)
    end = left_of_regime(p, r, event, flow_piece(p, r, h))
    if begin <= 0.0:
        return 0.0
    moment, last = 0.0, 0
    for _ in range(ROOT_STEPS):
        moment = early + (late - early) * (begin / (begin - end))
        found = left_of_regime(p, r, event, flow_piece(p, r, moment))
        if found == 0.0 or late - early <= 1e-15 * h:
            return moment
        if found > 0.0:
            early, begin = moment, found
            end = 0.5 * end if last > 0 else end
            last = 1
        else:
            late, end = moment, found
            begin = 0.5 * begin if last < 0 else begin
            last = -1
    return moment


@step
def end_regime(p: TwoMassParams, r: TwoMass, event: int) -> None:
    """What the event leaves: a mass at rest, or another flank."""
    if event == POSITIVE_FLANK:
        r.side = 1 - r.side
    if event == NEGATIVE_FLANK:
        r.side = -1 - r.side
    if event == MOTOR_REVERSES:
        r.motor.velocity = 0.0
    if event == LOAD_REVERSES or p.stiffness == 0.0:
        r.load.velocity = 0.0


@step
def hold(p: TwoMassParams, r: TwoMass, held: int) -> None:
    """A mass that was pushed back as it broke loose has not broken loose in this tick; `held` is the sum of them."""
    if held & MOTOR_REVERSES:
        r.motor.sense = 0
    if held & LOAD_REVERSES or (p.stiffness == 0.0 and held > 0):
        r.load.sense = 0


@step
def next_event(p: TwoMassParams, r: TwoMass, before: State, left: float) -> tuple[int, float]:
    """What ends the regime within `left` [s], 0 nothing, and when [s]; or where a mass seems to turn round unseen."""
    after = flow_piece(p, r, left)
    event, piece = first_event(p, r, before, after), left
    if event == 0:
        piece = left * lowest(p, r, after, left)
        event = first_event(p, r, before, flow_piece(p, r, piece)) if piece < left else 0
    return event, piece if event == 0 else time_of_event(p, r, event, before, piece)


@step
def move_in_pieces(p: TwoMassParams, r: TwoMass) -> None:
    """A tick in which a regime ends: piece by piece, one regime each."""
    left, held = p.period, 0
    for _ in range(PIECES):
        find_senses(p, r)
        hold(p, r, held)
        before = (r.current, r.motor.position, r.motor.velocity, r.load.position, r.load.velocity)
        event, moment = next_event(p, r, before, left)
        if moment == 0.0 and event in (MOTOR_REVERSES, LOAD_REVERSES):
            held |= event
            continue
        accept(p, r, flow_piece(p, r, moment))
        left -= moment
        if event != 0:
            end_regime(p, r, event)
        elif left == 0.0:
            return
    finish(p, r, left)


@step
def finish(p: TwoMassParams, r: TwoMass, left: float) -> None:
    """The rest of a tick, whatever comes in it: who has turned round is at rest, who has met a flank is in contact."""
    after = flow_piece(p, r, left)
    passed = 0  # a bit for each event
    for event in range(MOTOR_REVERSES, NEGATIVE_FLANK + 1):
        if left_of_regime(p, r, event, after) < 0.0:
            passed |= 1 << event
    accept(p, r, after)
    for event in range(MOTOR_REVERSES, NEGATIVE_FLANK + 1):
        if passed >> event & 1:
            end_regime(p, r, event)
