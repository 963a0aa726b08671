"""The loop with every method in it: under a hand, and with something wrong between machine and wires."""

import ctypes
from functools import cache
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_axes import Head, Stepper
from tests.live_bench import MOVED, Bench

from detent.control import operation as ops
from detent.control.operation import ABORTED, DONE, REFUSED
from detent.methods.load import load_spec
from detent.methods.print_head.print_job import parse_text
from detent.methods.registry import METHODS
from detent.operate.faults import injection_of
from detent.operate.host import Host, repeat
from detent.operate.session import Session
from detent.plant.injection import KIND_NAMES


def enabled(name: str) -> Bench:
    """An axis as soon as it can be moved: plain steps of one are slow."""
    axis = Bench(name)
    while not axis.answer.ready:
        axis.host.run(1)
    axis.do(ops.ENABLE)
    axis.do(ops.CONFIRM)
    assert axis.host.state == "operation enabled"
    state: Any = axis.host.axis.state
    while name == "phase_servo" and not state.controller.sequencer.ready:  # drawn to the nearest positioning point
        axis.host.run(1)
    return axis


@pytest.mark.parametrize("name", ["cascade", "rotary_table", "filtered_servo"])
def test_a_hand_jogs_stops_moves_and_lets_go(name):
    axis = enabled(name)
    velocity, begin = 0.1 * axis.host.axis.speed, axis.answer.commanded
    for way in (1, -1):
        jog = axis.host.ask(ops.JOG, way * velocity)
        axis.pass_time(0.03)
        assert axis.answer.commanded_velocity * way > 0.0
        axis.host.stop()
        assert axis.host.until_ended(jog).how == ABORTED
        while not axis.answer.rests:
            axis.host.run(1)
    assert abs(axis.answer.commanded - begin) < 0.1 * velocity
    beyond = axis.do(ops.MOVE_BY, 1e3)
    assert (beyond.how, beyond.why) == (REFUSED, ops.BEYOND if name in MOVED else ops.NOT_OFFERED)
    if name in MOVED:
        assert axis.do(ops.MOVE_BY, 10 * axis.grain).how == DONE
    axis.host.off()
    axis.host.run(2)
    assert axis.host.state == "switch on disabled"
    again = Bench(name)
    repeat(again.host, axis.host.log, axis.loop.periods)
    assert bytes(again.host.axis.state) == bytes(axis.host.axis.state)


def test_a_phase_servo_moves_stops_and_lets_go():
    axis = enabled("phase_servo")
    move = axis.host.ask(ops.MOVE_BY, 4e-3)
    axis.host.run(5)
    assert axis.answer.velocity != 0.0
    axis.host.stop()
    assert axis.host.until_ended(move).how == ABORTED
    axis.host.run(5)
    assert axis.host.axis.memory.target < 4e-3 / axis.grain
    axis.host.off()
    axis.host.run(2)
    assert axis.host.state == "switch on disabled"
    assert axis.host.axis.state.lines.enable == 0


# ---- something wrong


class Moving:
    """A moment of an axis under way, and what its machine and its lines are a few periods later."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self._parts: list[Any] = [host.axis.state, host.board, host.axis.memory]
        self._held = [bytes(part) for part in self._parts]
        self._heard = host._read, host._noted, host._pulls

    def go_back(self) -> None:
        """Be again as at this moment."""
        for part, held in zip(self._parts, self._held, strict=True):
            ctypes.memmove(ctypes.addressof(part), held, len(held))
        self.host._read, self.host._noted, self.host._pulls = self._heard

    def after(self, periods: int, text: str = "nothing") -> bytes:
        """Machine and lines after so many periods with something wrong."""
        self.go_back()
        kind, amount = injection_of(self.host.axis.places, text)
        self.host.ask(kind, amount)
        state: Any = self.host.axis.state
        seen = b""
        for _ in range(periods):
            self.host.run(1)
            seen += bytes(state.lines) + bytes(state.plant)
        return seen


@cache
def head() -> Moving:
    """The print head, which has measured itself: seconds of its time."""
    return Moving(Head().host)


@cache
def moving(name: str) -> tuple[Moving, ...]:
    """An axis under way at the moments at which a fault is tried; a motor also just before it turns."""
    if name == "print_head":
        host = head().host
    else:
        made: Any = Stepper() if name == "zoom" else enabled(name)
        host = made.host
    if name == "phase_servo":
        host.ask(ops.MOVE_BY, 1e-3)
        host.run(3)
        return (Moving(host),)
    host.ask(ops.JOG, 0.5 * host.axis.speed)
    host.run(60)
    return (Moving(host), about_to_turn(host)) if name == "zoom" else (Moving(host),)


def about_to_turn(host: Host) -> Moving:
    """A line of the direction that is stuck shows only where that changes."""
    state: Any = host.axis.state
    host.ask(ops.JOG, -host.axis.speed)
    while True:
        made = Moving(host)
        host.run(1)
        if state.lines.direction < 0:
            return made


AXES = {"cascade": "cascade", "rotary_table": "rotary_table", "phase_servo": "phase_servo",
        "filtered_servo": "filtered_servo", "zoom": "stepper_envelope", "print_head": "print_head"}  # fmt: skip


LATE = {("zoom", "direction slow"), ("zoom", "direction delayed")}
"""By less than the time from a turn to the next pulse: it does no harm."""


def faults_of(name: str) -> list[tuple[str, str]]:
    """Every place of an axis with each of its kinds."""
    spec = load_spec(EXAMPLES / f"{name}.toml", ())
    host = Host(METHODS[AXES[name]], spec, motor="group_a" if name == "zoom" else "", wall=False)
    return [(name, f"{at} {KIND_NAMES[kind]}") for at, place in host.axis.places.items() for kind in place.kinds]


@pytest.mark.parametrize(("name", "text"), [one for name in AXES for one in faults_of(name)])
def test_a_fault_reaches_the_lines_or_the_machine_and_repeats_itself(name, text):
    periods = 1 if name == "phase_servo" else 20
    for axis in moving(name):
        axis.go_back()
        disturbed, true = axis.after(periods, text), axis.after(periods)
        assert disturbed == axis.after(periods, text)
        if disturbed != true:
            return
    assert (name, text) in LATE


def test_a_head_prints_a_line_and_moves_on():
    host = head().host
    head().go_back()
    memory: Any = host.axis.memory
    assert host.until_ended(host.work(parse_text("a line"))).how == DONE
    assert host.job is not None
    (line,) = host.job.result().lines
    assert (memory.done, line.missed) == (1, 0)
    assert line.columns > 20
    place = host.board.operation.answer.position
    assert host.until_ended(host.ask(ops.MOVE_BY, 5e-3, 0.2)).how == DONE  # slower than it runs by itself
    assert abs(host.board.operation.answer.position - place - 5e-3) < 1.1e-3


def test_an_error_beside_the_loop_brings_the_axis_to_rest_for_good(tmp_path, monkeypatch):
    """A thread that ends in an error is a fault (54), told with what it was, and written down."""
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    bench = Bench("cascade").enable()
    move = bench.host.ask(ops.MOVE_BY, 0.2)
    bench.pass_time(0.2)

    def work() -> None:
        raise RuntimeError("injected")

    bench.host.supervised(work)()
    bench.pass_time(0.5)
    ending = bench.host.ending(move)
    assert ending is not None
    assert (ending.how, ending.why) == (ops.FAILED, 54)
    assert (bench.host.state, bench.answer.rests, bench.host.axis.state.lines.enable) == ("fault", 1, 0)
    assert bench.do(ops.RESET).how == ops.DONE
    assert bench.do(ops.ENABLE).why == 54
    session = Session(bench.host, {})
    assert "RuntimeError: injected" in session.status()["barred"]["text"]
    assert session.faults()[0]["allowed"] == []
    (report,) = tmp_path.glob("*.error")
    assert "RuntimeError: injected" in report.read_text(encoding="utf-8")
