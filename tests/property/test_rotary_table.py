"""The rotary table for every start, every number of turns, every sequence of buttons, starts and noise."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.property.numbered_cases import asked_numbers, run_numbers
from tests.property.table_cases import DELAY_TICKS, STROBE_TICKS, TableCase, run_table
from tests.rotary_table_rig import COUNT, FINE, KP, ONE, RATIO, PositionerBench, Rig, T

from detent.control.table_positioner import (
    AS_COMMANDED,
    FLAG,
    FLAG_FIRST,
    HOLD,
    NEGATIVE,
    POSITIVE,
    RAW,
    REMAINING_FIRST,
    SHORTEST,
    EndlessAngle,
    EndlessAngleParams,
    Positioner,
    PositionerParams,
    begin_task,
    end_task,
    extend,
    first_angle,
    interrupt,
    read_angle,
)
from detent.kernel.noise import NoiseSource, uniform
from detent.kernel.step import step
from detent.sensing.resolver_counter import AbsoluteAngle, CompositionParams, compose

FASTEST = T // 2
"""Counts per interrupt that can still be told from a crossing."""


@step
def turn_evenly(p: EndlessAngleParams, r: EndlessAngle, start: int, rate: int, interrupts: int) -> int:
    """Feed an even rotation from `start` counts on; returns interrupts after which an angle was not exact."""
    first_angle(r, start % p.period)
    r.position, r.turn = start, start // p.period
    wrong = 0
    for n in range(1, interrupts + 1):
        place = start + n * rate
        read_angle(p, r, place % p.period, False)
        extend(p, r, 1)
        wrong += r.position != place or r.aar != place
    return wrong


@step
def turn_at_random(p: EndlessAngleParams, r: EndlessAngle, noise: NoiseSource, drift: float, interrupts: int) -> int:
    """Feed changes of up to half a period; returns interrupts after which an angle or the crossings were not exact."""
    first_angle(r, 0)
    place = crossings = wrong = 0
    half = (p.period - 1) // 2
    for _ in range(interrupts):
        change = min(max(math.floor((2.0 * uniform(noise) - 1.0 + drift) * p.period / 2), -half), half)
        crossings += abs((place + change) // p.period - place // p.period)
        place += change
        read_angle(p, r, place % p.period, False)
        extend(p, r, 1)
        wrong += r.position != place or r.aar != place or r.crossings != crossings
    return wrong


@step
def every_change(p: EndlessAngleParams, r: EndlessAngle, turn: int) -> int:
    """Feed every change that is less than half a period, from every angle; returns how many were not exact."""
    wrong = 0
    for d in range(p.period):
        for change in range(-((p.period - 1) // 2), (p.period + 1) // 2):
            first_angle(r, d)
            place = turn * p.period + d
            r.position, r.turn, r.crossings = place, turn, 0
            place += change
            read_angle(p, r, place % p.period, False)
            extend(p, r, 1)
            crossed = place // p.period != turn
            wrong += r.position != place or r.aar != place or r.crossings != crossed
    return wrong


@step
def jog_by_hand(p: PositionerParams, r: Positioner, lag: int, base: int, interrupts: int) -> int:
    """Jog a table that is `lag` counts behind C, its record from `base` on; returns interrupts that were not exact."""
    begin_task(p, r)
    end_task(p, r)
    f, home = p.interpolator.fraction, r.angle.dar
    r.angle.position = base + home
    way = wrong = 0
    for n in range(1, interrupts + 1):
        counts, left = way >> f, r.interpolator.irr
        place = home + r.z * (counts - lag)
        interrupt(p, r, place % p.angle.period)
        way += left - r.interpolator.irr
        wrong += r.angle.position != base + place or r.dr != way - ((counts - lag) << f) or abs(r.angle.turn) > 2
        if n % 10 == 0:
            begin_task(p, r)
            end_task(p, r)
    return wrong


@settings(max_examples=50)
@given(start=st.integers(0, T - 1), rate=st.integers(-FASTEST, FASTEST), interrupts=st.integers(1, 300))
def test_the_record_is_exact_at_any_rate(start, rate, interrupts):
    p, r = EndlessAngleParams(period=T), EndlessAngle()
    if 2 * abs(rate) == T:  # half a period is no crossing: a change of exactly that has no direction
        rate -= 1 if rate > 0 else -1
    assert turn_evenly(p, r, start, rate, interrupts) == 0
    assert r.crossings == abs((start + interrupts * rate) // T)


@pytest.mark.compiled
@pytest.mark.parametrize("rate", [FASTEST - 1, 1 - FASTEST, 123_457, -99_991])
def test_millions_of_turns(rate):
    p, r = EndlessAngleParams(period=T), EndlessAngle()
    interrupts = 6_000_000
    assert turn_evenly(p, r, 777, rate, interrupts) == 0
    assert abs(r.position) > 1_000_000 * T
    assert r.position == 777 + interrupts * rate


@pytest.mark.compiled
@pytest.mark.parametrize("rate", [FASTEST - 1, 1 - FASTEST, 123_457, -99_991])
def test_the_last_million_turns_before_2_62_counts(rate):
    p, r = EndlessAngleParams(period=T), EndlessAngle()
    interrupts, end = 6_000_000, 2**62 if rate > 0 else -(2**62)
    assert turn_evenly(p, r, end - interrupts * rate, rate, interrupts) == 0
    assert r.position == end
    assert r.crossings == abs(end // T - (end - interrupts * rate) // T) > 1_000_000


@pytest.mark.compiled
@pytest.mark.parametrize("drift", [0.0, 0.6, -0.6])
def test_millions_of_turns_to_and_fro(drift):
    p, r, noise = EndlessAngleParams(period=T), EndlessAngle(), NoiseSource(state=11)
    assert turn_at_random(p, r, noise, drift, 6_000_000) == 0
    assert r.crossings > 1_000_000
    assert abs(r.position) > (1_000_000 * T if drift else T)


@pytest.mark.compiled
@pytest.mark.parametrize("period", [2, 3, 64, 1001])
def test_every_wrap(period):
    p, r = EndlessAngleParams(period=period), EndlessAngle()
    for turn in (0, 1, -1, 2**62 // period - 1, -(2**62 // period)):
        assert every_change(p, r, turn) == 0


@pytest.mark.compiled
@pytest.mark.parametrize("lag", [0, 2047, -5])
@pytest.mark.parametrize("z", [1, -1])
def test_a_jog_over_a_million_turns_that_ends_2_62_counts_from_home(z, lag):
    bench = PositionerBench(T // 3)
    p, r = bench.p, bench.r
    speed, interrupts = T // 25, 25_100_000
    p.interpolator.max_speed = r.dial = speed << p.interpolator.fraction
    p.interpolator.acceleration = speed << p.interpolator.fraction
    r.plus, r.minus = z > 0, z < 0
    assert jog_by_hand(p, r, lag, z * (2**62 - speed * interrupts), interrupts) == 0
    assert abs(2**62 - z * r.angle.position) < T
    assert r.rollovers > 1_000_000
    assert r.angle.crossings > 1_000_000


@pytest.mark.compiled
@pytest.mark.parametrize("turns", [1, -1, 10**6, 2**62 // T - 10, -(2**62) // T + 10])
def test_nothing_depends_on_how_many_turns_the_table_has_made(turns):
    def jogged(turns):
        rig = Rig(359.0, noise=2.0, seed=5)
        rig.r.plant.train.motor.turns += turns * RATIO
        rig.angle.position += turns * T
        rig.r.controller.watched += turns * T
        rig.press(1).run_until(2.0).release().run_until(2.5).press(-1).run_until(6.0)
        return rig

    there, here = jogged(turns), jogged(0)
    assert there.angle.position - here.angle.position == turns * T
    assert there.angle.crossings == here.angle.crossings >= 2
    there.angle.position = here.angle.position
    there.r.controller.watched -= turns * T
    there.r.plant.train.motor.turns -= turns * RATIO
    assert bytes(there.r) == bytes(here.r)


@given(
    turns=st.integers(-(2**62) // T, 2**62 // T - 1),
    place=st.integers(0, T - 1),
    changes=st.lists(st.integers(1 - FASTEST, FASTEST - 1), min_size=1, max_size=30),
)
def test_the_record_is_exact_2_62_counts_from_home(turns, place, changes):
    p, r = EndlessAngleParams(period=T), EndlessAngle()
    first_angle(r, place)
    wanted = r.position = turns * T + place
    r.turn = turns
    for change in changes:
        wanted += change
        read_angle(p, r, wanted % T, False)
        extend(p, r, 1)
        assert r.position == r.aar == wanted


@given(
    ratio=st.integers(1, 400),
    fine=st.integers(2, 1 << 20),
    coarse=st.integers(2, 1 << 20),
    share=st.floats(0, 1, exclude_max=True),
    error=st.floats(-0.5, 0.5),
)
def test_composition_is_exact_within_half_a_motor_turn(ratio, fine, coarse, share, error):
    p, r = CompositionParams(ratio=ratio, fine=fine, coarse=coarse), AbsoluteAngle()
    period = ratio * fine
    theta = int(share * period)
    # Room for the count by which each word lies behind its angle.
    room = 0.5 - ratio / coarse - 1 / fine
    if room <= 0:
        return
    turns = theta / period + error * 2 * room / ratio
    compose(p, r, theta % fine, int(turns % 1.0 * coarse))
    assert r.theta == theta


@settings(max_examples=60)
@given(
    place=st.integers(0, T - 1),
    plus=st.booleans(),
    lag=st.integers(0, 3000),
    speed=st.integers(1, 270 * ONE),
    irr=st.integers(1, 2 * T * ONE),
)
def test_a_rollover_and_a_stop_never_move_command_against_measurement(place, plus, lag, speed, irr):
    bench = PositionerBench(place)
    r, z = bench.r, 1 if plus else -1
    r.plus, r.minus = plus, not plus
    begin_task(bench.p, r)
    r.interpolator.irr = irr
    r.interpolator.speed = min(speed, int((2 * bench.p.interpolator.acceleration * irr) ** 0.5))
    bench.p.interpolator.max_speed = 0
    bench.feed(round(bench.command) - z * lag)
    before = r.dr
    r.plus = r.minus = 0 if irr % 2 else 1
    begin_task(bench.p, r)
    end_task(bench.p, r)
    extend(bench.p.angle, r.angle, z)
    left = z * (r.oar - r.angle.aar)
    assert (left << 16) - r.interpolator.irr == before


@dataclass(frozen=True)
class Act:
    """A button held for a time, or a positioning; then a time without."""

    kind: int
    speed: float
    target: float
    hold: float
    pause: float


ACTS = st.lists(
    st.builds(
        Act,
        kind=st.sampled_from(("+", "-", SHORTEST, POSITIVE, NEGATIVE, AS_COMMANDED)),
        speed=st.floats(0.1, 60),
        target=st.floats(0, 359.99),
        hold=st.floats(0.0, 9.0),
        pause=st.floats(0.0, 1.0),
    ),
    min_size=1,
    max_size=5,
)
NAMES = [
    "controller.positioner.dr",
    "controller.positioner.angle.position",
    "controller.positioner.angle.dar",
    "controller.positioner.state",
    "plant.train.motor.velocity",
    "controller.positioner.s4",
]


def perform(rig: Rig, act: Act) -> dict[str, np.ndarray]:
    """One act, its records at every interrupt."""
    if isinstance(act.kind, str):
        rig.press(1 if act.kind == "+" else -1, act.speed)
    else:
        rig.entry(0, act.target, act.speed, act.kind).go(0)
    held = rig.record(rig.time + act.hold, NAMES)
    rig.release()
    after = rig.record(rig.time + act.pause, NAMES)
    return {name: np.concatenate([held[name], after[name]]) for name in NAMES}


@pytest.mark.compiled
@settings(max_examples=60)
@given(
    place=st.one_of(st.integers(0, T - 1), st.integers(-4, 4).map(lambda n: n % T)),
    acts=ACTS,
    noise=st.sampled_from((0.0, 0.0, 1.0, 3.0)),
    seed=st.integers(0, 2**62),
    task_at=st.integers(0, 19),
)
def test_the_table_never_jumps(place, acts, noise, seed, task_at):
    rig = Rig(place * COUNT, noise=noise, seed=seed, task_at=task_at)
    # Behind a speed v it lags by v / Kp, 3.5 % more at the end of the acceleration; noise of n counts moves D by up to
    # n and the table by less.
    lag = 60 / KP * 1.04 + (2 * noise + 2) * COUNT
    for act in acts:
        seen = perform(rig, act)
        assert np.abs(seen["controller.positioner.dr"]).max(initial=0) / ONE * COUNT <= lag
        steps = np.diff(seen["controller.positioner.angle.position"])
        assert np.abs(steps).max(initial=0) * COUNT <= 63 * 2e-3 + (2 * noise + 1) * COUNT
        speed = np.degrees(seen["plant.train.motor.velocity"]) / RATIO
        assert np.abs(speed).max(initial=0) <= 63
        assert (seen["controller.positioner.angle.position"] % T == seen["controller.positioner.angle.dar"]).all()
    rig.run_until(rig.time + 12)  # the longest distance at 60 deg/s, and to rest
    if rig.positioner.state == HOLD:
        assert abs(rig.present - rig.target) <= (2 * noise + 2) * COUNT
        assert 0 <= rig.positioner.oar < T
    else:
        assert noise > 0 or min(act.speed for act in acts) < 60


@pytest.mark.compiled
@settings(max_examples=25)
@given(
    velocity=st.floats(-2e4, 2e4),
    oar=st.integers(-(10**9), 10**9),
    irr=st.integers(0, 2**47),
    word=st.integers(-32767, 32767),
    state=st.integers(0, 4),
    z=st.sampled_from((1, -1)),
    task_at=st.integers(0, 19),
)
def test_from_any_state_no_tick_exceeds_the_limits(velocity, oar, irr, word, state, z, task_at):
    rig = Rig(123.4, task_at=task_at)
    r = rig.positioner
    rig.r.plant.train.motor.velocity = velocity
    rig.r.lines.word = word
    r.oar, r.state, r.z, r.plus = oar, state, z, 1
    rig.interpolator.irr = irr
    fastest = max(abs(velocity), 32767 * rig.p.plant.amplifier.speed_per_count)
    for _ in range(20):
        rig.run_ticks(37)
        assert abs(r.s4) <= 32767
        assert abs(rig.r.plant.train.motor.velocity) <= fastest * (1 + 1e-12)
        assert 0 <= rig.interpolator.irr <= irr + 2 * T * ONE
        assert 0 <= rig.angle.dar < T
        assert 0 <= rig.r.plant.train.motor.angle < 6.283185307179587
        assert rig.r.lines.fine < FINE


# ------------------------------------------------------------------------------------------------------ numbered cases


@pytest.mark.wide
@pytest.mark.compiled
def test_two_thousand_numbered_tables():
    met = run_numbers(run_table, range(2000))
    assert met["crossings"] > 2000
    assert min(met["rollovers"], met["jogs"], met["moves"]) > 300


@pytest.mark.long
def test_as_many_numbered_tables_as_asked_for():
    numbers = asked_numbers()
    assert run_numbers(run_table, numbers)["cases"] == len(numbers) > 0


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("form", "least"),
    [({"form": FLAG}, 20), ({"form": RAW}, 100), ({"update": FLAG_FIRST}, 20), ({"update": REMAINING_FIRST}, 20)],
)
def test_the_judge_sees_the_jumps_of_what_is_not_robust(form, least):
    jumps = 0
    for number in range(300):
        case = TableCase(number, **form)
        if "update" in form:  # an interrupt in the middle of every pass
            case.rig.r.controller.clocks.task += DELAY_TICKS - case.rig.r.controller.clocks.task % STROBE_TICKS
            case.late = False
        try:
            case.run()
            case.judge()
        except AssertionError as error:
            jumps += "jumps" in str(error) or "dR" in str(error)
    assert jumps >= least
