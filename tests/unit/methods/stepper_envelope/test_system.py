import numpy as np
import pytest
from tests.stepper_rig import CLOCK_HZ, NO_TRACE, RAMP, Rig

from detent.control.step_rule import IDLE, PAUSE, STEP, next_entry
from detent.kernel.loop import advance
from detent.methods.stepper_envelope.controller import NOWHERE, StepperControllerParams, load_rule, step_once
from detent.planning.step_envelope import Zone


def decide(rig: Rig) -> int:
    """One decision, by the rig's tables."""
    return step_once(rig.p.controller, rig.r.controller, next_entry(rig.rule, *rig.tables))


def test_a_step_moves_position_pattern_and_time_together():
    rig = Rig(5).start()
    assert decide(rig) == STEP
    assert (rig.position, rig.timer.pulses, rig.timer.phase) == (1, 1, 1)
    assert rig.timer.expires == rig.timer.period == CLOCK_HZ // 400


def test_a_course_ends_with_the_last_period():
    rig = Rig(3).start()
    assert advance(rig.alone, rig.r, 100, *NO_TRACE, *rig.tables) == 3
    assert rig.timer.expires == pytest.approx(CLOCK_HZ * (2 / 400 + 1 / 490), rel=1e-6)
    assert rig.timer.period == 0
    assert decide(rig) == IDLE


@pytest.mark.parametrize("pause", [0, 1, 3])
def test_a_reversal_waits_whole_periods_of_the_start_frequency(pause):
    rig = Rig(2, pause=pause).start(turns=1)
    outcomes, times = [], []
    for _ in range(5):
        outcomes.append(decide(rig))
        times.append(rig.timer.expires * 400 // CLOCK_HZ)
    assert outcomes == [STEP, STEP, PAUSE, STEP, STEP]
    assert times == [1, 2, 2 + pause, 3 + pause, 4 + pause]


def test_on_the_rig_the_motor_takes_the_same_steps_at_the_same_times():
    steps = Rig(40).start()
    seconds = steps.course().seconds
    rig = Rig(40).start().run_to_rest()
    assert rig.seconds == pytest.approx(seconds, abs=1e-12)
    assert rig.rule.snapshot()[:-8] == steps.rule.snapshot()[:-8]
    assert rig.rotor.commanded == rig.position == 40
    assert rig.r.tick * 2e-6 == pytest.approx(seconds, abs=4e-6)


def test_time_at_rest_passes_and_a_start_takes_effect_at_once():
    rig = Rig(4)
    assert advance(rig.p, rig.r, 1000, *NO_TRACE, *rig.tables) == 1000
    assert rig.timer.pulses == 0
    rig.start()
    assert advance(rig.p, rig.r, 1, *NO_TRACE, *rig.tables) == 1
    assert rig.timer.pulses == 1
    assert rig.timer.expires == 1000 * 2000 + CLOCK_HZ // 400


def test_the_loop_returns_at_a_position_that_the_host_names():
    rig = Rig(20).start().run_to(7)
    assert rig.timer.pulses == 7
    assert rig.r.controller.stop_at == NOWHERE
    rig.run_to_rest()
    assert rig.position == 20


def test_records_are_taken_at_multiples_of_their_interval():
    rig = Rig(30).start()
    leaf = next(leaf for leaf in type(rig.r).leaves() if leaf.path == "controller.rule.position")
    picks = np.arange(leaf.offset, leaf.offset + 8)
    rows = np.zeros((10, 8), np.uint8)
    advance(rig.alone, rig.r, 100, rows, picks, 4, *rig.tables)
    assert rows.view(np.int64)[:, 0].tolist() == [0, 4, 8, 12, 16, 20, 24, 28, 0, 0]
    rig = Rig(30).start()
    rows = np.zeros((8, 8), np.uint8)
    advance(rig.p, rig.r, 4000, rows, picks, 500, *rig.tables)
    assert rows.view(np.int64)[:, 0].tolist() == [5, 1, 1, 2, 2, 3, 3, 4]


def test_words_of_the_control_unit():
    p = StepperControllerParams()
    load_rule(p, RAMP, [4000.9, 1000.0, 3000.0], 1_000_000, reload=False)
    assert [p.rule.ramp[k] for k in (0, 1, 227)] == [400, 490, 4000]
    assert list(p.rule.limit[:3]) == [4000, 1000, 3000]
    load_rule(p, RAMP, [4000.9, 1000.0, 3000.0], 1_000_000, reload=True)
    assert [p.rule.ramp[k] for k in (0, 1, 227)] == [2500, 2041, 250]
    assert list(p.rule.limit[:3]) == [250, 1000, 334]  # never faster than the limit
    assert (p.rule.reload, p.timer.reload, p.timer.clock_hz) == (1, 1, 1_000_000)


def test_zone_limits_are_kept_by_the_run():
    course = Rig(300, (Zone(100, 150, 777.0),)).start().course()
    inside = (course.position >= 100) & (course.position < 150)
    assert set(np.rint(course.hz[inside])) == {777}
    assert course.hz[~inside].max() > 1500
