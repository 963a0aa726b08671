import itertools
import math

import pytest
from tests.rotary_table_rig import ONE, PositionerBench, T, speed_word

from detent.control.table_positioner import (
    AS_COMMANDED,
    BUSY,
    BY_ACTUAL,
    FLAG,
    FLAG_FIRST,
    HOLD,
    JOG,
    MOVE,
    NEGATIVE,
    NO_SUCH_POSITION,
    POSITIVE,
    RAW,
    REMAINING_FIRST,
    SHORTEST,
    STOPPING,
    TOO_FAR,
    TURN_COUNTER,
    EndlessAngle,
    EndlessAngleParams,
    Interpolator,
    InterpolatorParams,
    begin_task,
    braking_path,
    end_task,
    extend,
    first_angle,
    interpolate,
    read_angle,
    shift_back,
    start_raw,
    way_to,
)

PLACE = 100_000
PERIOD = 1000
TURN = 3600


def jogging(sign: int = 1, interrupts: int = 0, **changes) -> PositionerBench:
    """A jog whose table follows at once."""
    bench = PositionerBench(PLACE, **changes)
    bench.r.dial = speed_word(60)
    bench.r.plus, bench.r.minus = sign > 0, sign < 0
    begin_task(bench.p, bench.r)
    for _ in range(interrupts):
        bench.feed(round(bench.command))
    return bench


def run_pass(bench: PositionerBench) -> None:
    begin_task(bench.p, bench.r)
    end_task(bench.p, bench.r)


def test_power_on_holds_where_the_table_stands():
    bench = PositionerBench(PLACE)
    assert (bench.r.state, bench.r.oar, bench.r.angle.aar, bench.r.s4) == (HOLD, PLACE, PLACE, 0)
    bench.feed(PLACE - 10)
    assert bench.r.arr == 10
    assert bench.r.s4 == round(bench.p.gain * 10 * ONE)
    bench.feed(PLACE + 10)
    assert bench.r.s4 == -round(bench.p.gain * 10 * ONE)


@pytest.mark.parametrize("place", [0, 5, T - 3])
def test_hold_at_the_boundary_does_not_see_it(place):
    bench = PositionerBench(place)
    for noise in (4, -4, -6, 3, -1, 0):
        bench.feed(place + noise)
        assert bench.r.arr == -noise
    assert bench.r.angle.position == place


def test_the_speed_signal_is_limited():
    bench = PositionerBench(PLACE)
    bench.feed(PLACE - 50_000)
    assert bench.r.s4 == bench.p.max_word
    bench.feed(PLACE + 50_000)
    assert bench.r.s4 == -bench.p.max_word


@pytest.mark.parametrize(("plus", "minus", "state"), [(0, 0, HOLD), (1, 1, HOLD), (1, 0, JOG), (0, 1, JOG)])
def test_one_button_starts_a_jog(plus, minus, state):
    bench = PositionerBench(PLACE)
    bench.r.plus, bench.r.minus = plus, minus
    run_pass(bench)
    assert bench.r.state == state
    assert state == HOLD or bench.r.z == plus - minus


@pytest.mark.parametrize("sign", [1, -1])
def test_the_other_button_is_not_heard_until_release(sign):
    bench = jogging(sign, 50)
    bench.r.plus = bench.r.minus = 1
    run_pass(bench)
    assert (bench.r.state, bench.r.z) == (JOG, sign)
    bench.r.plus, bench.r.minus = sign < 0, sign > 0
    run_pass(bench)
    assert bench.r.state == STOPPING


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("interrupts", [0, 1, 3, 60, 500])
def test_a_release_leaves_the_command_where_it_is_and_brings_it_to_rest(sign, interrupts):
    bench = jogging(sign, interrupts)
    before, speed = bench.command, bench.r.interpolator.speed
    bench.r.plus = bench.r.minus = 0
    run_pass(bench)
    assert (bench.command, bench.r.state) == (before, STOPPING)
    path = speed**2 / (2 * bench.p.interpolator.acceleration) / ONE
    assert 0 <= sign * (bench.r.oar - before) - path < 1.001
    for n in range(200):
        bench.feed(round(bench.command))
        if bench.r.state == HOLD:
            break
        assert n < 150
    assert (bench.r.event, bench.command) == (1, bench.r.oar)
    assert 0 <= bench.r.oar < T


def test_the_judge_fires_below_one_period():
    bench = jogging(1, 20)
    for irr, due in ((T * ONE + 1, 0), (T * ONE, 0), (T * ONE - 1, 1)):
        bench.r.interpolator.irr = irr
        bench.r.rollovers = 0
        run_pass(bench)
        assert bench.r.rollovers == due
    bench.p.inclusive = 1
    bench.r.interpolator.irr = T * ONE
    run_pass(bench)
    assert bench.r.rollovers == 2


def test_the_judge_by_the_actual_angle():
    bench = jogging(1, 20, judge=BY_ACTUAL)
    bench.r.interpolator.irr = T * ONE - 5
    bench.r.arr = T
    run_pass(bench)
    assert bench.r.rollovers == 0
    bench.r.arr = T - 1
    run_pass(bench)
    assert bench.r.rollovers == 1


def test_a_guarded_judge_waits_for_the_flag():
    bench = jogging(1, 20, form=FLAG, guarded=1)
    bench.r.interpolator.irr = T * ONE - 5
    run_pass(bench)
    assert bench.r.rollovers == 0
    bench.r.angle.flg = 1
    run_pass(bench)
    assert (bench.r.rollovers, bench.r.angle.flg, bench.r.interpolator.irr) == (1, 0, 2 * T * ONE - 5)


def test_the_conventional_unit_never_rolls_over():
    bench = jogging(1, 20, form=RAW)
    bench.r.interpolator.irr = 5
    run_pass(bench)
    assert bench.r.rollovers == 0


@pytest.mark.parametrize(
    ("update", "halfway"),
    [(0, (-1, 2)), (FLAG_FIRST, (-1, 1)), (REMAINING_FIRST, (0, 2))],
    ids=["at once", "118", "120"],
)
def test_a_rollover_in_halves_ends_the_same(update, halfway):
    bench = jogging(1, 20, update=update)
    bench.r.interpolator.irr = T * ONE - 5
    begin_task(bench.p, bench.r)
    assert (bench.r.angle.turn, round(bench.r.interpolator.irr / T / ONE)) == halfway
    end_task(bench.p, bench.r)
    assert (bench.r.angle.turn, bench.r.interpolator.irr, bench.r.unfinished) == (-1, 2 * T * ONE - 5, 0)
    run_pass(bench)
    assert bench.r.rollovers == 1


def ready(angle: int, policy: int = 0, *, place: int = PLACE, **changes) -> PositionerBench:
    """A bench with one position, its start given."""
    bench = PositionerBench(place, **changes)
    pdt = bench.p.pdt
    pdt.entries, pdt.angle[0], pdt.speed[0], pdt.policy[0] = 1, angle, speed_word(30), policy
    bench.r.start = 1
    return bench


def test_a_positioning_arrives_when_it_has_been_in_its_window():
    bench = ready(PLACE + 500)
    run_pass(bench)
    assert (bench.r.state, bench.r.oar, bench.r.z, bench.r.start) == (MOVE, PLACE + 500, 1, 0)
    while bench.r.interpolator.irr > 0:
        bench.feed(round(bench.command))
        assert bench.r.interpolator.speed <= speed_word(30)
    for off in (0, 2, -2, 3, 0, 1, 2, 0, -1, -2, 0, 1, 1):
        bench.feed(PLACE + 500 + off)
        assert (bench.r.state, bench.r.event) == (MOVE, 0)
    bench.feed(PLACE + 500)
    assert (bench.r.state, bench.r.event) == (HOLD, 1)


@pytest.mark.parametrize(("form", "target"), [(TURN_COUNTER, T + 1000), (FLAG, 1000), (RAW, 1000)])
def test_only_the_turn_counter_goes_the_shortest_way(form, target):
    bench = ready(1000, place=T - 1000, form=form)
    run_pass(bench)
    assert (bench.r.oar, bench.r.z) == (target, 1 if form == TURN_COUNTER else -1)


@pytest.mark.parametrize(("start", "target", "end"), [(T - 100, 50, 1), (50, T - 100, -1), (T - 5, 0, 0)])
def test_after_arrival_the_target_is_within_the_turn_and_the_angle_with_it(start, target, end):
    bench = ready(target, place=start)
    run_pass(bench)
    way = bench.r.oar - start
    while bench.r.state == MOVE:
        bench.feed(round(bench.command) - (end == 0))  # the last stands a count before the boundary
    assert (bench.r.oar, bench.r.angle.aar - bench.r.oar) == (target, -1 if end == 0 else 0)
    assert bench.r.angle.position == start + way - (end == 0)
    bench.feed(target + 3)
    assert bench.r.arr == -3 * bench.r.z


@pytest.mark.parametrize("state", [JOG, STOPPING, MOVE])
def test_a_start_while_busy_is_refused(state):
    bench = ready(PLACE + 5000)
    bench.r.state = state
    bench.r.plus = 1
    run_pass(bench)
    assert (bench.r.state, bench.r.start, bench.r.refused, bench.r.reason) == (state, 0, 1, BUSY)


def test_a_button_goes_before_a_start():
    bench = ready(PLACE + 5000)
    bench.r.plus = 1
    run_pass(bench)
    assert (bench.r.state, bench.r.reason) == (JOG, BUSY)


def test_an_unknown_number_and_a_way_too_long_are_refused():
    bench = ready(5)
    bench.r.number = 1
    run_pass(bench)
    assert (bench.r.state, bench.r.reason) == (HOLD, NO_SUCH_POSITION)
    bench = ready(PLACE + (1 << 31), AS_COMMANDED)
    run_pass(bench)
    assert (bench.r.state, bench.r.reason, bench.r.oar) == (HOLD, TOO_FAR, PLACE)
    bench = ready(PLACE - (1 << 31) + 1, AS_COMMANDED)
    run_pass(bench)
    assert (bench.r.state, bench.r.z, bench.r.interpolator.irr) == (MOVE, -1, ((1 << 31) - 1) << 16)


def test_open_loop_sends_the_speed_itself():
    bench = jogging(-1, 200, open_loop=1)
    assert bench.r.s4 == -round(60 / (180 / 32767))


def test_unsigned_remaining_drives_away():
    bench = PositionerBench(PLACE, unsigned_remaining=1)
    bench.feed(PLACE + 3)
    assert (bench.r.arr, bench.r.s4 > 0) == (3, True)


def test_a_dial_below_zero_does_not_move():
    bench = PositionerBench(PLACE)
    bench.r.dial, bench.r.plus = -5, 1
    run_pass(bench)
    bench.feed(PLACE)
    assert bench.r.interpolator.irr == 2 * T * ONE


# -- the interpolator

INTERPOLATOR = InterpolatorParams(fraction=16, acceleration=80531, max_speed=1000 * ONE)


def speeds_of(r: Interpolator, limit: int, interrupts: int) -> list[int]:
    speeds = []
    for _ in range(interrupts):
        interpolate(INTERPOLATOR, r, limit)
        speeds.append(r.speed)
    return speeds


def test_it_accelerates_runs_and_stops():
    r, limit = Interpolator(irr=100_000 * ONE), 122 * ONE
    speeds = speeds_of(r, limit, 3000)
    rise = math.ceil(limit / INTERPOLATOR.acceleration)
    assert speeds[: rise - 1] == [INTERPOLATOR.acceleration * (n + 1) for n in range(rise - 1)]
    assert max(speeds) == limit
    assert (r.irr, r.speed) == (0, 0)
    assert sum(speed > 0 for speed in speeds) * limit == pytest.approx(100_000 * ONE + rise * limit, rel=0.01)
    # v = sqrt(2 a IR) is taken at the beginning of an interrupt: it brakes by a, and a little more near the end.
    falls = [before - after for before, after in itertools.pairwise(speeds) if after < before]
    assert max(falls[:-5]) < 1.2 * INTERPOLATOR.acceleration
    # The last interrupt ends on IR <= 2 a; the one before came from v^2 = 2 a (2 a + v) at most, v = (1 + sqrt 5) a.
    assert max(falls) <= (1 + math.sqrt(5)) * INTERPOLATOR.acceleration


@pytest.mark.parametrize("irr", [1, 7, ONE, 5 * ONE, 12_345_678])
def test_the_whole_way_is_used_up(irr):
    r = Interpolator(irr=irr)
    speeds_of(r, 122 * ONE, 1000)
    assert (r.irr, r.speed) == (0, 0)


def test_a_dial_turned_down_slows_down_no_faster_than_the_acceleration():
    r = Interpolator(irr=700_000 * ONE, speed=122 * ONE)
    speeds = speeds_of(r, 10 * ONE, 100)
    assert speeds[0] == 122 * ONE - INTERPOLATOR.acceleration
    assert speeds[-1] == 10 * ONE


def test_no_dial_exceeds_the_largest_speed():
    r = Interpolator(irr=700_000 * ONE)
    assert max(speeds_of(r, 5000 * ONE, 1200)) <= 1000 * ONE


def test_at_the_end_nothing_moves():
    r = Interpolator()
    assert speeds_of(r, 122 * ONE, 3) == [0, 0, 0]


def test_braking_path():
    r = Interpolator(speed=122 * ONE)
    path = braking_path(INTERPOLATOR, r)
    assert path == (122 * ONE) ** 2 // (2 * INTERPOLATOR.acceleration)
    r.irr = path
    start = r.speed
    interrupts = 0
    while r.irr > 0:
        interpolate(INTERPOLATOR, r, r.speed)
        interrupts += 1
    assert interrupts == pytest.approx(start / INTERPOLATOR.acceleration, rel=0.05)


@pytest.mark.parametrize("speed", [10.25, 30.5, 122.88])  # counts an interrupt
def test_braking_begins_when_the_way_is_needed_and_not_before(speed):
    word = round(speed * ONE)
    r, left = Interpolator(irr=100_000 * ONE, speed=word), 0
    while r.speed == word:
        left = r.irr
        interpolate(INTERPOLATOR, r, word)
    # It finds less than v^2 / 2a left, by the way of an interrupt at most.
    assert 0 < word**2 / (2 * INTERPOLATOR.acceleration) - left <= word


@pytest.mark.parametrize("dial", [0, 1, 60])
def test_a_stop_has_nothing_to_do_with_the_dial(dial):
    """Turned down with the release, it would hold up what is left of the way."""
    bench = jogging(1, 500)
    bench.r.plus, bench.r.dial = 0, speed_word(dial)
    run_pass(bench)
    interrupts = 0
    while bench.r.state == STOPPING and interrupts < 200:
        bench.feed(round(bench.command))
        interrupts += 1
    assert interrupts == pytest.approx(speed_word(60) / bench.p.interpolator.acceleration, abs=3)  # v / a
    assert (bench.r.state, bench.r.event) == (HOLD, 1)


# -- ways to an angle


@pytest.mark.parametrize(
    ("policy", "target", "present", "way"),
    [
        (SHORTEST, 100, 3500, 200),
        (SHORTEST, 3500, 100, -200),
        (SHORTEST, 5, 5, 0),
        (SHORTEST, 1800, 0, -1800),  # half a turn goes negative
        (SHORTEST, 0, 1800, -1800),
        (SHORTEST, 1799, 0, 1799),
        (SHORTEST, 10, -1, 11),  # from just below the boundary
        (POSITIVE, 100, 3500, 200),
        (POSITIVE, 3500, 100, 3400),
        (POSITIVE, 1800, 0, 1800),
        (POSITIVE, 5, 5, 0),
        (POSITIVE, 5, 7, -2),  # within the tolerance: back
        (POSITIVE, 5, 8, 3597),
        (NEGATIVE, 3500, 100, -200),
        (NEGATIVE, 100, 3500, -3400),
        (NEGATIVE, 1800, 0, -1800),
        (NEGATIVE, 7, 5, 2),
        (NEGATIVE, 8, 5, -3597),
        (NEGATIVE, 1, 3599, 2),
        (AS_COMMANDED, 100, 3500, -3400),
        (AS_COMMANDED, 3500, 100, 3400),
        (AS_COMMANDED, 5400, 100, 5300),
        (AS_COMMANDED, -100, 100, -200),
    ],
)
def test_way(policy, target, present, way):
    assert way_to(TURN, 2, policy, target, present) == way


def test_every_way_but_as_commanded_ends_at_the_target():
    for policy in (SHORTEST, POSITIVE, NEGATIVE):
        for target in range(0, TURN, 101):
            for present in range(-TURN, 2 * TURN, 97):
                way = way_to(TURN, 2, policy, target, present)
                assert (present + way - target) % TURN == 0
                assert abs(way) <= (TURN // 2 if policy == SHORTEST else TURN)
                assert policy == SHORTEST or abs(way) <= 2 or (way > 0) == (policy == POSITIVE)


# -- the angle beyond a turn


def angle_at(d: int) -> EndlessAngle:
    r = EndlessAngle(turn=5, flg=1, position=77)
    first_angle(r, d)
    return r


def test_the_first_angle_is_present_and_record():
    r = angle_at(321)
    assert (r.dar, r.d_prev, r.aar, r.position, r.flg, r.turn, r.crossings) == (321, 321, 321, 321, 0, 0, 0)


@pytest.mark.parametrize(
    ("before", "now", "turn"),
    [(990, 10, 1), (10, 990, -1), (0, 500, 0), (500, 0, 0), (0, 501, -1), (501, 0, 1), (999, 0, 1), (0, 999, -1)],
)
def test_a_change_of_more_than_half_a_period_is_a_crossing(before, now, turn):
    r = angle_at(before)
    read_angle(EndlessAngleParams(period=PERIOD), r, now, True)
    assert (r.turn, r.crossings, r.flg) == (turn, abs(turn), abs(turn))
    assert (r.dar, r.d_prev) == (now, now)
    assert r.position == now + turn * PERIOD


@pytest.mark.parametrize("manual", [True, False])
def test_the_flag_is_set_in_manual_feed_only(manual):
    r = angle_at(999)
    read_angle(EndlessAngleParams(period=PERIOD), r, 1, manual)
    assert (r.flg, r.turn) == (manual, 1)


@pytest.mark.parametrize(
    ("form", "turn", "flg", "z", "present"),
    [
        (TURN_COUNTER, 0, 1, 1, 10),
        (TURN_COUNTER, -2, 0, 1, 10 - 2 * PERIOD),
        (FLAG, 3, 0, -1, 10),
        (FLAG, 0, 1, -1, 10 - PERIOD),
        (FLAG, 0, 1, 1, 10 + PERIOD),
        (RAW, 4, 1, 1, 10),
    ],
)
def test_present_angle_of_each_form(form, turn, flg, z, present):
    r = EndlessAngle(dar=10, turn=turn, flg=flg)
    extend(EndlessAngleParams(period=PERIOD, form=form), r, z)
    assert r.aar == present


def test_start_and_shift():
    r = EndlessAngle(dar=10, turn=2, flg=1, aar=2010)
    shift_back(r, 1)
    assert (r.flg, r.turn) == (0, 1)
    shift_back(r, -1)
    assert r.turn == 2
    r.flg = 1
    start_raw(r)
    assert (r.flg, r.turn, r.aar) == (0, 0, 10)
