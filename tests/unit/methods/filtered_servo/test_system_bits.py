"""The filtered servo gives one result, to the bit, however it is run: compiled or plain, skipping, cut, recorded."""

import hashlib
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from tests.difference import diff, values_of
from tests.filtered_servo_rig import PLANT_B, PULSE, Rig, plant_a
from tests.places import ROOT

from detent.control.deviation_counter import FAULT
from detent.methods.filtered_servo.controller import CLOCKS, go_to, reset
from detent.methods.filtered_servo.system import TICK, FilteredServo, advance_by_clocks

RAMP = "method.command_acceleration=1 m/s^2"
NOISE = (
    "encoder.jitter=10 deg", "encoder.missing_edges=0.002", "disturbance.lines.inserted=80 Hz",
    "disturbance.lines.removed=60 Hz", "disturbance.lines.lost_samples=20 Hz", "disturbance.lines.corrupted=120 Hz",
)  # fmt: skip


def scenario(*, noise):
    """A rig with a ramped command, and what its host does on the way: (ticks, action)."""
    rig = Rig(RAMP, *(NOISE if noise else ()))
    g = rig.c.generator
    actions = [
        (400, lambda: rig.go(300, rate=9000)),
        (900, lambda: setattr(rig.c.clock, "demanded", 2770)),
        (700, lambda: go_to(rig.c, g.command - 40, g.rate)),
        (300, lambda: rig.go(-500, rate=1037)),
        (1200, lambda: setattr(rig.c.clock, "demanded", 5000)),
    ]
    return rig, actions


@pytest.mark.parametrize("noise", [False, True], ids=["quiet", "noisy"])
def test_ticks_without_events_skip_their_clocks_and_change_no_bit(noise):
    """`busy` runs the ten clocks of a tick, whatever happens in it."""
    (skipping, its), (clocking, theirs) = scenario(noise=noise), scenario(noise=noise)
    for (ticks, act), (_, act_too) in zip(its, theirs, strict=True):
        act()
        act_too()
        skipping.run_ticks(ticks)
        for _ in range(ticks):
            clocking.c.busy = 1
            clocking.run_ticks(1)
        assert diff(skipping.r, clocking.r) == {}
    assert skipping.r.snapshot() == clocking.r.snapshot()
    assert skipping.plant.gauge.peak_speed > 500 * PULSE
    assert (skipping.plant.interference.inserted > 0) == noise


def test_a_quiet_tick_does_skip_its_clocks():
    """Otherwise the comparison above would compare a thing with itself."""
    rig = Rig()
    rig.c.generator.goal, rig.c.generator.rate = 1, 1_000_000
    rig.c.deviation.error = 0.125  # the logic would put it right
    rig.run_ticks(10)
    assert rig.c.deviation.error == 0.125
    rig.c.busy = 1
    rig.run_ticks(1)
    assert rig.c.deviation.error == 0.0


CLOCKED = (
    "controller.clock.left",
    "controller.decoder.forward",
    "controller.decoder.reverse",
    "controller.deviation.position",
    "controller.speed.count",
    "tick",
)


def record_clocks(rig, ticks):
    """Registers after each clock of so many ticks, none of which stops the loop."""
    leaves = {leaf.path: leaf for leaf in FilteredServo.leaves()}
    chosen = [leaves[name] for name in CLOCKED]
    picks = np.concatenate([np.arange(leaf.offset, leaf.offset + leaf.width.size) for leaf in chosen])
    rows = np.zeros((ticks * CLOCKS + 7, len(picks)), np.uint8)
    first = rig.r.tick * CLOCKS
    assert advance_by_clocks(rig.p, rig.r, ticks, rows, picks.astype(np.int64)) == ticks
    table = rows[np.arange(first, first + ticks * CLOCKS) % len(rows)]
    return table.view(np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in chosen]))[:, 0]


@pytest.mark.parametrize("noise", [False, True], ids=["quiet", "noisy"])
def test_clock_by_clock_the_axis_comes_to_the_same_bits(noise):
    (whole, its), (clocked, theirs) = scenario(noise=noise), scenario(noise=noise)
    for (ticks, act), (_, act_too) in zip(its, theirs, strict=True):
        act()
        act_too()
        whole.run_ticks(ticks)
        record_clocks(clocked, ticks)
        assert diff(whole.r, clocked.r) == {}
    assert whole.r.snapshot() == clocked.r.snapshot()


def test_clock_by_clock_each_pulse_lasts_a_clock_and_is_counted_in_the_next():
    rig = Rig()
    rig.go(300, rate=9000)
    rig.plant.train.velocity = 4000 * PULSE
    rows = record_clocks(rig, 1600)
    assert rows["tick"].tolist() == list(np.repeat(np.arange(1, 1601), CLOCKS))
    pulses = rows["controller.decoder.forward"].astype(int) - rows["controller.decoder.reverse"]
    assert np.count_nonzero(pulses) > 40
    assert not (pulses[1:] * pulses[:-1]).any()
    assert np.array_equal(np.diff(rows["controller.deviation.position"]), pulses[:-1])
    left = np.diff(rows["controller.clock.left"])
    assert set(left) == {-1, 4999}
    strobes = np.flatnonzero(left == 4999) + 1
    assert np.array_equal(np.diff(strobes), np.full(len(strobes) - 1, 5000))
    # What is counted in the clock of the strobe belongs to the new window.
    assert np.array_equal(rows["controller.speed.count"][strobes], pulses[strobes - 1])


def test_time_may_be_cut_anywhere():
    whole, pieces = Rig(RAMP, *NOISE), Rig(RAMP, *NOISE)
    for rig in (whole, pieces):
        rig.go(300, rate=9000)
    whole.run_ticks(6000)
    for ticks in (1, 2, 997, 3, 4000, 997):
        pieces.run_ticks(ticks)
    assert whole.r.snapshot() == pieces.r.snapshot()


def test_recorded_registers_equal_stepping():
    names = [
        "controller.deviation.deviation",
        "controller.filter.output",
        "plant.train.velocity",
        "controller.clock.left",
        "controller.generator.command",
        "tick",
        "controller.busy",
    ]
    recorded, stepped = Rig(RAMP, *NOISE), Rig(RAMP, *NOISE)
    for rig in (recorded, stepped):
        rig.run_ticks(13)
        rig.go(200, rate=9000)
    run = recorded.record(0.02, names, every=7)
    rows = []
    for _ in range(2000):
        stepped.run_ticks(1)
        if stepped.r.tick % 7 == 0:
            values = values_of(stepped.r)
            rows.append([values[name] for name in names])
    assert len(rows) == len(run["t"]) > 280
    for k, name in enumerate(names):
        assert run[name].tolist() == [row[k] for row in rows]
    assert run["t"] == pytest.approx([row[names.index("tick")] * TICK for row in rows], rel=1e-12)
    assert recorded.r.snapshot() == stepped.r.snapshot(), "recording changes nothing"
    assert len(set(run["controller.deviation.deviation"])) > 5


SERVOS = {
    "current, float": ((), plant_a()),
    "current, fixed": (("method.filter=fixed", "drive.whole_words=true", "drive.pwm_frequency=100 kHz"), plant_a()),
    "voltage, none": (
        ("method.filter=none", "motor.inductance=2 mH", "mechanics.friction.right.coulomb=2 N",
         "mechanics.friction.left.coulomb=3 N", "mechanics.friction.left.static=3 N",
         "mechanics.friction.right.static=4 N", "mechanics.friction.left.viscous=10 kg/s"),
        PLANT_B,
    ),
}  # fmt: skip


def run_hash(servo: str) -> str:
    """Hash of parameters and state along a noisy run, with a retune, a fault and a reset on the way."""
    overrides, plant = SERVOS[servo]
    rig = Rig(RAMP, *NOISE, *overrides, plant=plant)
    digest = hashlib.sha256(rig.p.snapshot())
    rig.go(400, rate=12_000)
    for demanded in (5000, 1330, 7000):
        rig.c.clock.demanded = demanded
        rig.run_ticks(2500)
        digest.update(rig.r.snapshot())
    assert rig.c.deviation.position > 100
    assert min(rig.plant.interference.inserted, rig.plant.interference.removed, rig.plant.interference.corrupted) > 0
    rig.plant.train.velocity = 40_000 * PULSE  # more pulses in a sample than the counter holds
    rig.run_ticks(500)
    assert rig.c.deviation.state == FAULT
    digest.update(rig.r.snapshot())
    rig.run_ticks(200)
    reset(rig.c)
    rig.run_ticks(500)
    digest.update(rig.r.snapshot())
    return digest.hexdigest()


@pytest.mark.process
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
def test_plain_python_gives_the_same_bytes_as_compiled_code():
    program = (
        "from tests.unit.methods.filtered_servo.test_system_bits import SERVOS, run_hash; print(*map(run_hash, SERVOS))"
    )
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = done.stdout.split()
    assert len(set(found)) == len(SERVOS)
    assert found == [run_hash(servo) for servo in SERVOS]
