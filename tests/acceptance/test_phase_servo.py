"""Phase-servo specification, acceptance tests 1 to 32."""

import math
import random
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.coil_currents import LARGE, coil_currents
from tests.phase_servo_rig import START, ConverterBench, Rig

from detent.control.clocks import ClockChain, SawtoothParams, SawtoothPwm, count_sawtooth, next_period
from detent.control.phase_law import Law, LawParams, drive_word, shape
from detent.control.phase_sequencer import (
    HOLD,
    POSITION_MODE,
    SETTLE_BUSY,
    SETTLE_READY,
    SPEED,
    SPEED_MODE,
    Sequencer,
    count_pulses,
    take_command,
)
from detent.methods.phase_servo.plant import move
from detent.sensing.counted_speed import PulseCounter, PulseCounterParams, add_pulses, close_window
from detent.sensing.interference import INSERT_MINUS, INSERT_PLUS
from detent.sensing.phase_converters import (
    Carrier,
    CarrierParams,
    absolute_error,
    count_absolute,
    count_carrier,
    reset_carrier,
)

N = 64
SAMPLE_TICKS = 2048
INTEGRATE_TICKS = 4096
NEVER = 10**9

# ------------------------------------------------------------------------------------------------ clocks and carrier


def test_01_the_two_clocks_alternate_and_never_overlap():
    r = ClockChain()
    active = []
    for _ in range(1000):
        next_period(r)
        active.append((r.ck1, r.ck2))
    assert [first for first, _ in active].count(1) == 500
    assert [second for _, second in active].count(1) == 500
    assert active == [(1, 0), (0, 1)] * 500


def currents_of_a_cycle(large: float) -> np.ndarray:
    """Currents of both coils at every count of a cycle, shape (N, 2) [supply / R462]."""
    p, r = CarrierParams(mask=N - 1, shift=3), Carrier()
    reset_carrier(r)
    rows = []
    for _ in range(N):
        rows.append(coil_currents(r, large))
        count_carrier(p, r)
    assert r.count == 0
    return np.array(rows)


def fourier(levels: np.ndarray, harmonic: int) -> complex:
    """Coefficient of exp(j n wt) of a staircase that holds each level for one count; 2|c| is the amplitude."""
    edges = np.exp(-2j * np.pi * harmonic * np.arange(N + 1) / N)
    return complex((levels * np.diff(edges)).sum() / (-2j * np.pi * harmonic))


def test_02_pattern_levels_and_fundamentals_of_the_carrier():
    p, r = CarrierParams(mask=N - 1, shift=3), Carrier()
    reset_carrier(r)
    patterns = []
    for _ in range(N):
        patterns.append((r.switches & 1, r.switches >> 1 & 1))
        count_carrier(p, r)
    slots = [(0, 0), (0, 1), (1, 0), (1, 1), (1, 1), (1, 0), (0, 1), (0, 0)]
    assert patterns == [slot for slot in slots for _ in range(N // 8)]

    first, second = currents_of_a_cycle(LARGE).T
    assert first.tolist() == np.repeat([0, 1, 3, 4, 4, 3, 1, 0], N // 8).tolist()
    assert second.tolist() == np.repeat([1, 0, 0, 1, 3, 4, 4, 3], N // 8).tolist()
    assert second.tolist() == np.roll(first, N // 4).tolist()  # a quarter of a cycle later
    assert first.mean() == second.mean() == 2.0

    a, b = fourier(first, 1), fourier(second, 1)
    assert abs(np.angle(-a)) < 1e-12  # -A cos wt
    assert math.degrees(np.angle(b)) == pytest.approx(90.0, abs=1e-9)  # -A sin wt
    assert abs(b) / abs(a) == pytest.approx(1.0, abs=1e-9)
    assert 2 * abs(a) == pytest.approx(2.17, abs=0.005)


def test_02_harmonics_of_the_carrier():
    first = currents_of_a_cycle(LARGE)[:, 0]
    share = {n: 100 * abs(fourier(first, n) / fourier(first, 1)) for n in (3, 5, 7, 9)}
    assert share == pytest.approx({3: 5.7, 5: 3.4, 7: 14.3, 9: 11.1}, abs=0.1)

    # The steps of the staircase, 1, r - 1 and 1 at 45, 90 and 135 degrees, have the third harmonic (1 + sqrt 2 - r) / 3
    # and the fifth (r - 1 - sqrt 2) / 5 against r - 1 + sqrt 2 of the first: both vanish at r = 1 + sqrt 2.
    best = 1 + math.sqrt(2)
    first = currents_of_a_cycle(best)[:, 0]
    assert abs(fourier(first, 3) / fourier(first, 1)) < 1e-6
    assert abs(fourier(first, 5) / fourier(first, 1)) < 1e-6
    # Rounded to the four decimals 2.4142, the ratio leaves what its rounding is worth: 1.6e-6 and 0.96e-6.
    rounded = 2.4142
    first = currents_of_a_cycle(rounded)[:, 0]
    for n in (3, 5):
        residual = (best - rounded) / n / (rounded - 1 + math.sqrt(2))
        assert abs(fourier(first, n) / fourier(first, 1)) == pytest.approx(residual, rel=1e-6)
        assert residual < 2e-6


def test_03_the_square_wave_leads_the_carrier_by_the_place_in_the_pitch():
    leads = []
    places = np.arange(0, N, 0.25)
    for x in places:
        bench = ConverterBench()
        levels = []
        for _ in range(2 * N):
            bench.clock(x)
            levels.append((bench.r.carrier.count, bench.ps))
        wave = [ps for _, ps in sorted(levels[:N])]
        assert [ps for _, ps in sorted(levels[N:])] == wave  # period N
        assert sum(wave) == N // 2  # 50 % duty, in one piece
        rises = [c for c in range(N) if wave[c] and not wave[c - 1]]
        assert len(rises) == 1
        leads.append((N // 2 - rises[0]) % N)  # the drive counter's top bit rises at N / 2
    # Sampled by the clock, a lead of x shows as the whole steps in it: half a step less on average.
    assert (np.abs(np.array(leads) + 0.5 - places) <= 0.5).all()
    assert (np.diff(leads) >= 0).all()


# ----------------------------------------------------------------------------------------------------------- tracker


def test_04_nothing_moves_and_no_pulse_comes():
    rig = Rig(locked=True)
    rig.r.lines.enable = 0
    rig.run_ticks(10**6)
    assert rig.r.controller.converters.carrier.count == 10**6 % N
    assert rig.r.controller.sequencer.last_pulse == 0  # no pulse of either sign
    assert (rig.r.controller.sequencer.distance, rig.r.controller.sequencer.position) == (0, 0)

    bench = ConverterBench()
    assert bench.travel(0.0, 10**6) == 0
    assert bench.lead == 0


@pytest.mark.parametrize(
    ("offset", "last", "spacing"), [(1, 32, 63), (16, 977, 63), (31, 1922, 63), (-1, 32, 65), (-16, 1007, 65)]
)
def test_05_acquisition_takes_one_pulse_per_step_of_offset(offset, last, spacing):
    bench = ConverterBench()
    pulses = bench.pulses(4000, offset)
    ticks = [tick for tick, _ in pulses]
    assert [sign for _, sign in pulses] == [int(math.copysign(1, offset))] * abs(offset)
    assert ticks[0] == 32
    assert ticks[-1] == last
    assert set(np.diff(ticks)) <= {spacing}
    assert bench.lead == offset


@pytest.mark.parametrize("rate", [0.25, 0.5, 0.9, -0.25, -0.5, -0.9, 1.01, -0.98])
def test_06_uniform_motion_is_counted_within_one_step(rate):
    assert ConverterBench().travel(rate, 60_000) == pytest.approx(rate * 60_000 / N, abs=1)


@pytest.mark.parametrize(("rate", "net", "true"), [(1.05, 919, 984), (-1.0, -923, -937)])
def test_06_motion_faster_than_a_pulse_per_turn_of_the_reference_counter_is_lost(rate, net, true):
    bench = ConverterBench()
    assert bench.travel(rate, 60_000) == net
    assert int(bench.place) == true
    behind = abs(bench.place - net)
    net += bench.travel(rate, 60_000)
    assert abs(bench.place - net) > behind + 8  # and falls behind further
    assert abs(net) <= 120_000 / (N - 1 if rate > 0 else N + 1)


def test_06_backward_at_1_02_steps_per_cycle_loses_lock():
    bench = ConverterBench()
    net = bench.travel(-1.02, 60_000)
    assert abs(net) <= 60_000 // (N + 1)
    assert abs(bench.place - net) > N // 2  # a slip of the whole pitch: no lock any more


def gate_rows(bench: ConverterBench, ticks: int, steps: float) -> list[dict[str, int]]:
    """What the tracker shows in each tick: gate, samples of PS and MSB as the gate sees them, pulses, levels."""
    rows = []
    for _ in range(ticks):
        t = bench.r.tracking
        seen = {"s1": t.ps_first & t.ps_second, "s2": 1 - (t.ps_first | t.ps_second)}
        tick, pulse = bench.tick, bench.clock(steps)
        levels = {"ps": bench.ps, "msb": t.reference >> 5, "ps_before": t.ps_second}
        rows.append({"tick": tick, "gate": t.gate, "pulse": pulse} | seen | levels)
    return rows


def test_07_still_both_edges_in_one_tick_make_no_pulse():
    rows = gate_rows(ConverterBench(), 4 * N, 0.0)
    gates = [row for row in rows if row["gate"]]
    assert [row["tick"] for row in gates] == [32, 96, 160, 224]  # one tick long each
    assert all(row["s1"] == row["s2"] == 0 for row in gates)
    assert all(row["pulse"] == 0 for row in rows)
    for row in gates:
        before, edge = rows[row["tick"] - 2], rows[row["tick"] - 1]
        assert (before["ps"], before["msb"], edge["ps"], edge["msb"]) == (0, 0, 1, 1)


@pytest.mark.parametrize(("steps", "sample", "turn"), [(1.0, "s1", N - 1), (-1.0, "s2", N + 1)])
def test_07_a_tick_of_lead_or_lag_makes_one_pulse_and_coincidence(steps, sample, turn):
    bench = ConverterBench()
    gate_rows(bench, 2 * N, 0.0)
    first = bench.tick
    rows = gate_rows(bench, 4 * N, steps)
    gates = [row for row in rows if row["gate"]]
    # The gate opens one tick after the top bit's edge, for one tick; the corrected turn of the counter is one tick
    # shorter or longer, and the correction does not trigger a second gate.
    assert [row["tick"] - first for row in gates] == [32, 32 + turn, 32 + turn + N, 32 + turn + 2 * N]
    assert gates[0][sample] == 1
    assert [row["tick"] for row in rows if row["pulse"]] == [first + 32]  # in the second clock after the gate opened
    assert gates[0]["pulse"] == steps
    ps_edge = next(row["tick"] for row in rows if row["ps"] and not row["ps_before"])
    assert ps_edge == first + 31 - steps  # the top bit's is at 31
    assert all(row["s1"] == row["s2"] == 0 for row in gates[1:])  # coincident from the next cycle on


legs = st.lists(st.tuples(st.floats(-0.95, 0.95), st.integers(1, 40)), min_size=1, max_size=10)
"""Stretches of uniform motion: steps per carrier cycle, half cycles."""


@given(start=st.integers(0, 2**26 - 1), legs=legs)
def test_08_slow_motion_is_counted_to_a_step(start, legs):
    bench = ConverterBench()
    bench.phase = start  # anywhere in the first step: in lock
    net = 0
    for rate, half_cycles in legs:
        for _ in range(half_cycles):
            net += bench.travel(rate, N // 2)
            assert abs(net - math.floor(bench.place)) <= 1
    net += bench.travel(0.0, 2 * N)
    assert net == math.floor(bench.place)  # at rest exact
    assert (net - bench.lead) % N == 0


@given(start=st.integers(0, 2**26 - 1), legs=legs, direction=st.sampled_from((1, -1)))
def test_08_every_pulse_has_the_sign_of_the_motion(start, legs, direction):
    bench = ConverterBench()
    bench.phase = start
    for rate, half_cycles in legs:
        for _ in range(half_cycles):  # at most one pulse each, so each one's sign shows
            assert bench.travel(direction * abs(rate), N // 2) in {0, direction}


def test_09_exact_antiphase_is_a_false_lock_for_ever():
    bench = ConverterBench()
    assert bench.pulses(2 * N, 32) == []
    state = bench.r.tracking.snapshot()
    assert bench.pulses(N, 32) == []
    assert bench.r.tracking.snapshot() == state  # after a cycle without a pulse everything is as before: for ever
    bench.phase = 32 * bench.step
    assert bench.travel(0.0, 10**6) == 0
    assert bench.lead == 0


def test_09_a_step_beyond_antiphase_is_acquired_the_other_way():
    bench = ConverterBench()
    assert [sign for _, sign in bench.pulses(4000, 33)] == [-1] * 31
    assert bench.lead == 33 - N


def test_09_with_the_repair_antiphase_is_acquired_forward():
    bench = ConverterBench(leave_antiphase=True)
    assert [sign for _, sign in bench.pulses(4000, 32)] == [1] * 32
    assert bench.lead == 32
    for offset in range(-31, 32):  # and nothing else changes
        bench = ConverterBench(leave_antiphase=True)
        bench.phase = offset * bench.step
        assert bench.travel(0.0, 4000) == bench.lead == offset


@pytest.mark.parametrize("lag", [0, 15])
def test_10_a_corrupted_sample_costs_a_pair_of_pulses_at_the_edge_and_one_count_of_one_word(lag):
    locked = ConverterBench(lag=lag)
    locked.pulses(18 * N)  # in lock; the next tick has count 1
    rise = N // 2 - 1 + lag
    for k in range(N):
        bench = locked.copy()
        pulses, words = [], []
        for n in range(4 * N):
            sign = bench.clock(0.0, corrupt=n == k)
            if sign:
                pulses.append((n, sign))
            if bench.r.absolute.latched:
                words.append(bench.r.absolute.word)
        if k == rise - 1:
            assert pulses == [(rise + 1, 1), (rise + 1 + 63, -1)]
        elif k == rise:
            assert pulses == [(rise + 1, -1), (rise + 1 + 65, 1)]
        else:
            assert pulses == []
        wrong = [word for word in words if word != 2 * lag]
        assert len(wrong) == 1
        assert abs(wrong[0] - 2 * lag) == 1


# ----------------------------------------------------------------------------------------------------- absolute word


@pytest.mark.parametrize(
    ("lead", "word"), [(0, 0), (-8, 16), (-16, 32), (-24, 48), (-32, 64), (8, 16), (16, 32), (24, 48)]
)
def test_11_the_word_is_twice_the_lag_or_lead_renewed_once_a_cycle(lead, word):
    bench = ConverterBench()
    words, latched = [], []
    for _ in range(6 * N):
        bench.clock(lead)
        words.append(bench.r.absolute.word)
        latched.append(bench.r.absolute.latched)
    assert [n for n in range(6 * N) if latched[n]] == list(range(31, 6 * N, N))  # every 64 ticks
    # The first latch closes half a cycle from power-on; the word stands from the second on.
    assert set(words[31 + N :]) == {word}
    changes = [n for n in range(1, 6 * N) if words[n] != words[n - 1]]
    assert all(latched[n] for n in changes)  # constant in between


def test_11_fractions_of_a_tick_round_up_for_a_lag_and_down_for_a_lead():
    for lag in np.arange(0.0, 32.0, 0.25):
        assert word_of(-lag) == 2 * math.ceil(lag)
        assert word_of(lag) == 2 * math.floor(lag)


def word_of(lead: float) -> int:
    """Absolute word at rest."""
    bench = ConverterBench()
    for _ in range(2 * N):
        bench.clock(lead)
    return bench.r.absolute.word


def latch_then_clear(p, r, ps):
    """The step as it is."""
    count_absolute(p, r, ps)


def clear_then_latch(p, r, ps):
    """The mutant: the gated counter is cleared in front of the step that latches it."""
    if r.free == N // 2 - 1:  # the top bit rises with this clock
        r.gated = 0
    count_absolute(p, r, ps)


def check_words(count):
    """Words of five lags; `count` does the absolute converter's tick."""
    for lag in (0, 8, 16, 24, 32):
        bench = ConverterBench()
        for _ in range(3 * N):
            bench.clock(-lag)  # moves carrier and comparator; its own absolute converter is not looked at
            count(bench.p.absolute, bench.spare, bench.ps)
        assert bench.spare.word == 2 * lag


def test_12_clearing_before_the_latch_reads_zero_and_is_found():
    check_words(latch_then_clear)
    with pytest.raises(AssertionError):
        check_words(clear_then_latch)
    bench = ConverterBench()
    for _ in range(5 * N):
        bench.clock(-24)
        clear_then_latch(bench.p.absolute, bench.spare, bench.ps)
        assert bench.spare.word == 0
    assert bench.r.absolute.word == 48


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_13_sign_and_fold_of_the_error(share):
    error = {d: error_at(d + share) for d in (5, -5, 20, 40)}
    assert error[5] in {-6, -5}
    assert error[-5] in {4, 5}
    assert error[20] < 0
    assert abs(error[20]) < 16  # folded
    assert error[40] > 0  # the wrong pitch


def test_13_the_boundary_between_0_and_minus_1_is_the_target():
    assert [error_at(d + 0.5) for d in (-2, -1, 0, 1)] == [1, 0, -1, -2]
    assert [error_at(d) for d in (-0.01, 0.01)] == [0, -1]
    assert [error_at(d + 0.5) for d in range(-16, 16)] == [-1 - d for d in range(-16, 16)]  # linear to N/4


def error_at(displacement: float) -> int:
    """Error word of the axis held at rest beside a positioning point [steps]."""
    rig = Rig(locked=True)
    rig.r.lines.enable = 0
    rig.r.plant.train.position += displacement * rig.step
    rig.run_ticks(3 * N)
    assert rig.error == pytest.approx(-displacement, abs=1e-6)
    return absolute_error(rig.p.controller.converters.absolute, rig.r.controller.converters.absolute)


# ---------------------------------------------------------------------------------- speed word, sequencer, shaping


def test_14_seven_forward_and_three_backward_are_a_word_of_four():
    p, r = PulseCounterParams(half=128), PulseCounter()
    for pulse in (1, 1, -1, 1, 1, -1, 1, 1, -1, 1):
        add_pulses(p, r, pulse)
    assert r.word == 0
    close_window(r)
    assert (r.word, r.count) == (4, 0)
    close_window(r)
    assert r.word == 0


@pytest.mark.parametrize("direction", [1, -1])
def test_14_steady_motion_gives_the_same_word_each_sample(direction):
    p, r, bench = PulseCounterParams(half=128), PulseCounter(), ConverterBench()
    rate = direction * 27 * N / SAMPLE_TICKS  # 27 steps per sample: 0.84 per carrier cycle
    bench.travel(rate, SAMPLE_TICKS)  # in motion when the first window opens
    words = []
    for _ in range(20):
        for _ in range(SAMPLE_TICKS // 32):
            add_pulses(p, r, bench.travel(rate, 32))
        close_window(r)
        assert r.count == 0
        words.append(r.word)
    assert words == [27 * direction] * 20


def test_14_a_pulse_in_the_tick_of_the_strobe_belongs_to_the_window_it_closes():
    strobe = SAMPLE_TICKS - 1
    words = {}
    for tick in (strobe - 1, strobe, strobe + 1):
        rig = Rig('disturbance.lines.burst.kind="+"', f"disturbance.lines.burst.ticks=[{tick}]", locked=True)
        rig.r.lines.enable = 0
        rig.run_ticks(strobe + 1)
        first, count = rig.r.controller.speed.word, rig.r.controller.speed.count
        rig.run_ticks(SAMPLE_TICKS)
        words[tick - strobe] = (first, count, rig.r.controller.speed.word)
    assert words == {-1: (1, 0, 0), 0: (1, 0, 0), 1: (0, 0, 1)}


def test_15_pulses_of_either_sign_count_down():
    r = Sequencer(state=SETTLE_READY, strobe=1, command=100)
    assert take_command(r)
    assert (r.distance, r.mode, r.strobe) == (100, SPEED_MODE, 0)
    for n in range(40):
        count_pulses(r, int(n % 4 != 1), int(n % 4 == 1))
    assert r.distance == 60
    assert r.remaining == 100 - 30 + 10  # what the servo of the comparison takes for its error


def test_16_the_mode_changes_in_the_tick_of_the_threshold_and_stays():
    burst = ('disturbance.lines.burst.kind="+"', 'disturbance.lines.burst.at="7.5 ms"')
    rig = Rig(*burst, "disturbance.lines.burst.count=20")
    rig.run(0.25e-3)
    rig.command(1)
    names = ("distance", "mode", "ready", "stop", "state")
    table = rig.record(11e-3, [f"controller.sequencer.{name}" for name in names])
    distance, mode, ready, stop, state = (table[f"controller.sequencer.{name}"].astype(int) for name in names)
    left = (distance + 0x8000 & 0xFFFF) - 0x8000  # the 16 bits of the counter as a signed number
    flip = int(np.argmax(mode == POSITION_MODE))
    assert (left[flip - 1], left[flip]) == (9, 8)
    assert (mode[:flip] == SPEED_MODE).all()
    assert (state[flip - 1], state[flip]) == (SPEED, SETTLE_BUSY)
    assert (ready[flip], stop[flip]) == (0, 0)
    ready_after = int(np.argmax(ready[flip:] == 1))
    assert ready_after == 12_000  # 3 ms
    assert (stop == 0).all()
    assert left.min() < 0  # on through 0
    assert (mode[flip:] == POSITION_MODE).all()
    rig.run(20e-3)
    assert rig.r.controller.sequencer.mode == POSITION_MODE
    rig.command(1)
    rig.run_ticks(1)
    assert rig.r.controller.sequencer.mode == SPEED_MODE  # only the next set clears it


@pytest.mark.parametrize(
    ("half_width", "words"),
    [
        (0, {-3: -3, -2: -2, -1: -1, 0: 1, 1: 2, 2: 3}),
        (1, {-3: -2, -2: -1, -1: 0, 0: 0, 1: 1, 2: 2}),
        (2, {-3: -1, -2: 0, -1: 0, 0: 0, 1: 0, 2: 1}),
    ],
)
def test_18_the_corrector(half_width, words):
    assert {error: shape(error, half_width) for error in words} == words
    p, r = law(dead_band=half_width)
    for stop in (0, 1):
        for error, shaped in words.items():
            r.setpoint = error
            drive_word(p, r, POSITION_MODE, stop, 0)
            assert r.shaped == (shaped if stop else shape(error, 0))
            drive_word(p, r, SPEED_MODE, stop, 0)
            assert r.shaped == error  # in speed mode unchanged


def law(**changes: int) -> tuple[LawParams, Law]:
    """Law with the default gains KS = (1, 1, 16), KP = (4, 16, 1)."""
    p = LawParams(speed_k1=1, speed_k2=1, speed_k3=16, position_k1=4, position_k2=16, position_k3=1)
    p.dead_band, p.integral_limit, p.corrector, p.integrator, p.word_limit = 1, 127, 1, 1, 128
    for name, value in changes.items():
        setattr(p, name, value)
    return p, Law()


def held(displacement: float, *, stop: bool) -> Rig:
    """The axis beside a positioning point [steps], its bridge off; with or without the stop signal."""
    rig = Rig(locked=True)
    rig.r.lines.enable = 0
    rig.r.plant.train.position += displacement * rig.step
    rig.r.controller.sequencer.stop_at = 0 if stop else NEVER
    rig.run_ticks(INTEGRATE_TICKS)  # the detector's answer has come, one integration clock has passed
    rig.r.controller.law.integral = 0
    return rig


@pytest.mark.parametrize("displacement", [-20.0, -2.5, -1.5, -0.5, 0.5, 1.5, 5.5])
def test_19_without_stop_the_integral_is_zero_whatever_the_error(displacement):
    rig = held(displacement, stop=False)
    rig.run_ticks(20 * INTEGRATE_TICKS)
    assert rig.r.controller.law.setpoint != 0 or displacement == -0.5
    assert (rig.r.controller.sequencer.stop, rig.r.controller.law.integral) == (0, 0)


@pytest.mark.parametrize(
    ("displacement", "error", "per_clock"), [(-2.5, 2, 1), (-0.5, 0, 0), (0.5, -1, 0), (1.5, -2, -1)]
)
def test_19_at_stop_the_integral_counts_outside_the_band_and_holds_inside(displacement, error, per_clock):
    rig = held(displacement, stop=True)
    assert (rig.r.controller.sequencer.state, rig.r.controller.law.setpoint) == (HOLD, error)
    for n in range(1, 131):
        rig.run_ticks(INTEGRATE_TICKS)
        assert rig.r.controller.law.integral == per_clock * min(n, 127)  # stops at the limit


def test_19_inside_the_band_the_integral_is_kept_and_a_set_strobe_clears_it_at_once():
    rig = held(-2.5, stop=True)
    rig.run_ticks(12 * INTEGRATE_TICKS)
    rig.r.plant.train.position += 2 * rig.step
    rig.run_ticks(12 * INTEGRATE_TICKS)
    assert (rig.r.controller.law.setpoint, rig.r.controller.law.integral) == (0, 12)
    rig.command(1)
    rig.run_ticks(1)
    assert (rig.r.controller.sequencer.stop, rig.r.controller.law.integral) == (0, 0)


@pytest.mark.parametrize(
    ("mode", "setpoint", "integral", "speed", "word"),
    [
        (POSITION_MODE, 0, 1, 0, 1),  # the integral is not scaled by KP1
        (POSITION_MODE, 2, 3, 1, 8 + 3 - 16),
        (SPEED_MODE, 5, 0, 3, 32),
        (SPEED_MODE, 27, 0, 0, 127),  # saturates
        (SPEED_MODE, -27, 0, 0, -128),
        (SPEED_MODE, 8, 0, 0, 127),
        (SPEED_MODE, -8, 0, 0, -128),
        (POSITION_MODE, 0, 127, 0, 127),
        (POSITION_MODE, 16, 127, -27, 127),
        (POSITION_MODE, -17, -127, 27, -128),
    ],
)
def test_20_the_drive_word(mode, setpoint, integral, speed, word):
    p, r = law()
    r.setpoint, r.integral = setpoint, integral
    drive_word(p, r, mode, 1, speed)  # at stop F_1 gives 0 for 0 and 2 for 2
    assert r.word == word


# ----------------------------------------------------------------------------------------------------- PWM and drive


@pytest.mark.parametrize(
    ("word", "plus", "minus"),
    [(-128, 0, 255), (-127, 1, 254), (-1, 127, 128), (0, 128, 127), (1, 129, 126), (126, 254, 1), (127, 255, 0)],
)
def test_21_requests_of_one_sawtooth(word, plus, minus):
    p, r = SawtoothParams(half=128), SawtoothPwm()
    for _ in range(2):
        requests = [count_sawtooth(p, r, word) for _ in range(256)]  # one signed request: never both
        assert (requests.count(1), requests.count(-1), requests.count(0)) == (plus, minus, 1)
    if word == 0:
        assert abs(plus - minus) == 1


def locked_rotor() -> Rig:
    """An axis with a rotor that nothing moves."""
    rig = Rig()
    rig.p.plant.train.friction.static_right = rig.p.plant.train.friction.static_left = 1e9
    return rig


@pytest.mark.parametrize(("word", "sign"), [(127, 1), (-128, -1)])
def test_22_the_current_of_a_locked_rotor_is_clamped_at_its_limit(word, sign):
    rig = locked_rotor()
    lines, bridge, train = rig.r.lines, rig.r.plant.bridge, rig.r.plant.train
    currents, limited, resumed = [0.0], [], 0
    for _ in range(6000):
        lines.first_request, lines.request = (
            count_sawtooth(rig.p.controller.pwm, rig.r.controller.pwm, word) for _ in range(2)
        )
        move(rig.p.plant, rig.r.plant, train, lines, 0)
        currents.append(sign * train.current)
        limited.append(bridge.over if sign > 0 else bridge.under)
        assert (bridge.under if sign > 0 else bridge.over) == 0
        resumed += bool(len(limited) > 1 and limited[-2] and sign * train.voltage > 0)
    assert train.velocity == 0.0
    reached = next(n for n, current in enumerate(currents) if current > 6.0)
    # 24 V on 2 ohm and 0.8 mH; of each 256 half ticks one is free and the bridge against the current.
    share = 254 / 256
    expected = -0.4e-3 * math.log(1 - 6.0 / (12.0 * share)) / rig.tick
    assert reached == pytest.approx(expected, rel=0.01)
    assert 6.0 < max(currents) <= 6.01
    assert min(currents[reached:]) >= 5.9
    # Out of the limit in the tick after the current has fallen below it, and driving again.
    assert limited == [current > 6.0 for current in currents[:-1]]
    assert 0 < sum(limited) < 6000 - reached
    assert resumed > 100


@pytest.mark.parametrize("sign", [1, -1])
def test_22_without_a_request_the_current_decays_to_zero_and_does_not_reverse(sign):
    rig = locked_rotor()
    train = rig.r.plant.train
    train.current = sign * 6.0
    currents = [6.0]
    for _ in range(1000):
        move(rig.p.plant, rig.r.plant, train, rig.r.lines, 0)
        currents.append(sign * train.current)
    assert (np.diff(currents) <= 0).all()
    assert min(currents) == 0.0
    # Against the other supply: i = 18 exp(-t / 0.4 ms) - 12.
    assert currents.index(0.0) * rig.tick == pytest.approx(0.4e-3 * math.log(18 / 12), abs=1.01 * rig.tick)


CYCLE = 64
"""Ticks of a carrier cycle; in the defaults also N, the steps of a pitch."""

BURST_AT, BURST_SPACING = 20_000, 96
"""Spurious pulses come from 5 ms on, 24 us apart [tick]."""


def offset(rig: Rig) -> float:
    """Position less target [steps]."""
    return -rig.error


# ------------------------------------------------------------------------------------------------- moves


@dataclass(frozen=True)
class Recorded:
    """One move strobed at 0.25 ms; `t` [s], the registers every carrier cycle."""

    rig: Rig
    registers: dict[str, np.ndarray]

    @property
    def switched(self) -> float:
        """Time of the mode switch [s]."""
        return self.rig.r.controller.sequencer.switched * self.rig.tick

    @property
    def settled(self) -> float:
        """Last time outside +-2 steps [s]."""
        return self.rig.r.plant.gauge.outside * self.rig.tick

    @property
    def overshoot(self) -> float:
        """Farthest beyond the target [steps]."""
        return self.rig.r.plant.gauge.beyond / self.rig.step


@cache
def recorded_move(pitches: int, *, locked: bool = False) -> Recorded:
    """A move by whole pitches, recorded until 20 ms after its end."""
    rig = Rig(pitch_index=20 if pitches > 400 else 400, locked=locked)
    rig.run_until(START)
    rig.command(pitches)
    # The longest move spends 423.3 um / 0.345 m/s = 1.23 ms on a pitch, a short one needs up to 7.6 ms for its first.
    duration = 30e-3 + 1.3e-3 * abs(pitches)
    names = (
        "plant.train.velocity",
        "controller.sequencer.mode",
        "controller.sequencer.distance",
        "controller.speed.word",
        "controller.law.setpoint",
    )
    return Recorded(rig, rig.record(duration, names, CYCLE))


def test_17_timeline_of_a_move_of_six_pitches():
    rig = Rig()
    rig.run_until(START)
    rig.command(6)
    names = ("controller.sequencer.mode", "controller.sequencer.ready", "controller.sequencer.stop")
    lines = rig.record(45e-3, names, 1)
    mode, ready, stop = (int(np.argmax(lines[name] == 1)) for name in names)
    for line, moment, milliseconds in (("mode", mode, 21.5), ("ready", ready, 24.5), ("stop", stop, 41.5)):
        assert lines["t"][moment] * 1e3 == pytest.approx(milliseconds, abs=0.5), line
    assert ready - mode == 12_000  # 3.000 ms
    assert stop - mode == 80_000  # 20.000 ms
    for name, moment in zip(names, (mode, ready, stop), strict=True):
        assert not lines[name][:moment].any()  # the strobe has cleared them
        assert lines[name][moment:].all()


@pytest.mark.parametrize(
    ("pitches", "switch_ms", "settled_ms"),
    [
        (1, 6.7, 7.8),
        (-1, 7.8, 9.3),
        (2, 10.9, 12.1),
        (6, 21.5, 22.7),
        (-6, 21.8, 23.3),
        (30, 55.2, 56.3),
        (792, 1008, 1009),
    ],
)
def test_23_times_and_overshoot_of_moves(pitches, switch_ms, settled_ms):
    move = recorded_move(pitches)
    assert move.switched * 1e3 == pytest.approx(switch_ms, rel=0.05)
    assert move.settled * 1e3 == pytest.approx(settled_ms, rel=0.05)
    assert 0.0 < move.overshoot < 3.0
    after = np.argmax(move.registers["controller.sequencer.mode"] == POSITION_MODE)
    assert 0.040 <= abs(move.registers["plant.train.velocity"][after]) <= 0.045
    if abs(pitches) >= 30:
        assert move.registers["plant.train.velocity"].max() == pytest.approx(0.346, rel=0.01)
        assert move.registers["controller.speed.word"].max() in (27, 28)


@pytest.mark.parametrize("pitches", [1, 6])
def test_23_from_lock_both_directions_take_the_same_time(pitches):
    # Within a speed sample period, 512 us: the two directions meet the sample strobe in another phase of their motion.
    right, left = recorded_move(pitches, locked=True), recorded_move(-pitches, locked=True)
    assert left.switched == pytest.approx(right.switched, abs=0.512e-3)
    assert left.settled == pytest.approx(right.settled, abs=0.512e-3)


def test_23_why_the_specified_moves_to_the_left_take_longer():
    # With all counters at zero the comparator lags by N/4 - 1 = 15 ticks. The tracker acquires before the strobe
    # (trap 2), so the first speed word reads 15 to the left while the carriage stands.
    started, locked = Rig(), Rig(locked=True)
    for rig in (started, locked):
        rig.run_until(START)
    assert started.r.controller.sequencer.position == -15
    assert abs(locked.r.controller.sequencer.position) <= 1  # the target is the boundary of two steps (trap 5)
    for rig in (started, locked):
        rig.command(-1)
        rig.run_until(0.6e-3)  # behind the first sample at 0.512 ms
    # u = 16 * (-7 - word), vref(64) = 7: a word of -15 or beyond drives to the right, 0 or -1 to the left.
    assert started.r.controller.law.setpoint == locked.r.controller.law.setpoint == -7
    assert started.r.controller.speed.word in (-15, -16)
    assert started.r.controller.law.word == min(127, 16 * (-7 - started.r.controller.speed.word)) > 0
    assert locked.r.controller.law.word == 16 * (-7 - locked.r.controller.speed.word) < 0
    # One sample period backward and one to make good for it: 2 * 512 us.
    lost = recorded_move(-1).switched - recorded_move(-1, locked=True).switched
    assert lost == pytest.approx(2 * 0.512e-3, rel=0.2)


@pytest.mark.parametrize("pitches", [6, -6, 30, 792])
def test_24_speed_word_stays_near_the_table_and_the_reference_falls_with_the_distance(pitches):
    move = recorded_move(pitches)
    speed_mode = move.registers["controller.sequencer.mode"] == SPEED_MODE
    direction = 1 if pitches > 0 else -1
    word, reference = (
        direction * move.registers[name][speed_mode] for name in ("controller.speed.word", "controller.law.setpoint")
    )
    distance = move.registers["controller.sequencer.distance"][speed_mode].astype(int)
    excess = word - reference
    accelerated = int(np.argmax(excess[2048 // CYCLE :] >= 0)) + 2048 // CYCLE  # behind the word of the acquisition
    assert excess[accelerated:].max() == 2  # allowed: 4
    falling = distance[1:] < distance[:-1]
    assert falling.sum() > 40 * abs(pitches)
    assert (np.diff(reference) <= 0).all()
    assert (np.diff(reference)[~falling] == 0).all()
    assert (
        reference[0]
        == move.rig.p.controller.sequencer.table[min(64 * abs(pitches), move.rig.p.controller.sequencer.last)]
    )
    assert reference[-1] == move.rig.p.controller.sequencer.table[9]


# ------------------------------------------------------------------------------------------------- spurious pulses


@cache
def rest_after_burst(pulses: int, kind: str, pitches: int, *, final: str = "absolute", locked: bool = False) -> float:
    """Rest position after a move with spurious pulses in its traverse [steps from the target]."""
    burst = (
        f"disturbance.lines.burst.kind={kind}",
        "disturbance.lines.burst.at=5 ms",
        f"disturbance.lines.burst.count={pulses}",
        "disturbance.lines.burst.spacing=24 us",
    )
    rig = Rig(f"method.final={final}", *(burst if pulses else ()), locked=locked).move(pitches, 0.25)
    assert rig.r.plant.interference.inserted == pulses
    assert abs(rig.r.plant.train.velocity) < 1e-5  # the ripple of the current only
    return offset(rig)


@pytest.mark.parametrize("pitches", [6, -6])
@pytest.mark.parametrize("kind", ["+", "-"])
def test_25_spurious_pulses_do_not_move_the_rest_position(kind, pitches):
    for pulses in (0, 1, 2, 5, 8, 12, 16, 20):
        for locked in (False, True):
            assert abs(rest_after_burst(pulses, kind, pitches, locked=locked)) <= 0.6, pulses


@pytest.mark.parametrize("pitches", [6, -6])
@pytest.mark.parametrize(("kind", "sign"), [("+", -1), ("-", 1)])
def test_25_the_incremental_servo_keeps_every_spurious_pulse(kind, sign, pitches):
    # From lock: its position error is to begin with the distance alone, not with the pulses of the acquisition.
    undisturbed = rest_after_burst(0, kind, pitches, final="incremental", locked=True)
    assert abs(undisturbed) < 2  # dead band of a step, and the tracker's dead zone of another
    for pulses in (1, 2, 5, 8, 12, 16, 20):
        moved = rest_after_burst(pulses, kind, pitches, final="incremental", locked=True) - undisturbed
        assert moved == pytest.approx(sign * pulses, abs=1), pulses


def rests_after_any_burst(kind: int, pitches: int) -> dict[int, float]:
    """Rest position along the move for 0 to 64 spurious pulses [steps from the target]."""
    found = {}
    for pulses in (0, 10, 20, 22, 24, 26, 27, 28, 29, 30, 31, 32, 40, 50, 60, 64):
        rig = Rig()
        rig.disturb(kind, [BURST_AT + k * BURST_SPACING for k in range(pulses)])
        rig.move(pitches, 0.12)
        assert rig.r.plant.interference.inserted == pulses
        found[pulses] = offset(rig) * (1 if pitches > 0 else -1)
    return found


@pytest.mark.parametrize("pitches", [6, -6])
@pytest.mark.parametrize("kind", [INSERT_PLUS, INSERT_MINUS])
def test_26_protection_holds_below_half_a_pitch_and_beyond_it_whole_pitches_are_lost(kind, pitches):
    rests = rests_after_any_burst(kind, pitches)
    for pulses, rest in rests.items():
        assert abs(rest - 64 * round(rest / 64)) <= 1, pulses
        if 8 + pulses < 32:
            assert abs(rest) <= 1, pulses
    for pulses in (30, 60, 64):
        assert rests[pulses] == pytest.approx(-64, abs=1)


def chain_of_moves(final: str, seed: int) -> tuple[int, list[float]]:
    """60 random moves with 8 spurious pulses of the sign of the motion in each.

    Returns moves forward less backward, and the offset at the end of every move, as the next strobe comes [steps].
    """
    dice = random.Random(seed)
    rig = Rig(f"method.final={final}", locked=True)
    net, offsets = 0, []
    for _ in range(60):
        pitches = dice.choice((1, -1)) * dice.randint(1, 12)
        kind = INSERT_PLUS if pitches > 0 else INSERT_MINUS
        rig.command(pitches)
        begin = rig.r.tick + round(2e-3 / rig.tick)
        rig.disturb(kind, [begin + k * BURST_SPACING for k in range(8)])
        net += 1 if pitches > 0 else -1
        rig.run_ticks(1)
        while not rig.r.controller.sequencer.ready:
            rig.run_ticks(CYCLE)
            assert rig.time < 6.0
        rig.run(8e-3 + 20e-3 * dice.random())  # the host prints; now and then the axis comes to hold
        offsets.append(offset(rig))
    assert rig.r.plant.interference.inserted == 480
    assert rig.r.controller.sequencer.refused == 0
    return net, offsets


@pytest.mark.parametrize("seed", [1, 3])
def test_27_a_chain_of_moves_ends_on_its_target_and_the_incremental_servo_drifts(seed):
    net, offsets = chain_of_moves("absolute", seed)
    assert max(map(abs, offsets)) < 1
    net_again, drifted = chain_of_moves("incremental", seed)
    assert net == net_again
    assert abs(net) >= 4  # the drift is more than its tolerance
    assert drifted[-1] == pytest.approx(-8 * net, abs=2)


# ------------------------------------------------------------------------------------------------- at the target


def watch(rig: Rig, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], offset [steps] and integral, every carrier cycle."""
    found = rig.record(seconds, ("plant.train.position", "controller.law.integral"), CYCLE)
    return found["t"], (found["plant.train.position"] - rig.target) / rig.step, found["controller.law.integral"]


def test_28_without_stop_the_servo_oscillates_about_the_target():
    rig = Rig("method.stop_always_off=true").move(6, 0.1)
    for _ in range(3):  # sustained: three stretches of 100 ms alike
        _, offsets, _ = watch(rig, 0.1)
        assert 0.7 <= np.ptp(offsets) <= 1.0
        assert abs(0.5 * (offsets.max() + offsets.min())) <= 0.5
        crossings = np.count_nonzero(np.diff(np.sign(offsets - offsets.mean())))
        assert crossings > 20
    assert rig.r.controller.sequencer.stop == 0


@pytest.mark.parametrize("pitches", [1, -1, 2, 6, -6, 30])
def test_28_with_stop_it_rests(pitches):
    rig = Rig().move(pitches, 0.2)
    _, offsets, _ = watch(rig, 0.1)
    assert np.ptp(offsets) < 0.01
    assert abs(offsets[-1]) <= 1


@dataclass(frozen=True)
class Pushed:
    """A move of six pitches, pushed from 30 ms on; `t` [s], `offset` [steps], `integral`."""

    rig: Rig
    t: np.ndarray
    offset: np.ndarray
    integral: np.ndarray


@cache
def pushed(force: float, *overrides: str) -> Pushed:
    """Run until 400 ms."""
    push = (f"disturbance.push.force={force} N", "disturbance.push.at=30 ms", "disturbance.push.duration=10 s")
    rig = Rig(*push, *overrides).move(6, 30e-3)
    return Pushed(rig, *watch(rig, 0.37))


@pytest.mark.parametrize("force", [3, 1, -1, 2, -2, 5, -5])
def test_29_the_integral_takes_over_an_external_force(force):
    run = pushed(force)
    assert (np.abs(run.offset[run.t >= 80e-3]) <= 1).all()
    assert np.ptp(run.offset[run.t >= 300e-3]) < 0.2
    stop = run.t < run.rig.r.controller.sequencer.stop_at * run.rig.tick
    assert not run.integral[stop].any()
    # At rest inside the dead band u = I, a mean of 24 V (2 I + 1) / 256 with half a unit to either side while the
    # bridge is undriven; with the force it is below the static friction of 1.2 N.
    per_volt = 0.05 / 8.085e-3 / 2.0
    unit = per_volt * 24 / 128
    assert abs(force + unit * (run.integral[-1] + 0.5)) <= 1.2 + 0.5 * unit
    assert run.integral[-1] * force <= 0


def test_29_three_newtons_push_a_step_off_until_the_integral_has_counted_to_about_minus_six():
    run = pushed(3)
    before_stop = run.offset[run.t < run.rig.r.controller.sequencer.stop_at * run.rig.tick]
    assert 1.0 < before_stop.max() <= 1.3
    assert run.integral.min() == run.integral[-1]
    assert run.integral[-1] == pytest.approx(-6, abs=1)


def test_29_without_integrator_three_newtons_push_two_steps_off_for_ever():
    run = pushed(3, "method.integrator=false")
    assert not run.integral.any()
    late = run.offset[run.t >= 200e-3]
    assert late == pytest.approx(np.full(late.size, 2.0), abs=0.4)
    assert late.mean() == pytest.approx(2.0, abs=0.1)


def test_30_without_dead_band_the_integrator_hunts():
    rig = Rig("method.dead_band=0").move(6, 0.2)
    for _ in range(2):
        _, offsets, integral = watch(rig, 0.15)
        assert np.ptp(offsets) == pytest.approx(0.9, abs=0.1)
        assert integral.min() == pytest.approx(-2, abs=1)
        assert integral.max() == pytest.approx(1, abs=1)
        assert np.count_nonzero(np.diff(integral)) > 20
    rig = Rig("method.dead_band=1").move(6, 0.2)
    _, offsets, integral = watch(rig, 0.3)
    assert np.ptp(offsets) < 0.01
    assert np.ptp(integral) == 0


@pytest.mark.parametrize("pitches", [1, -1, 2, 6, -6, 30])
def test_31_without_corrector_and_integrator(pitches):
    rig = Rig("method.corrector=false", "method.integrator=false").move(pitches, 0.2)
    _, offsets, integral = watch(rig, 0.1)
    assert np.abs(offsets).max() <= 2
    assert not integral.any()
    with_both, without = recorded_move(pitches).rig.r.controller.sequencer, rig.r.controller.sequencer
    for name in ("switched", "ready_at", "stop_at", "refused"):
        assert getattr(without, name) == getattr(with_both, name), name
    assert without.ready == without.stop == 1


# ------------------------------------------------------------------------------------------------- claim


def at_switch(pitches: int, *overrides: str, frozen: int | None = None) -> Rig:
    """A move from lock up to the mode switch; `frozen` holds the absolute word at this value from the strobe on."""
    rig = Rig(*overrides, locked=True)
    rig.run_until(START)
    if frozen is not None:
        rig.p.controller.converters.absolute.top = 16  # above the counter: its latch is never clocked
        rig.r.controller.converters.absolute.word = frozen
    rig.command(pitches)
    rig.run_ticks(1)
    while rig.r.controller.sequencer.mode == SPEED_MODE:
        rig.run_ticks(1 if rig.r.controller.sequencer.distance == 9 else CYCLE)
        assert rig.time < 0.1
    return rig


@pytest.mark.parametrize("pitches", [6, -6])
@pytest.mark.parametrize("error", [-2, -1, 0, 1, 2])
def test_32_with_the_absolute_word_frozen_the_threshold_is_reached_but_not_the_target(error, pitches):
    frozen = at_switch(pitches, frozen=2 * (error + 16))
    normal = at_switch(pitches)
    assert frozen.r.controller.sequencer.switched == normal.r.controller.sequencer.switched
    assert frozen.r.plant.train.snapshot() == normal.r.plant.train.snapshot()
    for rig in (frozen, normal):
        rig.run_until(0.1)
    assert frozen.r.controller.law.setpoint == error
    assert abs(offset(frozen)) > 1
    assert abs(offset(normal)) < 1


def run_without_counts(rig: Rig, seconds: float) -> None:
    """Let time pass with every count of the incremental path held at zero, the speed counter's apart."""
    s = rig.r.controller.sequencer
    while rig.time < seconds:
        s.distance = s.remaining = s.position = 0
        rig.run_ticks(CYCLE - 1)  # no more than one pulse comes in this time


@pytest.mark.parametrize("pitches", [6, -6])
def test_32_without_the_incremental_path_after_the_switch_the_stop_is_the_same(pitches):
    stops = {}
    for final in ("absolute", "incremental"):
        normal, cut = (at_switch(pitches, f"method.final={final}") for _ in range(2))
        run_without_counts(cut, 0.1)
        normal.run_until(cut.time)
        stops[final] = offset(normal), offset(cut), normal.r.plant.train.snapshot() == cut.r.plant.train.snapshot()
    assert stops["absolute"][2]  # to the last bit of position, velocity and current
    assert abs(stops["absolute"][1]) <= 1
    # The same cut moves the stop of the servo that ends by counting: the cut is real.
    assert abs(stops["incremental"][0] - stops["incremental"][1]) > 1


# ------------------------------------------------------------------------------------------------- literal variant


def test_23_29_the_literal_order_of_the_taps_settles_later_and_holds_the_force():
    """Section 7: integration 2^12, sample 2^13, KS3 = 8, KP1 = 3, KP2 = 6, table peak 54."""
    literal = "clock.order=literal"
    rig = Rig(literal, locked=True)
    assert (rig.spec.clock.integrate_tap, rig.spec.clock.sample_tap, rig.spec.peak_count) == (12, 13, 54)
    assert (rig.spec.method.speed_gains, rig.spec.method.position_gains) == ([1, 1, 8], [3, 6, 1])
    rig.move(6, 0.2)
    assert 23e-3 <= rig.r.plant.gauge.outside * rig.tick <= 24e-3
    assert rig.r.plant.gauge.beyond < rig.step
    assert abs(rig.error) < 1
    for force in (3, -3):
        run = pushed(force, literal)
        late = run.t >= 120e-3
        assert np.abs(run.offset[late]).max() <= 1
        assert run.integral[-1] * force < 0
