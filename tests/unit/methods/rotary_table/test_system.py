"""The rotary table as a whole: its clocks, recording, faults of the plant, and one result however it is run."""

import hashlib
import math
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from tests.places import ROOT
from tests.rotary_table_rig import COUNT, NO_TRACE, RATIO, Rig, T

from detent.control.table_positioner import HOLD, MOVE, NEGATIVE, POSITIVE, POWER_ON
from detent.kernel.loop import advance
from detent.methods.rotary_table.system import RotaryTable, switch_on
from detent.plant.gearing import fill_eccentricity
from detent.sensing.resolver_counter import fill_resolver


def test_power_on_waits_for_the_first_angle():
    rig = Rig(123)
    r = RotaryTable()
    switch_on(rig.p, r, 123 / 4 + 0.5 / 4096, 0, 1)
    advance(rig.p, r, 2, *NO_TRACE)
    assert r.controller.positioner.state == POWER_ON
    advance(rig.p, r, 1, *NO_TRACE)
    assert (r.controller.positioner.state, r.controller.positioner.oar * COUNT) == (HOLD, 123)
    assert (r.controller.positioner.passes, r.controller.positioner.interrupts) == (1, 1)


def test_the_word_acts_in_the_tick_of_its_interrupt():
    rig = Rig(100).press(1)
    rig.run_ticks(2)
    assert (rig.r.lines.word, rig.speed) == (0, 0)
    rig.run_ticks(1)
    assert rig.r.lines.word == rig.positioner.s4 > 0
    assert rig.speed > 0


def test_the_loop_stops_for_its_host():
    rig = Rig(10).entry(0, 11).go(0)
    done = advance(rig.p, rig.r, 100_000, *NO_TRACE)
    assert 0 < done < 10_000
    assert (rig.positioner.event, rig.positioner.state) == (1, HOLD)
    assert advance(rig.p, rig.r, 10, *NO_TRACE) == 0
    rig.positioner.event = 0
    assert advance(rig.p, rig.r, 10, *NO_TRACE) == 10


@pytest.mark.compiled
@pytest.mark.parametrize(("policy", "way"), [(POSITIVE, 350), (NEGATIVE, -10)])
def test_a_direction_is_kept(policy, way):
    rig = Rig(20).entry(0, 10, 60, policy).go(0).run_until(9)
    assert rig.travel == pytest.approx(way, abs=1.5 * COUNT)
    assert rig.angle.dar == pytest.approx(10 / COUNT, abs=1)


def test_rows_are_the_registers_after_every_so_many_ticks():
    size = len(RotaryTable().snapshot())
    picks = np.arange(size, dtype=np.int64)
    rows = np.zeros((5, size), np.uint8)
    rig = Rig(100, noise=2.0).press(1)
    r, stepped = rig.r, rig.r.copy()
    assert advance(rig.p, r, 3, rows, picks, 7) == 3
    assert advance(rig.p, r, 37, rows, picks, 7) == 37
    expected = {}
    for _ in range(40):
        assert advance(rig.p, stepped, 1, *NO_TRACE) == 1
        if stepped.tick % 7 == 0:
            expected[stepped.tick // 7 % 5] = stepped.snapshot()
    assert r.snapshot() == stepped.snapshot()
    assert sorted(expected) == [0, 1, 2, 3, 4]
    assert {k: rows[k].tobytes() for k in expected} == expected


def test_the_true_angle_of_the_table_lags_by_the_backlash():
    rig = Rig(100)
    rig.p.plant.train.gear.half_backlash = math.radians(0.05) * RATIO
    lag = {}
    for sign in (1, -1):
        rig.press(sign, 10).run_ticks(5000)
        m = rig.r.plant.train.motor
        motor = (m.turns + m.angle / (2 * math.pi)) / RATIO * 360 - rig.speed * 2e-3
        lag[sign] = motor - rig.r.plant.table / 2**32 * 360
        rig.release().run_ticks(3000)
        assert rig.positioner.state == HOLD
    assert lag == pytest.approx({1: 0.05, -1: -0.05}, abs=0.002)


def test_the_coarse_word_lags_by_the_backlash_of_its_own_reduction():
    words = []
    for half_backlash in (0.0, math.radians(1.0) * RATIO):
        rig = Rig(100)
        rig.p.plant.train.reduction.half_backlash = half_backlash
        rig.press(1, 30).run_ticks(5000)
        words.append(rig.r.lines.coarse)
    assert words[0] - words[1] == pytest.approx(4096 / 360, abs=1)


@pytest.mark.compiled
def test_faults_of_the_coarse_side_do_not_reach_the_angle():
    clean, faulty = (Rig(100) for _ in range(2))
    reduction, coarse = faulty.p.plant.train.reduction, faulty.p.plant.coarse
    reduction.half_backlash = math.radians(0.3) * RATIO
    fill_eccentricity(reduction, math.radians(0.8), 1.0)
    fill_resolver(coarse, 0.01, 0.005, 0.0)
    for rig in (clean, faulty):
        rig.press(1).run_until(12)
    assert (faulty.angle.dar, faulty.positioner.s4) == (clean.angle.dar, clean.positioner.s4)
    assert faulty.r.lines.coarse != clean.r.lines.coarse


def test_a_load_moves_the_table_out_by_what_the_loop_gives_way():
    rig = Rig(100)
    rig.p.plant.train.load.torque, rig.p.plant.train.load.begin, rig.p.plant.train.load.end = 0.1, 0, 1 << 60
    rig.run_until(1.0)
    # The velocity loop needs 0.1 N.m / stiffness of speed error; the position loop 1 / Kp of that in angle.
    away = math.degrees(0.1 / rig.p.plant.amplifier.stiffness) / RATIO / 30
    assert rig.travel == pytest.approx(away, abs=2 * COUNT)
    assert away > 10 * COUNT


def test_a_torque_limit_limits_the_acceleration():
    rig = Rig(100, max_torque=0.02).press(1)
    rig.run_until(0.5)
    assert rig.r.plant.amplifier.limited == 1
    gained = math.degrees(0.02 / rig.p.plant.train.motor.inertia) / RATIO * 0.5
    assert rig.speed == pytest.approx(gained, rel=0.1)


@pytest.mark.compiled
def test_static_friction_leaves_a_rest_in_hold():
    rig = Rig(10).entry(0, 20).go(0)
    m = rig.p.plant.train.motor
    m.coulomb, m.static = 0.02, 0.03
    rig.run_until(3)
    word = 0.03 / rig.p.plant.amplifier.stiffness / rig.p.plant.amplifier.speed_per_count
    assert abs(rig.positioner.s4) <= word
    assert rig.speed == 0.0
    assert rig.positioner.state == (MOVE if abs(rig.positioner.oar - rig.angle.aar) > 2 else HOLD)


@pytest.mark.process
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
def test_a_stretch_gives_the_same_bytes_compiled_and_plain():
    program = "from tests.unit.methods.rotary_table.test_system import run_hash; print(run_hash())"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == run_hash()


def run_hash() -> str:
    """Hash of parameters and state along jogs both ways across the boundary and a positioning, with every fault."""
    rig = Rig(359.0, noise=2.0, droop=0.05, max_torque=0.6, seed=9)
    train, plant = rig.p.plant.train, rig.p.plant
    train.gear.half_backlash, train.reduction.half_backlash = 0.02, 0.1
    fill_eccentricity(train.gear, 1e-3, 0.3)
    fill_eccentricity(train.reduction, 5e-3, 1.3)
    fill_resolver(plant.fine, 0.01, 0.003, 0.02)
    fill_resolver(plant.coarse, 0.02, 0.01, 0.01)
    train.motor.coulomb, train.motor.static = 0.002, 0.003
    train.load.torque, train.load.begin, train.load.end = 0.03, 900, 2500
    digest = hashlib.sha256(rig.p.snapshot())
    for sign in (1, -1):
        rig.press(sign, 40).run_ticks(1500)
        digest.update(rig.r.snapshot())
        rig.release().run_ticks(4000)
        digest.update(rig.r.snapshot())
    rig.entry(0, 357, 50).go(0).run_ticks(4000)
    digest.update(rig.r.snapshot())
    assert rig.angle.crossings > 0
    assert rig.angle.position % T == rig.angle.dar
    return digest.hexdigest()
