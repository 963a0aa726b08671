"""The phase servo as a whole: acquisition, the order within a tick, recording, and one result however it is run."""

import hashlib
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from tests.difference import diff
from tests.phase_servo_rig import NO_TRACE, ConverterBench, Rig, make_spec
from tests.places import ROOT

from detent.control.phase_sequencer import ACQUIRE, HOLD, POSITION_MODE, SETTLE_BUSY, SETTLE_READY, SPEED, SPEED_MODE
from detent.kernel.loop import advance
from detent.kernel.step import step
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.phase_servo.system import PhaseServo, PhaseServoParams, be_ready, switch_on, tick

N = 64
SAMPLE_TICKS, INTEGRATE_TICKS = 2048, 4096
READY_TICKS = 12_000
LAG = 15
"""Ticks by which the square wave lags the carrier at a positioning point."""

SHORT = ("method.ready_time=0.2 ms", "method.stop_time=0.4 ms")


def power_on(displacement: float, *overrides: str) -> tuple[PhaseServoParams, PhaseServo, float]:
    """The axis just switched on, beside a positioning point [steps]; parameters, state, place of the point [m]."""
    spec = make_spec(overrides)
    p, r = build_phase_servo(spec), PhaseServo()
    point = 400 * spec.pitch
    switch_on(p, r, point + displacement * spec.step, 1)
    return p, r, point


def lead(r: PhaseServo) -> int:
    """What the tracker's counter is ahead of the carrier's [steps], modulo N."""
    return (r.controller.converters.tracking.reference - r.controller.converters.carrier.count) % N


def unmoved(*overrides: str) -> Rig:
    """The axis in lock at a positioning point, its bridge off."""
    rig = Rig(*overrides, locked=True)
    rig.r.lines.enable = 0
    return rig


def acquire(p: PhaseServoParams, r: PhaseServo) -> list[int]:
    """Tick by tick to the end of the acquisition; returns the speed words of the strobes on the way."""
    place, words = r.plant.train.position, []
    while r.controller.sequencer.state == ACQUIRE:
        advance(p, r, 1, *NO_TRACE)
        if r.tick % SAMPLE_TICKS == 0:
            words.append(r.controller.speed.word)
        assert r.tick <= 4 * SAMPLE_TICKS
        if r.controller.sequencer.state == ACQUIRE:
            assert (r.lines.enable, r.plant.bridge.positive, r.plant.bridge.negative) == (0, -24.0, 24.0)
            assert (r.controller.sequencer.mode, r.controller.sequencer.ready, r.controller.sequencer.stop) == (
                POSITION_MODE,
                0,
                0,
            )
            assert (r.plant.train.position, r.plant.train.current) == (place, 0.0)
    return words


@pytest.mark.parametrize("displacement", [0.3, 15.5, 16.5, 31.2, 46.9, -15.9, -9.6, 7.0])
def test_the_bridge_waits_until_the_tracker_is_silent_and_a_sample_is_discarded(displacement):
    p, r, _ = power_on(displacement)
    words = acquire(p, r)
    s, last = r.controller.sequencer, r.tick - 1
    assert last - s.last_pulse > N // 2 * N  # silent for more than half a turn against the carrier
    assert r.tick % SAMPLE_TICKS == 0
    assert len(words) >= 2  # the strobe that enables is not the first
    assert (r.lines.enable, s.state, s.switched, s.ready_at) == (1, SETTLE_BUSY, last, last + READY_TICKS)
    # Nothing is left of the pulses of the acquisition.
    assert (words[-1], r.controller.speed.word, r.controller.speed.count) == (0, 0, 0)
    assert (s.distance, s.remaining, s.position) == (0, 0, 0)
    # In lock: the counter is ahead by the whole steps of the lead of the square wave.
    assert lead(r) == int(np.floor(displacement - LAG)) % N
    pulses = (lead(r) + N // 2) % N - N // 2
    assert (sum(words) == 0) == (pulses == 0)


@pytest.mark.parametrize("displacement", [LAG + 31.5, LAG - 30.5, LAG + 1.5])
def test_the_bridge_waits_for_the_first_strobe_after_the_silence(displacement):
    strobe = 256
    p, r, _ = power_on(displacement)
    p.controller.clocks.sample_mask = (
        2 * strobe - 1
    )  # of the oscillator; with 2048 ticks the second strobe is always late enough
    while r.controller.sequencer.state == ACQUIRE:
        advance(p, r, 1, *NO_TRACE)
    steps = abs(int(np.floor(displacement - LAG)))
    last = 32 + (steps - 1) * (N - 1 if displacement > LAG else N + 1)
    assert r.controller.sequencer.last_pulse == last
    assert r.tick == ((last + N // 2 * N + 1) // strobe + 1) * strobe


def test_the_sample_that_holds_the_acquisition_is_discarded():
    p, r, _ = power_on(LAG + 5.5, "clock.order=literal")  # its first window of 4096 ticks has all five pulses
    acquire(p, r)
    assert r.tick == 2 * SAMPLE_TICKS
    assert lead(r) == 5
    assert (r.controller.speed.word, r.controller.speed.count, r.controller.law.setpoint) == (0, 0, -11)
    assert r.controller.law.word == 3 * -11  # no kick by the damping term


def test_a_start_in_lock_still_waits_for_its_silence():
    p, r, _ = power_on(LAG + 0.5)
    words = acquire(p, r)
    assert words == [0, 0]
    assert r.controller.sequencer.last_pulse == 0


@pytest.mark.parametrize("repaired", [False, True])
def test_in_exact_antiphase_only_the_repaired_tracker_locks(repaired):
    p, r, _ = power_on(LAG + 32.5, f"method.leave_antiphase={str(repaired).lower()}")
    words = acquire(p, r)
    assert (lead(r), any(words)) == ((32, True) if repaired else (0, False))


@pytest.mark.compiled
def test_from_any_start_the_axis_comes_to_rest_at_the_nearest_positioning_point():
    rng, step = np.random.default_rng(5), make_spec().step
    for displacement in rng.uniform(-31, 31, 12):
        p, r, point = power_on(displacement)
        done = advance(p, r, 60_000, *NO_TRACE)
        s = r.controller.sequencer
        assert (s.state, s.ready, s.event) == (SETTLE_READY, 1, 1)
        assert done == r.tick == s.ready_at + 1  # the loop stops for its host
        assert advance(p, r, 1000, *NO_TRACE) == 0
        s.event = 0
        assert advance(p, r, 300_000, *NO_TRACE) == 300_000  # 75 ms: stop, and the time to die away
        assert (s.state, s.stop) == (HOLD, 1)
        rest = r.plant.train.position
        assert abs(rest - point) < step
        assert advance(p, r, 40_000, *NO_TRACE) == 40_000
        assert r.plant.train.position == pytest.approx(rest, abs=0.01 * step)  # the ripple of the PWM stirs it a little


def test_a_set_strobe_before_ready_is_refused():
    p, r, _ = power_on(0.5, *SHORT)
    s = r.controller.sequencer
    for state in (ACQUIRE, SETTLE_BUSY):
        while s.state != state:
            advance(p, r, 1, *NO_TRACE)
        refused = s.refused
        s.command, s.strobe = 64, 1
        advance(p, r, 2, *NO_TRACE)
        assert (s.strobe, s.refused, s.state, s.mode) == (0, refused + 1, state, POSITION_MODE)
    advance(p, r, 5000, *NO_TRACE)
    assert (s.event, s.ready) == (1, 1)
    s.event = 0
    s.command, s.strobe = 64, 1
    advance(p, r, 1, *NO_TRACE)
    assert (s.state, s.mode, s.ready, s.refused, s.distance) == (SPEED, SPEED_MODE, 0, 2, 64)
    advance(p, r, 1, *NO_TRACE)
    s.strobe = 1  # in the middle of a move
    advance(p, r, 1, *NO_TRACE)
    assert (s.refused, s.state) == (3, SPEED)


def test_a_distance_up_to_the_threshold_is_left_to_the_absolute_loop_at_once():
    rig = Rig(locked=True)
    rig.run_ticks(10)
    s = rig.r.controller.sequencer
    s.command, s.strobe = 8, 1
    rig.run_ticks(1)
    assert (s.state, s.mode, s.switched, s.ready, s.stop) == (SETTLE_BUSY, POSITION_MODE, 10, 0, 0)


def test_a_bench_made_ready_is_in_lock_and_enabled():
    rig = Rig(locked=True)
    r = rig.r
    assert r.lines.enable == 1
    r.lines.enable = 0  # before the first absolute word it would drive
    rig.run_ticks(2 * SAMPLE_TICKS)
    assert r.controller.sequencer.last_pulse == 0
    assert (r.controller.sequencer.state, r.controller.sequencer.mode) == (HOLD, POSITION_MODE)
    assert lead(r) == -LAG % N
    be_ready(rig.p, r)
    assert lead(r) == -LAG % N


def test_rows_are_the_registers_after_every_so_many_ticks():
    size = len(PhaseServo().snapshot())
    picks = np.arange(size, dtype=np.int64)
    rows = np.zeros((5, size), np.uint8)
    p, r, _ = power_on(10.5, "detector.jitter=30 ns", "disturbance.lines.corrupted=20 kHz")
    stepped = r.copy()
    assert advance(p, r, 3, rows, picks, 7) == 3  # not yet a row
    assert not rows.any()
    assert advance(p, r, 37, rows, picks, 7) == 37
    expected = {}
    for _ in range(40):
        assert advance(p, stepped, 1, *NO_TRACE) == 1
        if stepped.tick % 7 == 0:
            expected[stepped.tick // 7 % 5] = stepped.snapshot()
    assert r.snapshot() == stepped.snapshot()
    assert sorted(expected) == [0, 1, 2, 3, 4]
    assert {k: rows[k].tobytes() for k in range(5)} == expected


def test_a_row_holds_the_bytes_that_were_picked():
    leaves = {leaf.path: leaf for leaf in PhaseServo.leaves()}
    rig = Rig()
    columns = rig.record(50 * rig.tick, ["tick", "controller.converters.carrier.count"], every=5)
    assert columns["tick"].tolist() == list(range(5, 51, 5))
    assert columns["controller.converters.carrier.count"].tolist() == [tick % N for tick in range(5, 51, 5)]
    assert leaves["tick"].offset == 0


def test_converters_alone_count_as_they_do_in_steps():
    alone, stepped = ConverterBench(lag=LAG), ConverterBench(lag=LAG)
    net = alone.travel(0.5, 1500)
    rate = round(0.5 * stepped.step / N)
    assert net == sum(stepped.clock(tick * rate / stepped.step) for tick in range(1500))
    assert alone.r.snapshot() == stepped.r.snapshot()
    assert net < 0  # the lag is acquired first


def burst(kind: str, *ticks: int) -> tuple[str, str]:
    return f'disturbance.lines.burst.kind="{kind}"', f"disturbance.lines.burst.ticks={list(ticks)}"


@pytest.mark.parametrize(("kind", "sign"), [("+", 1), ("-", -1)])
def test_a_pulse_put_in_is_counted_but_does_not_move_the_tracker(kind, sign):
    rig = unmoved(*burst(kind, 100, 101))
    rig.r.controller.sequencer.distance = 50
    rig.run_ticks(101)
    s = rig.r.controller.sequencer
    assert (s.distance, s.position, s.remaining) == (49, sign, -sign)
    rig.run_ticks(1)
    assert (s.distance, s.position, rig.r.controller.speed.count) == (48, 2 * sign, 2 * sign)
    assert (lead(rig.r), s.last_pulse) == (-LAG % N, 0)
    rig.run_ticks(1000)
    assert (s.distance, rig.r.plant.interference.inserted) == (48, 2)


def test_a_pulse_taken_away_moves_the_tracker_but_is_not_counted():
    p, r, _ = power_on(LAG + 3.5, *burst("remove", 40))  # three steps of lead; the first pulse comes at 32
    for _ in range(400):
        advance(p, r, 1, *NO_TRACE)
    assert lead(r) == 3
    assert (r.controller.sequencer.position, r.controller.speed.count, r.plant.interference.removed) == (2, 2, 1)
    assert r.controller.sequencer.last_pulse == 32 + 2 * (N - 1)


def test_a_lost_sample_leaves_word_and_count():
    rig = unmoved(*burst("lose sample", 5))
    rig.r.controller.speed.count, rig.r.controller.speed.word = 3, 9
    rig.run_ticks(SAMPLE_TICKS)
    assert (rig.r.controller.speed.word, rig.r.controller.speed.count) == (9, 3)
    rig.run_ticks(SAMPLE_TICKS)
    assert (rig.r.controller.speed.word, rig.r.controller.speed.count) == (3, 0)


def test_a_corrupted_sample_turns_the_comparator_for_one_tick():
    rig, clean = unmoved(*burst("corrupt", 70)), unmoved()
    for n in range(80):
        rig.run_ticks(1)
        clean.run_ticks(1)
        assert (rig.r.lines.ps != clean.r.lines.ps) == (n == 70)


def test_a_push_acts_on_the_carriage_in_its_ticks():
    rig = Rig("disturbance.push.force=-4 N", "disturbance.push.at=5 us", "disturbance.push.duration=2 us", locked=True)
    forces = []
    for _ in range(40):
        rig.run_ticks(1)
        forces.append(rig.r.plant.train.force)
    assert forces == [0.0] * 20 + [-4.0] * 8 + [0.0] * 12


def test_the_integral_counts_at_stop_with_every_integration_clock():
    rig = unmoved()
    rig.r.plant.train.position -= 5.5 * rig.step
    integrals = []
    for _ in range(3):
        rig.run_ticks(INTEGRATE_TICKS)
        integrals.append(rig.r.controller.law.integral)
    assert integrals == [1, 2, 3]
    assert rig.r.controller.law.word == 4 * 5 + 3  # F_1(5) = 5


def test_without_the_integrator_it_stays_at_zero():
    rig = unmoved("method.integrator=false")
    rig.r.plant.train.position -= 5.5 * rig.step
    rig.run_ticks(2 * INTEGRATE_TICKS)
    assert (rig.r.controller.law.integral, rig.r.controller.law.setpoint) == (0, 5)


def test_the_machine_switches_on_as_its_file_says():
    spec = make_spec()
    machine = PhaseHost(spec).machine
    assert machine.state.plant.train.position == spec.mechanics.start_position
    machine.pass_ticks(10)
    assert machine.time == pytest.approx(2.5e-6)


@pytest.mark.process
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
def test_acquisition_and_a_stretch_give_the_same_bytes_compiled_and_plain():
    program = "from tests.unit.methods.phase_servo.test_system import run_hash; print(run_hash())"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == run_hash()


def run_hash() -> str:
    """Hash of parameters and state along an acquisition, a move's beginning and a hold under every disturbance."""
    lines = ("corrupted=2 kHz", "inserted=5 kHz", "removed=5 kHz", "lost_samples=1 kHz")
    faults = ("detector.jitter=40 ns", "detector.gain_error=4 %", "detector.quadrature_error=2 deg")
    push = ("disturbance.push.force=3 N", "disturbance.push.at=2 ms", "disturbance.push.duration=1 s")
    p, r, _ = power_on(-11.3, *SHORT, *faults, *push, *(f"disturbance.lines.{line}" for line in lines))
    digest = hashlib.sha256(p.snapshot())
    s = r.controller.sequencer
    acquired = advance(p, r, 40_000, *NO_TRACE)
    digest.update(r.snapshot())
    s.event, s.command, s.backward, s.strobe = 0, 128, 1, 1
    assert acquired < 20_000
    assert advance(p, r, 6000, *NO_TRACE) == 6000
    assert s.mode == SPEED_MODE
    digest.update(r.snapshot())
    s.distance = 3  # to the end of the move without the way
    while s.state != HOLD:
        s.event = 0
        advance(p, r, 2000, *NO_TRACE)
    s.event = 0
    advance(p, r, 5000, *NO_TRACE)
    digest.update(r.snapshot())
    return digest.hexdigest()


@step
def advance_eagerly(p: PhaseServoParams, r: PhaseServo, ticks: int) -> None:
    """The same ticks with every word of the logic worked out in each of them."""
    for _ in range(ticks):
        r.controller.changed = 1
        r.controller.sequencer.event = 0  # the host has looked
        tick(p, r, r.plant.train)


@pytest.mark.compiled
@pytest.mark.parametrize("overrides", [(), ("disturbance.lines.inserted=500 Hz", "detector.jitter=5 ns")])
def test_words_worked_out_in_every_tick_are_the_same_bits(overrides):
    """ADR 8: the words are combinational, so leaving out the ticks in which nothing changed leaves out nothing."""
    lazy, eager = (Rig(*overrides) for _ in range(2))
    for rig in (lazy, eager):
        rig.run(0.25e-3)
        rig.command(2)
    lazy.run_ticks(120_000)
    advance_eagerly(eager.p, eager.r, 120_000)
    eager.r.controller.sequencer.event = 0
    assert lazy.r.snapshot() == eager.r.snapshot(), diff(lazy.r, eager.r)
    assert lazy.r.controller.sequencer.position != 0


@pytest.mark.compiled
@pytest.mark.parametrize("jitter", ["5 ns", "20 ns", "100 ns"])
def test_an_axis_at_the_boundary_of_two_steps_comes_out_of_its_acquisition_in_spite_of_noise(jitter):
    """Pairs of opposite pulses came for ever there (trap 5), and the axis waited for silence in vain."""
    p, r, point = power_on(0.0, f"detector.jitter={jitter}", *SHORT)
    advance(p, r, round(20e-3 * 4e6), *NO_TRACE)
    assert r.controller.sequencer.event == 1
    assert r.controller.sequencer.state == SETTLE_READY
    assert abs(r.plant.train.position - point) < 2 * 0.0254 / 60 / 64
