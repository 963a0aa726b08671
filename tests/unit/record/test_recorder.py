from typing import Any

import numpy as np
import pytest
from tests.difference import values_of
from tests.print_head_rig import EXAMPLE

from detent.errors import DetentError
from detent.kernel.registers import Registers, block, f8, i4_array, i8, register, u1
from detent.methods.load import load_spec
from detent.methods.print_head.run import print_head_machine
from detent.methods.print_head.system import TICK, PrintHead
from detent.record import recorder as recorder_module
from detent.record.recorder import Recorder, choose_leaves


class Motor(Registers):
    current: f8 = register("winding current", unit="A")
    mode: u1 = register("bridge mode", unit="code")


class Bench(Registers):
    tick: i8 = register("ticks", unit="tick")
    motor: Motor = block("motor")
    table: i4_array = register("work space", length=4)
    speed: f8 = register("speed", unit="m/s")


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["speed"], ["speed"]),
        (["speed", "motor.current", "speed"], ["speed", "motor.current"]),
        (["motor.*"], ["motor.current", "motor.mode"]),
        (["*.mode"], ["motor.mode"]),
        (["motor.mode", "all"], ["motor.mode", "tick", "motor.current", "speed"]),
        ([], []),
    ],
)
def test_names_and_patterns_choose_registers_once_and_in_order(names: list[str], chosen: list[str]) -> None:
    assert [leaf.path for leaf in choose_leaves(Bench, names)] == chosen


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("motor.curent", "signal 'motor.curent': no such register of Bench; did you mean 'motor.current'?"),
        ("Speed", "did you mean 'speed'?"),
        ("gripper.*", "'all' records every one"),
        ("table", "signal 'table': got an array of 4 values; expected: a register of one value"),
        ("", "no such register"),
    ],
)
def test_what_is_no_register_is_named_with_the_nearest(name: str, says: str) -> None:
    with pytest.raises(DetentError) as caught:
        choose_leaves(Bench, ["speed", name])
    assert says in str(caught.value)


@pytest.mark.parametrize("every", [0, -3])
def test_a_recorder_needs_a_distance_of_rows(every: int) -> None:
    with pytest.raises(DetentError, match=f"got every {every} ticks; expected: 1 or more"):
        Recorder(Bench, ["speed"], every=every, period=1e-3)


def play(recorder: Recorder, ticks: int) -> None:
    """What the compiled loop does: a row at each tick divisible by `every`, at its place in the ring."""
    state = Bench()
    while state.tick < ticks:
        assert recorder.room(state.tick) > 0
        state.tick += 1
        state.motor.current, state.motor.mode, state.speed = 0.1 * state.tick, state.tick, -1.0 / state.tick
        if state.tick % recorder.every == 0:
            memory = np.frombuffer(state.snapshot(), np.uint8)
            recorder.rows[state.tick // recorder.every % len(recorder.rows)] = memory[recorder.picks]
        if recorder.room(state.tick) == 0:
            recorder.flush(state.tick)
    recorder.flush(state.tick)


@pytest.mark.parametrize(("every", "ticks"), [(1, 100), (1, 16), (1, 15), (3, 100), (7, 6), (7, 7), (40, 1000)])
def test_rows_are_whole_in_order_and_at_their_times(monkeypatch: pytest.MonkeyPatch, every: int, ticks: int) -> None:
    monkeypatch.setattr(recorder_module, "ROWS", 16)  # the ring goes round several times
    recorder = Recorder(Bench, ["motor.*", "speed"], every=every, period=1e-3)
    play(recorder, ticks)
    trace = recorder.trace(axis="bench", seed=3)
    expected = np.arange(every, ticks + 1, every)
    np.testing.assert_array_equal(trace.time, expected * 1e-3)
    np.testing.assert_array_equal(trace["motor.current"], 0.1 * expected)
    np.testing.assert_array_equal(trace["motor.mode"], expected.astype(np.uint8))
    np.testing.assert_array_equal(trace["speed"], -1.0 / expected)
    assert trace["motor.mode"].dtype == np.uint8
    assert trace.attributes == {"axis": "bench", "seed": 3}


def test_the_declaration_gives_units_and_meanings() -> None:
    recorder = Recorder(Bench, ["motor.current", "tick"], every=1, period=1e-3)
    trace = recorder.trace()
    assert trace.units == {"t": "s", "motor.current": "A"}
    assert trace.docs == {"t": "simulated time since power-on", "motor.current": "winding current"}
    assert len(trace) == 0


def test_blocks_go_to_the_sink_and_not_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "ROWS", 16)
    blocks: list[Any] = []
    recorder = Recorder(Bench, ["speed"], every=1, period=1e-3)
    recorder.pass_on(blocks.append, 0)
    play(recorder, 50)
    assert sum(len(found) for found in blocks) == 50
    assert max(len(found) for found in blocks) <= 16
    assert all(found.dtype == recorder.dtype for found in blocks)
    assert len(recorder.trace()) == 0


@pytest.mark.parametrize("every", [1, 10])
def test_a_recorded_axis_shows_its_registers_as_they_were(every: int) -> None:
    spec = load_spec(
        EXAMPLE, ["disturbance.push.force=20 N", "disturbance.push.at=0 s", "disturbance.push.duration=9 s"]
    )
    names = ["plant.train.position", "plant.train.velocity", "controller.head.state", "plant.encoder.edge"]
    recorder = Recorder(PrintHead, names, every=every, period=TICK)
    recorded, stepped = print_head_machine(spec, recorder), print_head_machine(spec)
    recorded.pass_time(200 * TICK)
    recorded.close()
    trace = recorder.trace()
    assert len(trace) == 200 // every
    for row in range(len(trace)):
        stepped.pass_time(every * TICK)
        values = values_of(stepped.state)
        assert trace.time[row] == stepped.time
        assert {name: trace[name][row] for name in names} == {name: values[name] for name in names}
    assert trace["plant.train.velocity"][-1] > 0
    assert recorded.state.snapshot() == stepped.state.snapshot()
