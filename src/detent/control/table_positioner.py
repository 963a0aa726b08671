"""Positioner of a rotary table: the 2 ms interrupt and the 20 ms task (rotary-table specification 3, 4; A1 to A6).

During a jog the target is two periods ahead. When less than one period of the interpolated way remains, the task moves
measurement and interpolated target back by one period together, so the servo never sees an end. Registers have their
names of the specification; the target is OAR, the interpolated one is ``C = OAR - Z IR``.
"""

import math

from detent.kernel.registers import Registers, block, f8, i1, i4, i8, i8_array, register, u1, u1_array
from detent.kernel.step import step

TURN_COUNTER, FLAG, RAW = 0, 1, 2  # forms of the extension of the angle
# States of specification 4; JOG-RAW and JOG-EXT differ in FLG and n only.
POWER_ON, HOLD, JOG, STOPPING, MOVE = 0, 1, 2, 3, 4
BY_THEORETICAL, BY_ACTUAL = 0, 1  # remaining angle that the judge looks at
# How steps 118 and 120 are stored; in the last two an interrupt can come between.
ATOMIC, FLAG_FIRST, REMAINING_FIRST = 0, 1, 2
BUSY, NO_SUCH_POSITION, TOO_FAR = 1, 2, 3  # reasons for a refusal
LONGEST_WAY = 1 << 31  # ways are shorter: IR has 32 bits before its point [count]
SHORTEST, POSITIVE, NEGATIVE, AS_COMMANDED = 0, 1, 2, 3  # direction policies: ways to an angle
POSITIONS = 128


class EndlessAngleParams(Registers):
    """Range of the detector and form of the extension beyond its one turn (3.2 to 3.5).

    The present angle R is the detected one, D, with whole periods added: by a signed turn counter; by the flag of the
    patent, which adds one period in the direction of the jog after any crossing; or, as a conventional unit, none.
    """

    period: i8 = register("range of the detected angle T", unit="count", range=(1, 1 << 40))
    form: u1 = register("0 turn counter, 1 flag as in the patent, 2 raw: no extension", unit="code", option=True)


class EndlessAngle(Registers):
    """Detected and present angle."""

    dar: i8 = register("DAR: detected angle D, 0..T-1", unit="count")
    d_prev: i8 = register("D_prev: detected angle of the interrupt before", unit="count")
    flg: u1 = register("FLG, 1: a boundary has been crossed in this manual feed")
    turn: i8 = register("n: periods to add, signed", unit="count")
    aar: i8 = register("AAR: present angle R, extended", unit="count")
    position: i8 = register("position of record: all movement since power-on added to the first angle", unit="count")
    crossings: i8 = register("boundaries crossed, either way", unit="count")


class InterpolatorParams(Registers):
    """Format and acceleration of the interpolator, which runs IR to zero in a trapezoid of speed (3.3).

    Remaining angle, speed and acceleration have f fraction bits: at a slow jog an interrupt moves less than a count.
    """

    fraction: i8 = register("fraction bits f of remaining angle, speed and acceleration", unit="count", range=(0, 16))
    acceleration: i8 = register("change of speed per interrupt, above 0", unit="count/2^f")
    max_speed: i8 = register("largest speed, whatever dial or table say", unit="count/2^f")


class Interpolator(Registers):
    """Theoretical remaining angle and speed."""

    irr: i8 = register("IRR: theoretical remaining angle IR", unit="count/2^f")
    speed: i8 = register("v: what IR loses per interrupt", unit="count/2^f")


class PositionTable(Registers):
    """PDT (3.6): angle, speed and way per position number, written by operator or program."""

    entries: i8 = register("position numbers in use, from 0", unit="count", range=(0, POSITIONS))
    angle: i8_array = register("angle", unit="count", length=POSITIONS)
    speed: i8_array = register(
        "speed per interrupt; 0 where there is no such position", unit="count/2^f", length=POSITIONS
    )
    policy: u1_array = register("0 shortest, 1 positive, 2 negative, 3 as commanded", unit="code", length=POSITIONS)
    tolerance: i8 = register(
        "a target this near is taken the short way, whatever its direction; below T/2", unit="count"
    )


class PositionerParams(Registers):
    """Range, format, gain, forms."""

    angle: EndlessAngleParams = block("extension of the detected angle")
    interpolator: InterpolatorParams = block("interpolator")
    pdt: PositionTable = block("position table PDT")
    gain: f8 = register("words of register 5 per deviation", unit="count/(count/2^f)")
    speed_gain: f8 = register("words of register 5 per speed, without position control", unit="count/(count/2^f)")
    max_word: i8 = register("largest magnitude of the word: 2047 with 12 bits", unit="count")
    window: i8 = register("deviation that counts as in position", unit="count")
    window_interrupts: i8 = register("interrupts inside it until the axis says so", unit="count")
    judge: u1 = register("remaining angle of step 116: 0 theoretical IR, 1 actual AR", unit="code", option=True)
    inclusive: u1 = register("1: the judge fires at T or less, 0: below T", option=True)
    guarded: u1 = register("1: it fires only with FLG on; the turn counter does not need that", option=True)
    update: u1 = register("118 and 120: 0 indivisible, 1 flag first, 2 remaining first", unit="code", option=True)
    unsigned_remaining: u1 = register("1: AR = |M - R| as in the flowchart, 0: signed along Z", option=True)
    open_loop: u1 = register(
        "1: S4 is the interpolated speed, without position control; what the method is compared with",
        option=True,
    )


class Positioner(Registers):
    """Registers of the positioner, and the mailbox of sequence controller and panel."""

    plus: u1 = register("+ button, written by the host: 1 while held down, to jog to larger angles")
    minus: u1 = register("- button, written by the host: 1 while held down")
    dial: i8 = register("speed dial, written by the host", unit="count/2^f")
    number: u1 = register("position number, written by the host", unit="code")
    start: u1 = register("1: start a positioning, written by the host, cleared when taken")
    event: u1 = register("1 when the axis has come to rest in HOLD, or its guard speaks; the host clears it")
    refused: i8 = register("starts that were not taken", unit="count")
    reason: u1 = register("why the last was not: 1 busy, 2 no such position, 3 too far", unit="code")
    state: u1 = register("0 power-on, 1 hold, 2 jog, 3 stopping, 4 move", unit="code")
    angle: EndlessAngle = block("detected and present angle")
    interpolator: Interpolator = block("theoretical remaining angle and speed")
    oar: i8 = register("OAR: target M", unit="count")
    arr: i8 = register("ARR: actual remaining angle AR, along Z", unit="count")
    z: i1 = register("Z: direction, 1 or -1")
    limit: i8 = register("speed of the present positioning", unit="count/2^f")
    dr: i8 = register("deviation dR = AR - IR; positive: the table lags", unit="count/2^f")
    s4: i4 = register("speed signal S4, the word for register 5", unit="count")
    unfinished: u1 = register("rollover of which one half is stored: 1 flag, 2 remaining", unit="code")
    inside: i8 = register("interrupts in position so far", unit="count")
    interrupts: i8 = register("interrupts so far", unit="count")
    passes: i8 = register("passes of the task so far", unit="count")
    rollovers: i8 = register("rollovers so far", unit="count")


# -------------------------------------------------------------------------------- angle beyond a turn, A2: 200 to 212


@step
def first_angle(r: EndlessAngle, d: int) -> None:
    """The first angle after power-on."""
    r.dar = r.d_prev = r.aar = r.position = d
    r.flg = 0
    r.turn = 0


@step
def read_angle(p: EndlessAngleParams, r: EndlessAngle, d: int, manual: bool) -> None:
    """Take over the detected angle: a change of more than half a period is a crossing. `manual`: FLG may be set."""
    change = d - r.d_prev
    wraps = 1 if 2 * change < -p.period else (-1 if 2 * change > p.period else 0)
    r.dar = r.d_prev = d
    r.position += change + wraps * p.period
    if wraps != 0:
        r.crossings += 1
        r.turn += wraps
        if manual:
            r.flg = 1


@step
def extend(p: EndlessAngleParams, r: EndlessAngle, z: int) -> None:
    """Present angle R; `z` is the direction of the jog."""
    if p.form == TURN_COUNTER:
        r.aar = r.dar + r.turn * p.period
    elif p.form == FLAG and r.flg:
        r.aar = r.dar + z * p.period
    else:
        r.aar = r.dar


@step
def start_raw(r: EndlessAngle) -> None:
    """Initial set: nothing is added."""
    r.flg = 0
    r.turn = 0
    r.aar = r.dar


@step
def shift_back(r: EndlessAngle, z: int) -> None:
    """Step 118: one period less, against the direction of the jog."""
    r.flg = 0
    r.turn -= z


# ------------------------------------------------------------------------------------------------- 2 ms interrupt


@step
def interrupt(p: PositionerParams, r: Positioner, d: int) -> None:
    """Interrupt S8 with the detected angle: steps 200 to 228."""
    if r.state == POWER_ON:  # the table is held where the first angle finds it
        first_angle(r.angle, d)
        r.oar = d
        r.z = 1
        r.state = HOLD
    manual = r.state in (JOG, STOPPING)
    read_angle(p.angle, r.angle, d, manual)
    extend(p.angle, r.angle, r.z)
    distance = r.oar - r.angle.aar  # steps 214 to 218: from R to M, along Z [count]
    r.arr = abs(distance) if p.unsigned_remaining else r.z * distance
    interpolate(p.interpolator, r.interpolator, speed_limit(p, r))
    r.dr = (r.arr << p.interpolator.fraction) - r.interpolator.irr
    r.s4 = speed_word(p, r)
    r.interrupts += 1
    watch_end(p, r)


@step
def interpolate(p: InterpolatorParams, r: Interpolator, limit: int) -> None:
    """Step 222: one interrupt; `limit` is the speed of dial or table.

    ``v <= sqrt(2 a IR)`` lets it end at rest. A dial turned down takes the speed back no faster than the acceleration.
    """
    allowed = max(min(limit, p.max_speed), r.speed - p.acceleration)
    braking = math.floor(math.sqrt(2.0 * p.acceleration * r.irr))
    r.speed = min(r.speed + p.acceleration, allowed, braking)
    r.irr -= min(r.speed, r.irr)
    if r.irr == 0:
        r.speed = 0


@step
def speed_limit(p: PositionerParams, r: Positioner) -> int:
    """Speed the interpolator may reach: of the table, of the dial, or in a stop what it has."""
    if r.state == MOVE:
        return r.limit
    if r.state == STOPPING:  # from rest it must still use up the fraction of a count that is left
        return max(r.interpolator.speed, p.interpolator.acceleration)
    return max(r.dial, 0)


@step
def speed_word(p: PositionerParams, r: Positioner) -> int:
    """Steps 226 to 228: ``S4 = Z Kp dR`` in words of register 5, rounded and limited."""
    wanted = p.speed_gain * r.interpolator.speed if p.open_loop else p.gain * r.dr
    limit = p.max_word * 1.0
    return r.z * math.floor(min(max(wanted, -limit), limit) + 0.5)


@step
def watch_end(p: PositionerParams, r: Positioner) -> None:
    """Come to rest when a stop has run out or a positioning has arrived."""
    if r.interpolator.irr > 0:
        return
    if r.state == STOPPING:
        rest(p, r)
    elif r.state == MOVE:
        near = abs(r.oar - r.angle.aar) <= p.window
        r.inside = r.inside + 1 if near else 0
        if r.inside >= p.window_interrupts:
            rest(p, r)


@step
def rest(p: PositionerParams, r: Positioner) -> None:
    """HOLD; with the turn counter the target is brought back into [0, T), and R with it."""
    if p.angle.form == TURN_COUNTER:
        periods = r.oar // p.angle.period
        r.oar -= periods * p.angle.period
        r.angle.turn -= periods
        extend(p.angle, r.angle, r.z)
    r.state = HOLD
    r.event = 1


# ------------------------------------------------------------------------------------------------- 20 ms task


@step
def begin_task(p: PositionerParams, r: Positioner) -> None:
    """Timer task, steps 100 to 122, up to where an interrupt can come between the halves of a rollover."""
    r.passes += 1
    if r.state == HOLD and r.plus != r.minus:
        start_jog(p, r, 1 if r.plus else -1)
    elif r.state == JOG:
        held = r.plus if r.z > 0 else r.minus
        if held == 0:
            stop_jog(p, r)
        elif is_due(p, r):
            begin_rollover(p, r)
    if r.start:
        take_position(p, r)


@step
def end_task(p: PositionerParams, r: Positioner) -> None:
    """The rest of the pass: the other half of a rollover."""
    if r.unfinished == FLAG_FIRST:
        advance_remaining(p, r)
    elif r.unfinished == REMAINING_FIRST:
        shift_back(r.angle, r.z)
    r.unfinished = 0


@step
def start_jog(p: PositionerParams, r: Positioner, z: int) -> None:
    """First pass with a button: steps 102 to 114, the target two periods ahead."""
    r.z = z
    start_raw(r.angle)
    ahead = 2 * p.angle.period
    r.oar = r.angle.dar + ahead * z
    r.arr = ahead
    r.interpolator.irr = ahead << p.interpolator.fraction
    r.interpolator.speed = 0
    r.state = JOG


@step
def is_due(p: PositionerParams, r: Positioner) -> bool:
    """Step 116: less than one period remains."""
    if p.angle.form == RAW or (p.guarded and r.angle.flg == 0):
        return False
    left = r.arr << p.interpolator.fraction if p.judge == BY_ACTUAL else r.interpolator.irr
    limit = p.angle.period << p.interpolator.fraction
    return left < limit + (1 if p.inclusive else 0)


@step
def begin_rollover(p: PositionerParams, r: Positioner) -> None:
    """Steps 118 and 120: measurement and interpolated target go back by one period, at once or in halves."""
    r.rollovers += 1
    r.unfinished = p.update
    if p.update != REMAINING_FIRST:
        shift_back(r.angle, r.z)
    if p.update != FLAG_FIRST:
        advance_remaining(p, r)


@step
def advance_remaining(p: PositionerParams, r: Positioner) -> None:
    """Step 120: one period more remains."""
    r.interpolator.irr += p.angle.period << p.interpolator.fraction


@step
def braking_path(p: InterpolatorParams, r: Interpolator) -> int:
    """Path from the present speed to rest, v^2 / 2a [count/2^f]."""
    return r.speed * r.speed // (2 * p.acceleration)


@step
def stop_jog(p: PositionerParams, r: Positioner) -> None:
    """Release: the target comes to where the interpolated one can stop, by whole counts, so C stays where it is."""
    f = p.interpolator.fraction
    spare = (r.interpolator.irr - braking_path(p.interpolator, r.interpolator)) >> f
    r.interpolator.irr -= spare << f
    r.oar -= r.z * spare
    r.state = STOPPING


@step
def way_to(period: int, tolerance: int, policy: int, target: int, present: int) -> int:
    """Signed way from the present angle to a target [count]; exactly half a turn goes negative by the shortest way.

    A table that stands a count beyond its target would go round almost a whole turn to come to it from its own side:
    within `tolerance` it goes back.
    """
    if policy == AS_COMMANDED:
        return target - present
    half = period >> 1
    way = (target - present + half) % period - half
    if policy == POSITIVE and way < -tolerance:
        return way + period
    if policy == NEGATIVE and way > tolerance:
        return way - period
    return way


@step
def take_position(p: PositionerParams, r: Positioner) -> None:
    """Position number: only the turn counter carries a positioning over the boundary."""
    r.start = 0
    if r.state != HOLD:
        refuse(r, BUSY)
        return
    if r.number >= p.pdt.entries or p.pdt.speed[r.number] <= 0:
        refuse(r, NO_SUCH_POSITION)
        return
    set_out(p, r, p.pdt.angle[r.number], p.pdt.policy[r.number], p.pdt.speed[r.number])


@step
def set_out(p: PositionerParams, r: Positioner, angle: int, policy: int, speed: int) -> None:
    """Begin a positioning to an angle [count] at a speed [count/2^f per interrupt]."""
    if p.angle.form != TURN_COUNTER:
        start_raw(r.angle)
    policy = policy if p.angle.form == TURN_COUNTER else AS_COMMANDED
    way = way_to(p.angle.period, p.pdt.tolerance, policy, angle, r.angle.aar)
    if abs(way) >= LONGEST_WAY:
        refuse(r, TOO_FAR)
        return
    r.z = -1 if way < 0 else 1
    r.oar = r.angle.aar + way
    r.interpolator.irr = abs(way) << p.interpolator.fraction
    r.interpolator.speed = 0
    r.limit = speed
    r.inside = 0
    r.state = MOVE


@step
def refuse(r: Positioner, reason: int) -> None:
    """A start that is not taken."""
    r.refused += 1
    r.reason = reason
