"""The controller alone: what it says on its lines, tick by tick."""

import pytest
from tests.stepper_rig import Rig

from detent.control.step_rule import FAULT, REST, acknowledge, deflect, release
from detent.methods.stepper_envelope.controller import StepperLines, control


def said(rig: Rig, ticks: int) -> list[tuple[int, int, int, int]]:
    """Tick, pulse, direction and period of every tick whose lines differ from those of the tick before."""
    lines, found = StepperLines(), [(0, 0, 0)]
    changes = []
    for tick in range(ticks):
        control(rig.p.controller, rig.r.controller, lines, *rig.tables)
        found.append((lines.pulse, lines.direction, lines.period))
        if found[-1] != found[-2]:
            changes.append((tick, *found[-1]))
    return changes


def test_a_pulse_lasts_a_tick_and_the_period_stays_until_the_next():
    rig = Rig(3, reload=True).start()
    assert said(rig, 4000) == [
        (0, 1, 1, 2500), (1, 0, 1, 2500), (1250, 1, 1, 2041), (1251, 0, 1, 2041),
        (2271, 1, 1, 2500), (2272, 0, 1, 2500), (3521, 0, 1, 0),
    ]  # fmt: skip
    assert rig.rule.event == 1
    assert rig.r.controller.now == 4000 * 2


@pytest.mark.parametrize(("pause", "ticks"), [(0, 0), (1, 1250), (3, 3750)])
def test_in_the_pause_of_a_reversal_the_lines_say_hold(pause, ticks):
    changes = said(Rig(1, reload=True, pause=pause).start(turns=1), 10_000)
    held = [change for change in changes if change[3] == 0]
    first, second = (tick for tick, pulse, *_ in changes if pulse)
    assert second - first == 1250 + ticks
    assert [tick for tick, *_ in held] == ([1250] if pause else []) + [second + 1250]


def test_no_tick_has_two_pulses_where_the_period_is_the_shortest():
    """Ten ticks of the timer, and the longest tick that goes with it: one."""
    rig = Rig(300, reload=True).start()
    rule = rig.p.controller.rule
    rule.ramp[:], rule.limit[0] = [10] * len(rule.ramp), 10
    rig.p.controller.instant_ticks = 1
    changes = said(rig, 3100)
    assert sum(pulse for _, pulse, *_ in changes) == rig.timer.pulses == 300


def test_a_place_is_told_when_the_step_to_it_has_begun():
    rig = Rig(20).start()
    rig.r.controller.stop_at = 2
    while not rig.rule.event:
        said(rig, 1)
    assert (rig.position, rig.timer.pulses) == (2, 2)
    acknowledge(rig.rule)
    said(rig, 1100)
    assert rig.position == 3


def test_let_go_the_motor_comes_down_and_rests():
    let_go, deflected = Rig(), Rig()
    for rig in (let_go, deflected):
        rig.joystick(4000)
        said(rig, 5000)
    release(let_go.rule)
    deflect(deflected.p.controller.rule, deflected.rule, 0, 227, 1)
    for rig in (let_go, deflected):
        said(rig, 12_000)
    assert let_go.resting
    assert let_go.rule.snapshot() == deflected.rule.snapshot()


def test_a_fault_is_left_by_a_reset():
    rig = Rig(at=-1).start()
    said(rig, 1)
    assert (rig.rule.state, rig.rule.event) == (FAULT, 1)
    rig.rule.reset = 1
    said(rig, 1)
    assert rig.rule.state == REST
