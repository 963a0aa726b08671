"""The cascade axis gives one result, to the bit, however it is run: compiled or plain, cut, recorded."""

import hashlib
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from tests.cascade_rig import (
    MASS,
    NO_TRACE,
    SAMPLE_TICKS,
    STANDING,
    T_SAMPLE,
    TICK,
    Rig,
    in_single,
    make_params,
    set_friction,
)
from tests.places import ROOT

from detent.kernel.loop import advance
from detent.methods.cascade.system import Cascade, CascadeParams, along, fill_clocks, set_count
from detent.planning.profile import MotionLimits, plan_move

MOVE = MotionLimits(speed=0.5, acceleration=5.0, jerk=100.0)


def noisy_params(variant: str) -> CascadeParams:
    """Axes that between them use every block: winding, coupling, backlash, friction, delays, both laws."""
    p = make_params(coupled=variant != "rigid", gap=2e-4 if variant == "backlash" else 0.0)
    m = p.plant.machine
    set_friction(m.motor.friction, coulomb=2.0, static=3.0, stribeck=0.01, viscous=5.0, offset=0.3)
    set_friction(m.load.friction, coulomb=1.0, viscous=2.0)
    m.load.friction.negative.coulomb = 1.5
    c, law = p.controller, p.controller.law
    set_count(p, 1e-5, 2e-5)
    c.motor_sensor.span, c.motor_sensor.smoothing = 2, 0.7
    c.load_sensor.delay = 1
    p.plant.source.step, p.plant.source.delay = 0.05, 2
    law.max_command = 60.0
    law.cascade.integral_gain = law.cascade.velocity_gain * 5.0
    law.feed_forward.velocity, law.feed_forward.acceleration = 0.9, MASS
    law.feed_forward.coulomb_positive, law.feed_forward.dead_band = 2.0, 1e-3
    p.plant.push.force, p.plant.push.begin, p.plant.push.end = 6.0, 3000, 3400
    if variant == "backlash":
        w = m.winding
        w.used, w.resistance, w.inductance, w.force_constant, w.emf_constant = 1, 1.0, 2e-3, 8.0, 8.0
        w.max_current = 6.0
        p.plant.source.gain = 0.3
    if variant == "coupled":
        law.position_pid, m.pendulum, law.feed_forward.pendulum = 1, 3.0, 3.0
        law.pid.proportional, law.pid.integral, law.pid.derivative = 8000.0, 2000.0, 300.0
        law.pid.smoothing = 0.5
        c.feedback.position_on_load = c.feedback.velocity_on_load = 1
    if variant == "brake":
        p.plant.brake.force, p.plant.brake.open, p.plant.brake.close = 12.0, 70, 45
        c.brake.present, c.brake.open = 1, 4
    fill_clocks(p, TICK, SAMPLE_TICKS)
    return p


VARIANTS = ("rigid", "coupled", "backlash", "brake")
WHOLE = (*VARIANTS, *(f"{one} single" for one in VARIANTS))
"""And each in single precision."""


def axis_of(variant: str) -> Rig:
    """An axis at power-on."""
    name, _, precision = variant.partition(" ")
    p = noisy_params(name)
    return Rig(in_single(p) if precision else p)


def run_hash(variant: str) -> str:
    """Hash of parameters and state along a move, a standing reference, and commands of the host."""
    rig = axis_of(variant)
    digest = hashlib.sha256(rig.p.snapshot())
    move = plan_move(0.0, 0.004, MOVE, T_SAMPLE)
    rows = np.zeros((7, len(rig.r.snapshot())), np.uint8)
    picks = np.arange(rows.shape[1], dtype=np.int64)
    feed = along(move.position, move.velocity, move.acceleration)
    for ticks in (999, 1, 1500):
        advance(rig.p, rig.r, ticks, rows, picks, 130, *feed)
        digest.update(rig.r.snapshot())
    digest.update(rows.tobytes())
    rig.r.controller.reference.position -= 0.001
    rig.run(1500)
    digest.update(rig.r.snapshot())
    rig.r.controller.entry = 0
    rig.drive(12.0 * np.sin(np.arange(60)), 1200)
    digest.update(rig.r.snapshot())
    for on in (0, 1):
        rig.r.controller.on, rig.r.controller.entry = on, 0
        rig.drive(12.0 * np.sin(np.arange(15)), 300)
        digest.update(rig.r.snapshot())
    assert rig.r.plant.machine.load.position != 0.0
    return digest.hexdigest()


def test_it_is_determined():
    for variant in WHOLE:
        assert run_hash(variant) == run_hash(variant)


@pytest.mark.process
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
def test_plain_python_gives_the_same_bytes_as_compiled_code():
    program = "from tests.unit.methods.cascade.test_system_bits import WHOLE, run_hash; print(*map(run_hash, WHOLE))"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = done.stdout.split()
    assert len(set(found)) == len(WHOLE)
    assert found == [run_hash(variant) for variant in WHOLE]


@pytest.mark.parametrize("variant", WHOLE)
def test_time_may_be_cut_anywhere(variant):
    move = plan_move(0.0, 0.01, MOVE, T_SAMPLE)
    feed = along(move.position, move.velocity, move.acceleration)
    whole, pieces = axis_of(variant), axis_of(variant)
    assert advance(whole.p, whole.r, 6000, *NO_TRACE, *feed) == 6000
    for ticks in (1, 2, 997, 3, 4000, 997):
        assert advance(pieces.p, pieces.r, ticks, *NO_TRACE, *feed) == ticks
    assert whole.r.snapshot() == pieces.r.snapshot()


def test_rows_are_the_registers_after_every_so_many_ticks():
    size = len(Cascade().snapshot())
    picks = np.arange(size, dtype=np.int64)
    rows = np.zeros((5, size), np.uint8)
    rig = Rig(noisy_params("backlash"))
    rig.r.controller.reference.position = 0.001
    r, stepped = rig.r, rig.r.copy()
    assert advance(rig.p, r, 3, rows, picks, 7, *STANDING) == 3
    assert advance(rig.p, r, 37, rows, picks, 7, *STANDING) == 37
    expected = {}
    for _ in range(40):
        assert advance(rig.p, stepped, 1, *NO_TRACE, *STANDING) == 1
        if stepped.tick % 7 == 0:
            expected[stepped.tick // 7 % 5] = stepped.snapshot()
    assert r.snapshot() == stepped.snapshot()
    assert sorted(expected) == [0, 1, 2, 3, 4]
    assert {k: rows[k].tobytes() for k in expected} == expected
