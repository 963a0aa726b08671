"""The cascade axis under set-points that somebody sends: where its limits hold, and what a session repeats."""

import hashlib
import os
import subprocess
import sys
from typing import Any

import numba
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench
from tests.places import ROOT
from tests.unit.control.test_operation import Desk

from detent.control import operation as ops
from detent.errors import DRIVEN_OFF, TOO_FAR
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.faults import injection_of
from detent.operate.host import operation_params, repeat

PERIOD = 1e-3


class Streamed(Bench):
    """An enabled axis, and a stream."""

    def __init__(self, *overrides: str) -> None:
        super().__init__("cascade", *overrides)
        self.enable()

    def begin(self, kind: int) -> None:
        """Begin a stream."""
        self.stream = self.host.ask(kind, PERIOD)
        self.host.run(1)

    def send(self, *values: float) -> None:
        """One set-point in each period."""
        for value in values:
            self.host.ask(ops.POINT, value, id=self.stream)
            self.host.run(1)

    def ending(self) -> tuple[int, int]:
        """How the stream has ended, and why."""
        found = self.host.until_ended(self.stream)
        return found.how, found.why


def test_a_session_with_streams_is_repeated_to_the_byte():
    axis = Streamed()
    axis.begin(ops.STREAM_POSITION)
    axis.send(*(axis.answer.commanded + 1e-6 * k * k for k in range(60)))
    axis.host.stop()
    axis.pass_time(0.3)
    axis.begin(ops.STREAM_VELOCITY)
    axis.send(*(1e-3 * k for k in range(50)))
    axis.pass_time(0.4)
    axis.begin(ops.STREAM_EFFORT)
    axis.send(*[0.2] * 30)
    axis.pass_time(0.3)
    axis.begin(ops.STREAM_POSITION)
    here = axis.answer.commanded
    for k in range(40):
        kind = ops.LAST_POINT if k == 39 else ops.POINT_IN_TURN
        axis.host.ask(kind, here + 1e-4 * min(k, 30), id=axis.stream)
    assert axis.ending() == (ops.DONE, 0)
    assert axis.answer.commanded == pytest.approx(here + 3e-3)
    again = Bench("cascade")
    repeat(again.host, axis.host.log, axis.loop.periods)
    assert bytes(again.host.axis.state) == bytes(axis.host.axis.state)
    assert bytes(again.operation) == bytes(axis.operation)


def test_a_stream_of_velocities_rests_at_a_soft_limit():
    axis = Streamed()
    axis.begin(ops.STREAM_VELOCITY)
    axis.send(*(min(2e-3 * k, 0.5) for k in range(1600)))
    assert axis.answer.commanded == pytest.approx(0.5, abs=1e-6)
    assert axis.answer.velocity == pytest.approx(0.0, abs=1e-3)
    assert (axis.operation.fault, axis.operation.running) == (0, axis.stream)
    axis.send(*(-1e-3 * k for k in range(50)))
    assert axis.answer.commanded < 0.5


def test_a_first_set_point_that_is_far_away_is_refused():
    axis = Streamed()
    begin = axis.answer.commanded
    axis.begin(ops.STREAM_POSITION)
    axis.send(begin + 1e-3)  # at 1 m/s
    assert axis.ending() == (ops.REFUSED, TOO_FAR)
    axis.pass_time(0.1)
    assert (axis.answer.commanded, axis.answer.rests, axis.host.state) == (begin, 1, "operation enabled")


def test_an_effort_that_drives_it_away_ends_in_a_ramp_inside_its_limits():
    axis = Streamed()
    axis.begin(ops.STREAM_EFFORT)
    axis.send(*[0.0] * 20)
    assert axis.host.axis.state.lines.command == 0.0
    while axis.operation.running:
        axis.send(-0.3)
    assert axis.ending() == (ops.FAILED, DRIVEN_OFF)
    axis.pass_time(1.0)
    assert (axis.answer.rests, axis.answer.near, axis.host.state) == (1, 1, "operation enabled")
    assert axis.answer.commanded > -1e-6
    assert axis.operation.fault == 0


def test_the_guard_goes_on_under_an_effort():
    axis = Streamed()
    axis.begin(ops.STREAM_EFFORT)
    axis.send(*[0.2] * 20)
    kind, amount = injection_of(axis.host.axis.places, "encoder stuck")
    axis.host.ask(kind, amount)
    while axis.operation.running:
        axis.send(0.6)
    found = axis.host.until_ended(axis.stream)
    assert (found.how, axis.operation.fault) == (ops.FAILED, found.why)
    assert found.why in (1, 2, 11)
    assert axis.host.axis.state.lines.enable == 0


@pytest.mark.parametrize("name", ["rotary_table", "phase_servo", "filtered_servo", "zoom", "print_head"])
def test_methods_that_command_in_pulses_or_positions_of_their_own_refuse(name):
    spec: Any = load_spec(EXAMPLES / f"{name}.toml")
    made: Any = METHODS[spec.axis.method].live(spec, operation_params(), "group_a" if name == "zoom" else "")
    assert [made.live.operation.takes >> kind & 1 for kind in ops.STREAMS] == [0, 0, 0]
    desk = Desk(takes=made.live.operation.takes, look=PERIOD).enabled()
    assert desk.ask(ops.STREAM_POSITION, PERIOD) == desk.last[0]
    assert desk.last[1:3] == (ops.REFUSED, ops.NOT_OFFERED)


@pytest.mark.parametrize(("mode", "offered"), [("torque", [1, 1, 1]), ("velocity", [1, 1, 0]), ("position", [1, 1, 0])])
def test_loops_that_are_closed_elsewhere_are_not_opened(mode, offered):
    made: Any = METHODS["cascade"].wired(load_spec(EXAMPLES / "cascade.toml"), operation_params(), "", mode)[0]
    assert [made.live.operation.takes >> kind & 1 for kind in ops.STREAMS] == offered


def played() -> str:
    """Hash of an axis that was streamed positions, velocities and efforts, each until they were lost."""
    axis = Bench("cascade")
    axis.host.run(3)
    axis.do(ops.ENABLE)
    axis.do(ops.CONFIRM)
    begin = axis.answer.commanded
    for kind, values, left in (
        (ops.STREAM_POSITION, [begin + 1.3e-6 * k * k for k in range(40)], 80),
        (ops.STREAM_VELOCITY, [-1.1e-3 * k for k in range(60)], 80),
        (ops.STREAM_EFFORT, [-0.3] * 60, 60),
    ):
        stream = axis.host.ask(kind, PERIOD)
        axis.host.run(1)
        for value in values:
            axis.host.ask(ops.POINT, value, id=stream)
            axis.host.run(1)
        axis.host.run(left)
        assert axis.host.until_ended(stream).why == ops.LEASE_LOST
    return hashlib.sha256(bytes(axis.host.axis.state) + bytes(axis.operation)).hexdigest()


@pytest.mark.compiled
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares compiled code with plain Python")
def test_plain_python_follows_with_the_same_bits():
    command = "from tests.unit.methods.cascade.test_live_streams import played; print(played())"
    plain = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert plain.stdout.strip() == played(), plain.stderr[-2000:]
