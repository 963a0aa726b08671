"""The host of a cascade axis: units, samples that pass and are seen, and events that are answered."""

import numpy as np
import pytest

import detent
from detent.methods.cascade.controller import ARRIVED, FAULT
from detent.methods.cascade.host import WATCHED, CascadeHost, cascade_registers, rotary_unit
from detent.methods.cascade.system import Cascade, set_off
from detent.methods.load import load_spec
from detent.planning.profile import MotionLimits, plan_move
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled

LINEAR, ROTARY = (load_spec(detent.example(name)) for name in ("cascade.toml", "turntable.toml"))
LIMITS = MotionLimits(speed=0.3, acceleration=3.0, jerk=100.0)


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


def test_who_watches_sees_every_sample_and_changes_nothing():
    seen, unseen = moving(), moving()
    rows = np.concatenate([seen.watch(150), seen.watch(50)])
    unseen.pass_samples(200)
    assert rows.dtype.names == WATCHED
    assert seen.state.snapshot() == unseen.state.snapshot()
    assert len(rows) == 200
    assert rows["plant.machine.load.position"][-1] == seen.state.plant.machine.load.position
    for k in (7, 149, 150):
        other = moving()
        other.pass_samples(k + 1)
        assert rows["controller.law.command"][k] == other.state.controller.law.command


def test_who_watches_disturbs_no_recorder():
    def recorded(watched):
        recorder = Recorder(Cascade, ["controller.law.command", "plant.machine.load.position"], every=3, period=1e-5)
        host = CascadeHost(LINEAR, recorder)
        host.follow(plan_move(LINEAR.mechanics.start_position, 0.1, LIMITS, host.period))
        if watched:
            host.watch(301)
        else:
            host.pass_samples(301)
        host.machine.close()
        return recorder.trace()

    with_rows, without = recorded(watched=True), recorded(watched=False)
    assert len(with_rows) == 301 * moving().sample_ticks // 3
    for name in without.columns:
        assert np.array_equal(with_rows[name], without[name])


def test_samples_pass_in_stretches_as_in_one():
    first, second = moving(), moving()
    samples = 9000
    assert first.pass_samples(samples) == 0
    for part in (1, 699, samples - 700):
        second.pass_samples(part)
    assert first.state.snapshot() == second.state.snapshot()
    assert first.time == pytest.approx(samples * first.period)


def test_an_arrival_ends_a_stretch_at_the_end_of_its_sample():
    host = moving(target=0.03)
    host.pass_samples(3000)
    before = host.state.tick
    assert host.arrive(1000) == ARRIVED
    samples = round(LINEAR.method.in_position_time / host.period)
    assert host.state.tick == before + samples * host.sample_ticks
    assert host.pass_samples(10) == 0


def test_who_is_not_in_position_in_time_is_off():
    host = moving()
    assert host.arrive(100) == FAULT
    assert host.state.tick == 100 * host.sample_ticks
    assert (host.state.controller.on, host.state.lines.enable, host.state.lines.command) == (0, 0, 0.0)


def test_behind_its_end_a_reference_stands():
    host = moving(target=0.03)
    host.pass_samples(4000)
    assert host.state.controller.reference.position == 0.03
    assert host.state.controller.reference.velocity == 0.0
    assert host.state.plant.machine.load.position == pytest.approx(0.03, abs=2e-5)


def test_peaks_are_those_of_the_samples_that_passed():
    host = moving()
    rows, peaks = host.watch(100), host.state.controller.peaks
    assert peaks.following == np.abs(rows["controller.law.position_error"]).max()
    assert peaks.command == np.abs(rows["controller.law.command"]).max()
    assert peaks.limited == 0
    assert np.abs(host.watch(200)["controller.law.command"]).max() == peaks.command > 0.0


def test_a_drive_that_is_off_gets_no_command():
    host = moving()
    host.pass_samples(600)
    assert host.state.plant.source.output != 0.0
    host.controller.on = 0
    host.pass_samples(LINEAR.drive.delay + 1)
    assert host.state.plant.source.command == host.state.plant.source.output == 0.0


def test_an_axis_that_is_in_motion_at_power_on_reads_its_velocity_at_once():
    spec = load_spec(detent.example("cascade.toml"), ["encoder.velocity_span=5", "encoder.delay=2"])
    host = CascadeHost(spec, position=0.1)
    set_off(host.params, host.state, 0.2)
    host.drive(np.zeros(1))
    rows = host.watch(3)
    assert rows["controller.motor_sensor.velocity"] == pytest.approx(0.2, rel=0.01)
    # Two samples late.
    assert rows["controller.motor_sensor.position"][0] == pytest.approx(0.1 - 2 * 0.2 * host.period, abs=1e-6)
