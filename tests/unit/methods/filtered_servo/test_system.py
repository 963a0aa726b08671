"""The filtered servo as a whole: reset, fault, the order within a tick, in position, retuning, noise."""

import numpy as np
import pytest
from tests.filtered_servo_rig import NO_TRACE, PLANT_B, PULSE, START, Rig, plant_a

from detent.control.deviation_counter import DEVIATION_RANGE, FAULT, RESET, RUN, SPEED_RANGE
from detent.kernel.loop import advance
from detent.methods.filtered_servo.controller import CLOCKS, reset
from detent.methods.filtered_servo.system import TICK, FilteredServo, switch_on

RAMP = "method.command_acceleration=1 m/s^2"


def at_rest(rig):
    """What the logic holds when nothing has happened since reset."""
    d = rig.c.deviation
    return (d.deviation, d.error, rig.lines.word, rig.c.speed.count, rig.c.speed.word, rig.c.filter.output) == (0,) * 6


# --------------------------------------------------------------------------------------------------------------- reset


@pytest.mark.parametrize("quarter", range(4))
@pytest.mark.parametrize("place", [-0.499, 0.0, 0.499])
def test_reset_makes_no_false_pulse_from_any_state_of_the_encoder(quarter, place):
    rig = Rig()
    for flip_flops in range(16):
        rig.r.restore(FilteredServo().snapshot())
        position = START + (quarter + place) * PULSE
        switch_on(rig.p, rig.r, position, 5000, 1)
        # Whatever the flip-flops come up with:
        decoder = rig.c.decoder
        decoder.a1, decoder.a2, decoder.b1, decoder.b2 = (flip_flops >> k & 1 for k in range(4))
        decoder.forward = flip_flops & 1
        assert (rig.c.deviation.state, rig.c.deviation.reset) == (RESET, 1)
        rig.run_ticks(600)
        assert rig.c.deviation.state == RUN
        assert at_rest(rig)
        assert rig.c.deviation.position == 0
        assert (rig.plant.train.position, rig.plant.train.energy) == (position, 0.0)
    edges = (rig.plant.encoder.channel_a, rig.plant.encoder.channel_b)
    assert edges == [(1, 0), (1, 1), (0, 1), (0, 0)][rig.plant.encoder.edge & 3]


def test_reset_makes_no_false_pulse_where_a_mark_of_the_disc_is_missing():
    rig = Rig("encoder.missing_edges=0.5")
    for seed in range(8):
        rig.r.restore(FilteredServo().snapshot())
        switch_on(rig.p, rig.r, START, 5000, seed)
        rig.run_ticks(600)
        assert at_rest(rig)
        assert rig.c.deviation.position == 0


def test_at_power_on_the_first_tick_already_runs():
    rig = Rig()
    assert (rig.r.tick, rig.c.deviation.state, rig.c.deviation.reset) == (1, RUN, 0)
    assert rig.c.clock.left == 5000 - CLOCKS


# ------------------------------------------------------------------------------------------------------ a tick's order


def test_a_command_pulse_reaches_the_motor_in_its_own_tick():
    rig = Rig("drive.pwm_frequency=100 kHz")
    rig.go(1, rate=100_000)  # due in the tenth clock of the first tick
    rig.run_ticks(1)
    assert (rig.c.generator.command, rig.c.deviation.deviation, rig.lines.word) == (1, 1, 1.0)
    assert rig.plant.amplifier.word == 1.0
    assert rig.plant.train.current == rig.spec.drive.current_per_count
    assert rig.plant.train.velocity == pytest.approx(4000 * TICK * PULSE, rel=1e-9)


def test_the_pwm_takes_the_word_over_once_in_its_period():
    rig = Rig()
    rig.run_ticks(-rig.r.tick % 5)
    beginning = (rig.plant.amplifier.left - 1) % 5
    rig.lines.word = 7.0
    taken = []
    for _ in range(12):
        rig.run_ticks(1)
        taken.append(rig.plant.amplifier.word)
        rig.lines.word = taken[-1] + 7.0
    assert [k for k in range(1, 12) if taken[k] != taken[k - 1]] == [k for k in range(1, 12) if k % 5 == beginning]


def test_an_edge_reaches_the_counters_two_clocks_after_the_slide():
    """Into the first flip-flop in the clock of the edge, counted in the next one."""
    rig = Rig()
    x = rig.plant.train.position
    rig.plant.train.position = rig.plant.sampled = rig.plant.encoder.next_right - 0.45 * PULSE
    rig.plant.train.velocity = PULSE / TICK  # 45 % of the way: the edge is passed in the fifth clock
    rig.run_ticks(1)  # the plant moves
    assert rig.plant.train.position - rig.plant.sampled == pytest.approx(PULSE, rel=1e-6)
    assert rig.c.deviation.position == 0
    rig.run_ticks(1)  # the logic sees it
    assert (rig.c.deviation.position, rig.c.deviation.deviation, rig.c.speed.count) == (1, -1, 1)
    assert rig.plant.train.position > x


def test_an_edge_in_the_last_clock_is_counted_in_the_next_tick():
    rig = Rig()
    rig.plant.train.position = rig.plant.encoder.next_right
    rig.run_ticks(1)
    assert (rig.c.busy, rig.c.decoder.a1, rig.c.decoder.forward, rig.c.deviation.position) == (1, 1, 1, 0)
    rig.run_ticks(1)
    assert (rig.c.busy, rig.c.decoder.forward, rig.c.deviation.position) == (0, 0, 1)


@pytest.mark.parametrize("motion", [1, -1])
def test_edges_a_clock_apart_are_all_counted(motion):
    rig = Rig("method.position_bits=16", "method.counter_bits=12")
    rig.plant.train.velocity = motion * 9.9e5 * PULSE  # just below an edge per clock
    rig.p.plant.amplifier.per_count = 0.0
    before = rig.plant.encoder.edge
    rig.run_ticks(100)
    assert rig.plant.encoder.edge - before == pytest.approx(motion * 990, abs=15)
    rig.plant.train.velocity = 0.0
    rig.run_ticks(2)
    assert rig.c.deviation.position == rig.plant.encoder.edge - before
    assert rig.c.deviation.deviation == -rig.c.deviation.position


def test_the_strobe_comes_before_the_pulse_of_its_clock():
    rig = Rig("method.filter=none")
    rig.plant.train.position = (
        rig.plant.encoder.next_right
    )  # in the last clock of the tick; counted in the first of the next
    rig.run_ticks(1)
    rig.c.clock.left = 1
    rig.run_ticks(1)
    assert (rig.c.speed.word, rig.c.speed.count, rig.c.filter.output) == (0, 1, 0.0)
    rig.c.clock.left = 1
    rig.run_ticks(1)
    assert (rig.c.speed.word, rig.c.speed.count, rig.c.filter.output) == (1, 0, 4.0)


@pytest.mark.compiled
def test_a_push_is_held_by_the_following_error_it_causes():
    force = 3 * Rig().spec.force_per_count
    rig = Rig(
        f"disturbance.push.force={force!r} N", "disturbance.push.at=0.1 s", "disturbance.push.duration=2 s",
        "mechanics.friction.right.viscous=3000 kg/s", "mechanics.friction.left.viscous=3000 kg/s",
    )  # fmt: skip
    rig.run(0.1)
    assert rig.c.deviation.deviation == 0
    rig.run(1.5)
    held = rig.record(0.5, ["controller.deviation.deviation"])["controller.deviation.deviation"]
    assert held.mean() == pytest.approx(-3, abs=0.1)
    rig.run(1.0)
    assert abs(rig.c.deviation.deviation) <= 1
    assert rig.plant.train.force == 0.0


# --------------------------------------------------------------------------------------------------------- in position


AT_EASE = (RAMP, "method.in_position=30", "method.in_position_time=20 ms")


@pytest.mark.compiled
def test_the_axis_says_so_when_it_has_been_in_position_for_its_time():
    rig = Rig(*AT_EASE)
    rig.go(400)
    assert advance(rig.p, rig.r, 10**6, *NO_TRACE) < 10**6
    r = rig.r
    assert (r.controller.event, r.controller.failed, r.controller.deviation.state) == (1, 0, RUN)
    assert (r.controller.generator.command, r.controller.away) == (400, 0)
    assert abs(r.controller.deviation.deviation) <= rig.p.controller.window
    twin = Rig(*AT_EASE)
    twin.go(400)
    run = twin.record((r.tick - 1) * TICK, ["controller.away", "tick"])
    assert r.tick - 1 - run["tick"][run["controller.away"] == 1][-1] == rig.p.controller.window_ticks == 2000
    assert r.controller.settling == 0
    assert advance(rig.p, r, 100, *NO_TRACE) == 0, "the loop waits for its host"
    r.controller.event = 0
    rig.run_ticks(10)
    assert advance(rig.p, r, 50_000, *NO_TRACE) == 50_000, "it says so once"


@pytest.mark.compiled
@pytest.mark.parametrize("window", [0, 2, 30])
def test_what_counts_as_in_position_is_the_window_and_the_end_of_the_command(window):
    rig = Rig(RAMP, f"method.in_position={window}", "method.in_position_time=1 ms")
    rig.go(400)
    run = rig.record(
        0.6,
        [
            "controller.generator.command",
            "controller.deviation.deviation",
            "controller.away",
            "controller.event",
            "tick",
        ],
    )
    away = (run["controller.generator.command"] != 400) | (np.abs(run["controller.deviation.deviation"]) > window)
    first = np.flatnonzero(run["controller.away"])[0]
    assert first <= 10_000 / 20  # at the latest with the first command pulse
    assert np.array_equal(away[first:], run["controller.away"][first:] == 1)
    back = np.flatnonzero(np.diff(away.astype(int)) == -1) + 1
    assert not away[-1]
    # It may come and go: only the last time counts, and then it says so once.
    said = run["tick"][run["controller.event"] == 1]
    assert said[-1] == run["tick"][back[-1]] + rig.p.controller.window_ticks


# --------------------------------------------------------------------------------------------------------------- fault


def overrun(rig):
    """A command that no slide can follow."""
    rig.go(10**6, rate=200_000)
    rig.c.event = 0
    return advance(rig.p, rig.r, 10**5, *NO_TRACE)


def spin(rig):
    """A slide that moves more pulses in a sample than the counter holds, though nobody asks it to."""
    rig.plant.train.velocity = 40_000 * PULSE
    rig.c.event = 0
    return advance(rig.p, rig.r, 10**5, *NO_TRACE)


@pytest.mark.parametrize("plant", [plant_a(), PLANT_B], ids=["current", "voltage"])
@pytest.mark.parametrize(("make", "cause"), [(overrun, DEVIATION_RANGE), (spin, SPEED_RANGE)])
def test_a_fault_drives_to_zero_current_and_says_why(make, cause, plant):
    rig = Rig(plant=plant)
    assert make(rig) < 10**5, "the loop stops for its host"
    r = rig.r
    assert (r.controller.deviation.state, r.controller.deviation.cause, r.controller.event, r.controller.failed) == (
        FAULT,
        cause,
        1,
        1,
    )
    assert (r.lines.word, r.plant.amplifier.word, r.plant.train.current) == (0.0, 0.0, 0.0)
    velocity = r.plant.train.velocity
    r.controller.event = 0
    run = rig.record(0.01, ["lines.word", "plant.amplifier.word", "plant.train.current", "plant.train.velocity"])
    assert not run["lines.word"].any()
    assert not run["plant.amplifier.word"].any()
    assert not run["plant.train.current"].any()
    # Without friction it coasts, with a voltage amplifier too: switched off, it does not brake.
    assert run["plant.train.velocity"] == pytest.approx(np.full(1000, velocity), rel=1e-9)
    assert velocity != 0.0


def test_a_fault_is_told_once():
    rig = Rig()
    overrun(rig)
    rig.c.event = 0
    assert advance(rig.p, rig.r, 1000, *NO_TRACE) == 1000
    assert (rig.c.event, rig.c.deviation.state) == (0, FAULT)


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_range_of_the_position_counter_is_that_of_its_bits(bits, sign):
    rig = Rig(f"method.position_bits={bits}", "limits.speed=25 mm/s")
    rig.p.plant.amplifier.per_count = 0.0  # the slide stands
    most = (1 << (bits - 1)) - 1
    rig.go(sign * most, rate=100_000)
    rig.run_ticks(most + 100)
    assert (rig.c.deviation.deviation, rig.c.deviation.state) == (sign * most, RUN)
    rig.go(sign)
    rig.run_ticks(100)
    assert (rig.c.deviation.state, rig.c.deviation.cause) == (FAULT, DEVIATION_RANGE)


@pytest.mark.compiled
@pytest.mark.parametrize("make", [overrun, spin])
def test_a_reset_by_the_host_leaves_the_fault(make):
    rig = Rig()
    make(rig)
    rig.plant.train.velocity = 0.0  # somebody has stopped the slide
    rig.run_ticks(10)
    assert rig.c.deviation.state == FAULT
    reset(rig.c)
    before = rig.c.deviation.position
    rig.run_ticks(1)
    d, g = rig.c.deviation, rig.c.generator
    assert (d.state, d.reset, rig.c.failed, rig.c.event) == (RUN, 0, 0, 0)
    assert at_rest(rig)
    assert (rig.c.filter.accumulator, rig.c.filter.input, g.present, g.phase) == (0, 0, 0, 0)
    assert g.command == g.goal == d.position == before
    rig.run(0.02)
    assert at_rest(rig)
    rig.go(100, rate=1000)
    rig.run(1.0)
    assert abs(d.position - before - 100) <= 1
    assert (d.state, g.command) == (RUN, before + 100)


def test_a_reset_empties_the_filter_of_fixed_point_too():
    """Its accumulator holds the speed of before in fractions, and would drive the slide away from where it stands."""
    rig = Rig("method.filter=fixed")
    rig.command_rate(1000)
    rig.run(0.1)
    assert rig.c.filter.accumulator > 0
    assert rig.c.filter.output > 0
    rig.c.deviation.state = FAULT
    reset(rig.c)
    rig.run_ticks(1)
    assert (rig.c.deviation.state, rig.c.filter.accumulator, rig.c.filter.output) == (RUN, 0, 0.0)


def test_a_reset_while_the_slide_coasts_counts_on_without_a_false_pulse():
    rig = Rig("method.counter_bits=12")
    overrun(rig)
    rig.p.plant.amplifier.per_count = 0.0
    rig.plant.train.velocity = 3000 * PULSE
    for ticks in (50, 51, 53, 57):
        rig.run_ticks(ticks)
        reset(rig.c)
        rig.run_ticks(1)
        position, edge = rig.c.deviation.position, rig.plant.encoder.edge
        assert rig.c.deviation.state == RUN
        rig.run_ticks(400)
        rig.plant.train.velocity, velocity = 0.0, rig.plant.train.velocity
        rig.run_ticks(2)
        assert rig.c.deviation.position - position == rig.plant.encoder.edge - edge
        assert rig.c.deviation.deviation == -(rig.plant.encoder.edge - edge)
        rig.plant.train.velocity = velocity


# ---------------------------------------------------------------------------------------------- sample clock and lines


def strobes(run):
    """Rows of the ticks with a strobe."""
    return np.flatnonzero(np.diff(run["controller.clock.left"]) > 0) + 1


@pytest.mark.compiled
def test_a_retune_takes_effect_at_the_next_window():
    rig = Rig()
    rig.command_rate(1000)
    rig.run(1.0)
    rig.run_ticks(-rig.r.tick % 500 + 123)
    rig.c.clock.demanded = 2500
    level = rig.c.filter.output
    run = rig.record(
        0.0333,
        ["controller.clock.left", "controller.clock.period", "controller.filter.output", "controller.speed.word"],
    )
    begin = strobes(run)
    assert begin[0] == 500 - 123 - 1  # the running window keeps its length
    assert np.array_equal(np.diff(begin), np.full(len(begin) - 1, 250))
    assert set(run["controller.clock.period"][: begin[0]]) == {5000}
    assert set(run["controller.clock.period"][begin[0] :]) == {2500}
    # y is not rescaled: it leaves its level with the filter.
    assert run["controller.filter.output"][begin[0]] == pytest.approx(level, abs=2)
    assert (
        run["controller.filter.output"][begin[1]]
        == 0.25 * 4 * run["controller.speed.word"][begin[1]] + 0.75 * run["controller.filter.output"][begin[0]]
    )


@pytest.mark.parametrize("period", [100, 1003, 5005, 10_000])
def test_a_period_need_not_be_whole_ticks(period):
    rig = Rig(f"method.sample_period={period} us", "limits.speed=25 mm/s", "method.counter_bits=12")
    run = rig.record(5 * period * 1e-6 + 0.01, ["controller.clock.left", "tick"])
    # The strobe of clock k p falls into the tick that ends with it or after it.
    expected = [-(-k * period // CLOCKS) for k in range(1, 6)]
    assert run["tick"][strobes(run)][:5].tolist() == expected


@pytest.mark.compiled
def test_a_lost_sample_lets_the_window_go_on():
    rig = Rig("disturbance.lines.burst.kind=lose sample", "disturbance.lines.burst.at=1 s", plant=plant_a(1500))
    rig.command_rate(1037)
    rig.run(0.9)
    run = rig.record(
        0.2,
        [
            "controller.clock.left",
            "controller.speed.word",
            "controller.speed.count",
            "controller.filter.output",
            "controller.deviation.position",
        ],
    )
    at = strobes(run)
    lost = [k for k in at if run["controller.speed.count"][k] > 0]
    assert len(lost) == 1
    assert rig.plant.interference.lost == 1
    before, after = run["controller.filter.output"][lost[0] - 1], run["controller.filter.output"][lost[0]]
    assert before == after
    following = at[list(at).index(lost[0]) + 1]
    assert 9 <= run["controller.speed.word"][following] <= 12  # of two windows


@pytest.mark.compiled
def test_pulses_put_in_and_taken_away_shift_the_slide_for_good():
    rig = Rig("disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=0.2 s", "disturbance.lines.burst.count=5")
    rig.go(200, rate=1000)
    rig.run(2.5)
    d = rig.c.deviation
    assert abs(d.deviation) <= 1
    assert rig.plant.interference.inserted == 5
    assert d.position - (rig.plant.encoder.edge - round(START / PULSE)) == 5

    rig = Rig(
        "disturbance.lines.burst.kind=remove", "disturbance.lines.burst.at=0.1 s", "disturbance.lines.burst.count=5"
    )
    rig.go(200, rate=1000)
    rig.run(2.5)
    assert rig.plant.interference.removed == 5
    assert rig.c.deviation.position - (rig.plant.encoder.edge - round(START / PULSE)) == -5


def test_a_sample_inverted_for_a_clock_makes_a_pulse_and_takes_it_back():
    rig = Rig("disturbance.lines.burst.kind=corrupt", "disturbance.lines.burst.ticks=[7]")
    rig.run_ticks(7 - rig.r.tick)
    rig.run_ticks(1)
    assert rig.plant.interference.corrupted == 1
    assert (rig.c.deviation.position, rig.c.speed.count, rig.c.busy) == (0, 0, 0)
    rig.run_ticks(2000)
    assert at_rest(rig)
