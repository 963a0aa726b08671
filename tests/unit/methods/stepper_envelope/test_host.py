import numpy as np
import pytest

from detent import examples
from detent.control.step_rule import start_move
from detent.methods.load import read_axis
from detent.methods.stepper_envelope.build import instant
from detent.methods.stepper_envelope.host import Stage, stage_registers
from detent.plant.stepper_rotor import lost_steps
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled

ZOOM = next(path for path in examples() if path.name == "zoom.toml")
SIGNALS = [
    "group_a.controller.rule.position",
    "group_a.plant.rotor.lag",
    "group_b.controller.rule.position",
    "group_b.controller.timer.period",
]


@pytest.fixture(scope="module")
def spec():
    return read_axis(ZOOM).spec


def short_moves(stage: Stage) -> None:
    """Both motors, of different lengths."""
    for name, steps in (("group_a", 60), ("group_b", 35)):
        motor = stage.motors[name]
        motor.tables.up.move_stop(steps)
        start_move(motor.controller.rule, 1, 0)


def test_registers_carry_the_names_of_the_motors(spec):
    paths = [leaf.path for leaf in stage_registers(spec).leaves()]
    assert paths[0] == "tick"
    assert {"group_a.controller.rule.position", "group_b.plant.rotor.lag"} <= set(paths)
    assert stage_registers(spec) is stage_registers(spec)


def test_a_wait_ends_with_the_last_motor(spec):
    stage = Stage(spec)
    short_moves(stage)
    assert stage.wait_for(stage.motors, 5.0) == set()
    a, b = stage.motors.values()
    assert (a.position, b.position) == (60, 35)
    assert a.r.tick == b.r.tick == stage.instant
    assert b.rested < a.rested == pytest.approx(stage.time, abs=2 * stage.tick)
    assert [lost_steps(one.p.plant.rotor, one.r.plant.rotor) for one in (a, b)] == [0, 0]
    assert a.resting
    assert b.resting


def test_a_wait_gives_up(spec):
    stage = Stage(spec)
    short_moves(stage)
    assert stage.wait_for(["group_a"], 0.01) == {"group_a"}
    assert stage.time == pytest.approx(0.01)
    assert {motor.r.tick for motor in stage.motors.values()} == {stage.instant}


def test_a_motor_runs_as_if_it_were_alone(spec):
    """Acceptance tests 28 and 29, on whole axes: the registers of one motor do not know of the other."""
    both, alone = Stage(spec), Stage(spec)
    short_moves(both)
    alone.motors["group_a"].tables.up.move_stop(60)
    start_move(alone.motors["group_a"].controller.rule, 1, 0)
    for stage in (both, alone):
        stage.wait_for(["group_a"], 5.0)
        stage.pass_time(0.01)
    one, other = both.motors["group_a"].r, alone.motors["group_a"].r
    assert bytes(one) == bytes(other)


def recorded(spec, every: int, rooms: int) -> np.ndarray:
    blocks: list[np.ndarray] = []
    recorder = Recorder(stage_registers(spec), SIGNALS, every=every, period=instant(spec))
    recorder.pass_on(blocks.append, 0)
    stage = Stage(spec, recorder)
    short_moves(stage)
    stage.wait_for(stage.motors, 5.0)
    for _ in range(rooms):
        stage.pass_time(0.013)
    stage.flush()
    return np.concatenate(blocks)


def test_a_record_holds_both_motors_at_the_same_times(spec):
    rows = recorded(spec, 50, 3)
    assert np.allclose(np.diff(rows["t"]), 50 * instant(spec))
    assert rows["group_a.controller.rule.position"][-1] == 60
    assert rows["group_b.controller.rule.position"][-1] == 35
    assert (np.diff(rows["group_a.controller.rule.position"].astype(int)) >= 0).all()
    assert np.abs(rows["group_a.plant.rotor.lag"]).max() > 0.5


def test_a_long_record_is_that_of_many_flushes(spec):
    """More rows than the recorder keeps: none is lost, doubled or mixed up."""
    rows = recorded(spec, 2, 6)
    numbers = np.rint(rows["t"] / (2 * instant(spec))).astype(int)
    assert len(rows) > 2 * 16384
    assert numbers.tolist() == list(range(1, len(rows) + 1))
    coarse = recorded(spec, 50, 6)
    fine = {round(t, 9): row for t, row in zip(rows["t"], rows, strict=True)}
    assert all(fine[round(row["t"], 9)].tobytes() == row.tobytes() for row in coarse if round(row["t"], 9) in fine)


def test_the_same_run_gives_the_same_bytes(spec):
    assert recorded(spec, 50, 1).tobytes() == recorded(spec, 50, 1).tobytes()
