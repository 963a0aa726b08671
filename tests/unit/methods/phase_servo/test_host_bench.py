import math

import pytest
from tests.phase_servo_rig import make_spec

from detent.axisfile.tables import BurstTable, DisturbanceTable, InterferenceTable
from detent.control.phase_sequencer import HOLD, POSITION_MODE
from detent.methods.phase_servo.host import START, PhaseBench
from detent.methods.phase_servo.system import PhaseServo
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled


def test_other_values_of_the_method_leave_the_axis_as_it_is():
    spec = make_spec()
    changed = spec.changed(method={"final": "incremental", "threshold": 6})
    assert (changed.method.final, changed.method.threshold) == ("incremental", 6)
    assert changed.model_copy(update={"method": spec.method}) == spec
    assert (spec.method.final, spec.method.threshold) == ("absolute", 8)


@pytest.mark.parametrize(("pitches", "switched"), [(6, 21.5e-3), (-6, 21.5e-3), (1, 6.7e-3)])
def test_a_move_ends_with_position_mode_eight_steps_before_the_target(pitches, switched):
    bench = PhaseBench(make_spec(), pitches)
    assert bench.displacement == pytest.approx(-64 * pitches)
    moment = bench.move()
    assert moment == pytest.approx(switched, rel=0.05)
    assert bench.machine.state.controller.sequencer.mode == POSITION_MODE
    # Of the whole looks of 1 ms, the one in which it happened.
    assert 0 < bench.machine.time - moment <= 1e-3 + 1e-9
    bench.run_until(0.06)
    assert bench.machine.time == pytest.approx(0.06)
    assert bench.machine.state.controller.sequencer.state == HOLD
    assert abs(bench.displacement) < 1


def test_it_stands_in_lock_until_the_strobe():
    bench = PhaseBench(make_spec(), 6)
    bench.run_until(START)
    assert bench.machine.state.tick == 1000
    assert abs(bench.machine.state.controller.sequencer.position) <= 1  # the target is the boundary of two steps
    assert abs(bench.displacement + 384) < 1


def test_what_disturbs_the_axis_of_the_file_is_left_out():
    quiet = PhaseBench(make_spec(), 6)
    disturbed = PhaseBench(
        make_spec(
            [
                "disturbance.lines.inserted=1 kHz",
                "disturbance.push.force=5 N",
                "disturbance.push.at=1 ms",
                "disturbance.push.duration=1 s",
                "limits.travel=3 mm",
                "mechanics.start_position=1 mm",
            ]
        ),
        6,
    )
    for bench in (quiet, disturbed):
        bench.move()
        bench.run_until(0.05)
    assert disturbed.displacement == quiet.displacement


def test_a_chosen_disturbance_alone_acts():
    burst = BurstTable.model_construct(kind="+", at=5e-3, count=3)
    bench = PhaseBench(make_spec(), 6, DisturbanceTable(lines=InterferenceTable(burst=burst)))
    bench.run_until(5e-3)
    assert bench.machine.state.plant.interference.inserted == 0
    bench.run_until(6e-3)
    assert bench.machine.state.plant.interference.inserted == 3


def test_an_axis_that_cannot_move_never_gets_to_position_mode():
    bench = PhaseBench(make_spec(["limits.effort=0.05 A"]), 6)
    assert math.isnan(bench.move())
    # Half a second, and three times 2.54 mm at 0.35 m/s and 10 m/s^2.
    assert bench.machine.time == pytest.approx(0.5 + 3 * (2.54e-3 / 0.35 + 2 * math.sqrt(2.54e-4)), abs=2e-3)
    assert bench.displacement == pytest.approx(-384, abs=1)


def test_a_recorder_sees_the_whole_run():
    spec = make_spec()
    recorder = Recorder(PhaseServo, ("plant.train.position",), every=400, period=spec.tick)
    bench = PhaseBench(spec, 2, recorder=recorder)
    bench.move()
    bench.run_until(0.02)
    bench.machine.close()
    trace = recorder.trace()
    assert len(trace) == 200
    assert (trace["plant.train.position"][-1] - bench.target) / spec.step == pytest.approx(bench.displacement)
