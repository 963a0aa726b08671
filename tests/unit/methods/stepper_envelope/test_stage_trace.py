"""Steps as a trace shows them, on a made-up trace: every step, its frequency and what it asks for are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import motor_move, record

import detent
from detent.control.step_rule import ACCEL, REST, TURN
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.build import make_step_ramp
from detent.methods.stepper_envelope.stage_trace import (
    Leg,
    arc_of,
    envelope_of,
    legs_of,
    made_steps,
    step_torques,
)
from detent.record.trace import Trace

MM = 1e-3


@pytest.fixture(scope="module")
def table():
    return load_spec(detent.example("zoom.toml")).stepper["group_a"]


def trace_of(rows: list[tuple[int, int, int, int, int]], *, every: int = 1) -> Trace:
    """A row per millisecond: position, direction, period [µs], ramp index, state."""
    names = (
        "controller.rule.position",
        "controller.rule.direction",
        "controller.timer.period",
        "controller.rule.index",
        "controller.rule.state",
    )
    columns = {"t": 1e-3 * np.arange(len(rows))}
    columns |= {f"a.{name}": np.array(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)}
    return Trace(columns={name: values[::every] for name, values in columns.items()})


def there_and_back(ramp: np.ndarray) -> list[tuple[int, int, int, int, int]]:
    """Ten steps up and six down from 100, two rows for each step, with a pause between."""
    rows = [(100, 1, 0, -1, REST)]
    for count, sign, first in ((10, 1, 100), (6, -1, 110)):
        for n in range(1, count + 1):
            index = min(n - 1, count - n)
            rows += [(first + sign * n, sign, round(1e6 / ramp[index]), index, ACCEL)] * 2
        rows.append((first + sign * count, -sign, 2476, -1, TURN if sign > 0 else REST))
    rows[-1] = (104, -1, 0, -1, REST)
    return rows


@pytest.fixture(scope="module")
def played(table):
    ramp = make_step_ramp(table).hz
    trace = trace_of(there_and_back(ramp))
    motor = motor_move(start=table.position_of(100), stop=table.position_of(104), arrived=1.0)
    return ramp, made_steps(trace, "a", 1e6), record(1, a=motor), motor


def test_every_step_is_found_once(played) -> None:
    ramp, made, _, _ = played
    assert made.position.tolist() == [*range(101, 111), *range(109, 103, -1)]
    assert made.direction.tolist() == [1] * 10 + [-1] * 6
    assert made.index.tolist() == [0, 1, 2, 3, 4, 4, 3, 2, 1, 0, 0, 1, 2, 2, 1, 0]
    assert made.hz[0] == 1e6 / round(1e6 / ramp[0])


def test_a_pause_is_no_step_though_a_period_runs(table) -> None:
    rows = there_and_back(make_step_ramp(table).hz)
    made = made_steps(trace_of(rows, every=7), "a", 1e6)
    states = trace_of(rows, every=7)["a.controller.rule.state"]
    assert set(made.position) <= {*range(101, 111), *range(103, 110)}
    assert len(made.t) < int(np.count_nonzero(states == ACCEL)) + 1


def test_registers_that_were_not_recorded_are_missed(played, table) -> None:
    trace = trace_of(there_and_back(make_step_ramp(table).hz))
    without = {name: values for name, values in trace.columns.items() if name != "a.controller.timer.period"}
    assert made_steps(Trace(columns=without), "a", 1e6) is None
    assert made_steps(trace, "b", 1e6) is None
    bare = {name: values for name, values in trace.columns.items() if not name.endswith(("index", "state"))}
    made = made_steps(Trace(columns=bare), "a", 1e6)
    assert made is not None
    assert made.index is None
    assert made.position.tolist() == played[1].position.tolist()


def test_runs_go_from_rest_to_turn_to_rest(played, table) -> None:
    _, made, move, motor = played
    legs = legs_of(made, table, move, motor)
    assert [(leg.direction, leg.start, leg.stop) for leg in legs] == [(1, 100, 110), (-1, 110, 104)]
    late = replace(motor, arrived=-1.0)
    assert legs_of(made, table, move, late) == []


def test_an_arc_begins_and_ends_at_rest(played, table) -> None:
    ramp, made, move, motor = played
    up, down = (arc_of(leg, table, 100) for leg in legs_of(made, table, move, motor))
    assert up.position[[0, -1]].tolist() == pytest.approx([0.5 * MM, 0.55 * MM])
    assert down.position[[0, -1]].tolist() == pytest.approx([0.55 * MM, 0.52 * MM])
    # A step stands in the middle of its interval, whichever way it is gone.
    assert up.position[1] == pytest.approx(table.position_of(100) + 0.5 * table.step)
    assert down.position[1] == pytest.approx(table.position_of(110) - 0.5 * table.step)
    assert (up.hz[0], up.hz[-1], down.direction) == (0.0, 0.0, -1)
    assert up.hz.max() == pytest.approx(ramp[4], rel=2e-3)


def test_a_long_arc_keeps_the_corners_of_its_ramps(table) -> None:
    ramp = make_step_ramp(table).hz
    index = np.concatenate((np.arange(228), np.full(3000, 227), np.arange(227, -1, -1)))
    rows = [(1 + n, 1, round(1e6 / ramp[k]), int(k), ACCEL) for n, k in enumerate(index)]
    made = made_steps(trace_of(rows), "a", 1e6)
    arc = arc_of(Leg(made, 0, len(rows)), table, 120)
    assert 100 <= len(arc.hz) <= 130
    top = arc.position[arc.hz == arc.hz.max()] / table.step
    assert (top[0], top[-1]) == (pytest.approx(226, abs=3), pytest.approx(3229, abs=3))
    drawn = np.interp(np.arange(1.0, 200), arc.position / table.step, arc.hz)
    np.testing.assert_allclose(drawn, np.interp(np.arange(1.0, 200), np.arange(228) + 0.5, ramp), rtol=0.05)


def test_the_envelope_of_the_travel_knows_its_zones_and_ends(table) -> None:
    found = envelope_of(table)

    def at(place: float) -> tuple[float, float]:
        row = int(np.searchsorted(found.position, place, side="right")) - 1
        return found.up[row], found.down[row]

    start = make_step_ramp(table).hz[0]
    assert found.position[0] == 0.0
    assert found.position[-1] == pytest.approx(40 * MM)
    assert at(0.0) == at(39.9999 * MM) == (start, start)
    assert at(20 * MM) == (4000.0, 4000.0)
    assert at(11 * MM) == at(27 * MM) == (1000.0, 1000.0)
    assert (found.up[-1], found.down[-1]) == (0.0, 0.0)
    assert len(found.position) < 1500  # not a point per step


def test_the_envelope_of_a_move_ends_at_its_extremes(played, table) -> None:
    ramp, made, move, motor = played
    found = envelope_of(table, legs_of(made, table, move, motor))
    steps = np.round(found.position / table.step).astype(int)

    def at(step: int, half: np.ndarray) -> float:
        return float(half[np.searchsorted(steps, step, side="right") - 1])

    assert [at(n, found.up) for n in (99, 100, 104, 109, 110)] == [0.0, ramp[0], ramp[4], ramp[0], 0.0]
    assert [at(n, found.down) for n in (103, 104, 106, 107, 109, 110)] == [0, ramp[0], ramp[2], ramp[2], ramp[0], 0]


def test_a_move_one_way_permits_nothing_the_other(played, table) -> None:
    _, made, move, motor = played
    found = envelope_of(table, legs_of(made, table, move, motor)[:1])
    assert found.up.max() > 0
    assert not found.down.any()


def test_torques_are_those_of_the_ramp_not_of_its_rounded_periods(played, table) -> None:
    ramp, made, move, motor = played
    found = step_torques(table, legs_of(made, table, move, motor))
    assert found is not None
    hz, available, needed = found
    assert hz.tolist() == pytest.approx([ramp[k] for k in made.index])
    # J theta a + friction: 1.013e-6 kg m^2, 1.8 deg, 40 000 steps/s^2, 6 mN m.
    accelerating, braking = 1.013e-6 * np.pi / 100 * 40e3 + 6e-3, -1.013e-6 * np.pi / 100 * 40e3 + 6e-3
    assert needed[:5].tolist() == pytest.approx([6e-3, *[accelerating] * 4], rel=1e-5)
    assert needed[6:11].tolist() == pytest.approx([*[braking] * 4, 6e-3], rel=1e-4)
    assert available[4] == pytest.approx(45e-3 / np.sqrt(1 + (ramp[4] / 1200) ** 2))


def test_steps_between_two_rows_are_filled_in(played, table) -> None:
    """With every third row left, f^2 rises as evenly as it did."""
    ramp, _, move, motor = played
    rows = there_and_back(ramp)[:21]
    made = made_steps(trace_of(rows, every=3), "a", 1e6)
    ending = replace(motor, stop=table.position_of(110))
    found = step_torques(table, legs_of(made, table, move, ending))
    assert found is not None
    assert len(found[0]) == 10
    assert found[0][2] == pytest.approx(ramp[2], rel=0.02)


def test_an_operator_goes_by_a_frequency_of_his_own(table) -> None:
    """Index 5 of the ramp is 746 Hz; asked for are 700 Hz."""
    rows = [(1 + n, 1, 1429, 5, ACCEL) for n in range(20)]
    made = made_steps(trace_of(rows), "a", 1e6)
    found = step_torques(table, [Leg(made, 0, 20)])
    assert found is not None
    assert found[0] == pytest.approx(np.full(20, 1e6 / 1429))


def test_without_ramp_indices_there_are_no_torques(played, table) -> None:
    _, made, move, motor = played
    legs = legs_of(replace(made, index=None), table, move, motor)
    assert step_torques(table, legs) is None
    assert step_torques(table, [Leg(made.between(0, 0.003), 100, 100)]) is None
