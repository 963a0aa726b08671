"""The host of a cascade axis: units, rehearsals that change nothing, stretches that end where they should."""

import numpy as np
import pytest

import detent
from detent.methods.cascade.host import (
    CHUNK,
    WATCHED,
    CascadeHost,
    Peaks,
    Stop,
    cascade_registers,
    rotary_unit,
    run_lengths,
)
from detent.methods.cascade.system import Cascade, set_off
from detent.methods.load import load_spec
from detent.planning.profile import MotionLimits, plan_move

pytestmark = pytest.mark.compiled

LINEAR, ROTARY = (load_spec(detent.example(name)) for name in ("cascade.toml", "turntable.toml"))
LIMITS = MotionLimits(speed=0.3, acceleration=3.0, jerk=100.0)


def go(_rows):
    return None


def moving(spec=LINEAR, target=0.1):
    host = CascadeHost(spec)
    host.follow(plan_move(spec.mechanics.start_position, target, LIMITS, host.period))
    return host


def test_registers_of_a_rotary_axis_differ_in_their_units_alone():
    linear, rotary = (list(cascade_registers(spec).leaves()) for spec in (LINEAR, ROTARY))
    assert cascade_registers(LINEAR) is Cascade
    assert [(x.path, x.offset, x.width) for x in linear] == [(x.path, x.offset, x.width) for x in rotary]
    units = {x.path: x.unit for x in rotary}
    assert units["plant.machine.load.position"] == "rad"
    assert units["controller.reference.acceleration"] == "rad/s2"
    assert units["plant.machine.external"] == "N.m"
    assert units["controller.law.command"] == "V"
    assert units["tick"] == "tick"


@pytest.mark.parametrize(
    ("linear", "rotary"), [("m", "rad"), ("V.s/m", "V.s/rad"), ("V, N", "V, N.m"), ("1", "1"), ("kg", "kg.m2")]
)
def test_units_are_exchanged_symbol_by_symbol(linear, rotary):
    assert rotary_unit(linear) == rotary


def test_a_rehearsal_shows_what_comes_and_changes_nothing():
    host = moving()
    before = host.state.snapshot()
    rows = host.rehearse(200)
    assert rows.dtype.names == WATCHED
    assert host.state.snapshot() == before
    host.pass_samples(200, go)
    assert host.position == rows["plant.machine.load.position"][-1]
    assert host.state.controller.law.command == rows["controller.law.command"][-1]


def test_samples_pass_in_stretches_as_in_one():
    first, second = moving(), moving()
    samples = CHUNK + 700
    assert first.pass_samples(samples, go) is None
    for part in (1, 699, CHUNK):
        second.pass_samples(part, go)
    assert first.state.snapshot() == second.state.snapshot()
    assert first.time == pytest.approx(samples * first.period)


def test_a_stretch_ends_in_the_sample_that_the_judge_names():
    host = moving()
    seen = []

    def judge(rows):
        seen.append(len(rows))
        return Stop(5, "enough") if len(seen) == 2 else None

    assert host.pass_samples(3 * CHUNK, judge) == Stop(CHUNK + 5, "enough")
    assert seen == [CHUNK, CHUNK]
    assert host.state.tick == (CHUNK + 5) * host.sample_ticks


def test_behind_its_end_a_reference_stands():
    host = moving(target=0.03)
    host.pass_samples(4000, go)
    assert host.state.controller.reference.position == 0.03
    assert host.state.controller.reference.velocity == 0.0
    assert host.position == pytest.approx(0.03, abs=2e-5)


def test_peaks_are_those_of_the_samples_that_passed():
    host = moving()
    rows = host.rehearse(300)
    host.pass_samples(100, go)
    assert host.peaks.following == np.abs(rows["controller.law.position_error"][:100]).max()
    assert host.peaks.command == np.abs(rows["controller.law.command"][:100]).max()
    assert host.peaks.command < np.abs(rows["controller.law.command"]).max()
    assert Peaks().limited == host.peaks.limited == 0


def test_a_drive_that_is_off_gets_no_command():
    host = moving()
    host.pass_samples(600, go)
    assert host.state.plant.source.output != 0.0
    host.switch_off()
    host.pass_samples(LINEAR.drive.delay + 1, go)
    assert host.state.plant.source.command == host.state.plant.source.output == 0.0


def test_an_axis_that_is_in_motion_at_power_on_reads_its_velocity_at_once():
    spec = load_spec(detent.example("cascade.toml"), ["encoder.velocity_span=5", "encoder.delay=2"])
    host = CascadeHost(spec, position=0.1)
    set_off(host.params, host.state, 0.2)
    host.drive(np.zeros(1))
    rows = host.rehearse(3)
    assert rows["controller.motor_sensor.velocity"] == pytest.approx(0.2, rel=0.01)
    # Two samples late.
    assert rows["controller.motor_sensor.position"][0] == pytest.approx(0.1 - 2 * 0.2 * host.period, abs=1e-6)


def test_run_lengths_go_on_from_the_stretch_before():
    assert run_lengths(np.zeros(3, bool), 7).tolist() == [0, 0, 0]
    assert run_lengths(np.ones(3, bool), 7).tolist() == [8, 9, 10]
    assert run_lengths(np.array([False, True, True]), 7).tolist() == [0, 1, 2]
