"""`detent live` and `detent connect` as processes; `detent.live` and `detent.connect` in Python."""

import asyncio
import json
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import pytest
from tests.live_processes import Running, connect, live_folder, run

import detent
from detent.errors import AxisError, DetentError
from detent.operate.channel import MOST_CLIENTS
from detent.operate.host import Log, repeat
from detent.operate.start import make_host
from detent.operate.words import CommandError, CommandFailedError, CommandRefusedError

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop in wall time"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """An axis file, and a folder of its own for channels."""
    with live_folder(tmp_path) as made:
        yield made


@pytest.fixture
def running(folder: Path) -> Running:
    """The axis live."""
    # Other tests want the processors, too.
    return Running(folder / "slide.toml", "--headless", "--no-store", "--period", "10 ms")


def test_the_words_of_the_api_block_and_can_be_awaited(folder: Path) -> None:
    with detent.live(folder / "slide.toml", wall=False, store=None) as axis:
        assert [what for what, _ in axis.why_not_moving] == [
            "no torque: switch on disabled",
        ]
        axis.enable()
        assert axis.why_not_moving[0][1] == "look at it, then confirm"
        axis.confirm()
        assert axis.why_not_moving == [("nothing has been asked of it", "jog, or move to a position")]
        at = axis.position

        async def there_and_back() -> None:
            await axis.move_by("2 mm", wait=False)
            await axis.move_by(-0.002, wait=False)

        asyncio.run(there_and_back())
        assert axis.position == pytest.approx(at, abs=1e-5)
        seen = next(axis.telemetry())
        assert seen.state == "operation enabled"
        with pytest.raises(CommandRefusedError) as refused:
            axis.move_to("9 m")
        assert (refused.value.code, refused.value.exit_status) == (31, 1)
        assert refused.value.remedy
        long = axis.move_by("100 mm", wait=False)
        axis.stop()
        with pytest.raises(CommandRefusedError, match="a stop came after"):  # no time passes between the two
            long.wait()
        with pytest.raises(CommandError, match="105"):
            axis.go_to(3)
        assert "operation enabled" in repr(axis)
    with pytest.raises(DetentError, match=r"0\.1 to 10"):
        detent.live(folder / "slide.toml", speed=20.0)


def test_a_fault_is_injected_told_and_ended(folder: Path) -> None:
    with detent.live(folder / "slide.toml", wall=False) as axis:
        assert "inject" in axis.about["commands"]
        assert "stuck" in axis.about["injections"]["encoder"]
        axis.enable()
        axis.confirm()
        axis.inject("encoder stuck")
        with pytest.raises(CommandFailedError, match="sensor did not move"):
            axis.move_by("5 mm")
        (fault,) = axis.faults
        assert (fault["code"], fault["position"]) == ("F02", "lost")
        axis.inject("nothing")
        axis.reset()
        axis.enable()
        with pytest.raises(CommandRefusedError, match="35"):
            axis.move_to("20 mm")
        axis.confirm()
        axis.move_by("1 mm")
        trace = axis.link.fault_trace(1)  # type: ignore[attr-defined]
        assert trace["time"][0] < 0.0 < trace["time"][-1]
        with pytest.raises(DetentError, match="slide blocked, push"):
            axis.inject("encoder broken")


def test_faults_are_injected_and_read_from_a_second_terminal(folder: Path, running: Running) -> None:
    file = str(folder / "slide.toml")
    assert connect(file, "inject", "encoder stuck").returncode == 0
    wrong = connect(file, "inject", "nobody")
    assert (wrong.returncode, "encoder off, stuck" in wrong.stderr) == (2, True)
    with detent.connect(file) as axis:
        axis.enable()
        axis.confirm()
        with pytest.raises(CommandFailedError):
            axis.move_by("5 mm")
    told = connect(file, "faults")
    assert told.returncode == 0
    assert "F02" in told.stdout
    (fault,) = json.loads(connect(file, "faults", "--json").stdout)["faults"]
    assert fault["code"] == "F02"
    running.ended()


@pytest.mark.parametrize("value", [None, True, "5", "5 V", "x", [1], {}, "nan mm"])
def test_a_value_that_makes_no_sense_is_told(folder: Path, value: Any) -> None:
    with (
        detent.live(folder / "slide.toml", wall=False, store=None) as axis,
        pytest.raises(DetentError, match="such as"),
    ):
        axis.move_to(value)


@pytest.mark.parametrize("period", ["1 us", "1 s", "5", "x"])
def test_a_period_that_no_loop_has_is_refused(folder: Path, period: str) -> None:
    refused = run("live", str(folder / "slide.toml"), "--period", period)
    assert (refused.returncode, refused.stdout) == (2, "")


def test_what_nobody_waits_for_is_noted_all_the_same(folder: Path) -> None:
    """The loop keeps the last 256 endings; a program that only asks lost those before."""
    with detent.live(folder / "slide.toml", wall=False, store=None) as axis:
        session: Any = axis.link
        asked = []
        for _ in range(600):
            asked.append(session.ask("keep"))
            session.host._run(1)
        assert all(session.ending(command) for command in asked)
        assert len(session.host.log.asked) == 600


def test_a_client_too_many_is_told(folder: Path, running: Running) -> None:
    file = folder / "slide.toml"
    others = [detent.connect(file) for _ in range(MOST_CLIENTS)]
    with pytest.raises(AxisError, match=f"{MOST_CLIENTS} clients"):
        detent.connect(file)
    others[0].close()
    while True:  # until the channel has noticed
        try:
            detent.connect(file).close()
            break
        except AxisError:
            continue
    for one in others[1:]:
        one.close()
    running.ended()


def test_a_log_in_wall_time_holds_the_last_requests(folder: Path) -> None:
    log = Log()
    log.bound(3)
    for k in range(5):
        log.add_pull(k)
    assert (list(log.pulled), log.dropped) == ([2, 3, 4], 2)
    host, _ = make_host(folder / "slide.toml", wall=False)
    with pytest.raises(DetentError, match="--record"):
        repeat(host, log, 10)


def test_how_a_command_of_long_ago_ended_is_not_known(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.operate.host.KEPT", 20)
    with detent.live(folder / "slide.toml", wall=False) as axis:
        session: Any = axis.link
        asked = [session.ask("stop") for _ in range(50)]
        session.host.run(10)
        assert session.ending(asked[-1]).how == "done"
        assert len(session.host._ended) == 20
        with pytest.raises(DetentError, match="long ago"):
            session.ending(asked[0])


def test_a_command_that_still_runs_has_not_ended_long_ago(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.operate.host.KEPT", 20)
    with detent.live(folder / "slide.toml", wall=False) as axis:
        axis.enable()
        session: Any = axis.link
        jog = session.ask("jog", "1 mm/s")
        for _ in range(60):
            session.ask("keep")
            session.host.run(1)
        assert session.ending(jog) is None
        assert session.host._forgotten > jog


def test_a_stop_for_which_the_mailbox_has_no_room_is_done(folder: Path) -> None:
    with detent.live(folder / "slide.toml", wall=False) as axis:
        session: Any = axis.link
        for _ in range(1024):
            session.ask("keep")
        with pytest.raises(BlockingIOError):
            session.ask("keep")
        stops, offs = session.host.board.loop.stops, session.host.board.loop.offs
        asked = [session.ask("stop"), session.ask("disable")]
        assert (session.host.board.loop.stops, session.host.board.loop.offs) == (stops + 1, offs + 1)
        assert [session.ending(command).how for command in asked] == ["done", "done"]
        session.host.run(100)


def test_an_axis_that_nobody_runs_is_told(folder: Path) -> None:
    with pytest.raises(AxisError, match="detent live"):
        detent.connect(folder / "nobody.toml")


def test_signals_that_come_all_at_once_end_it(running: Running) -> None:
    """A second Ctrl-C while the first was heeded waited for itself for ever, and the axis stayed live."""
    for number in (signal.SIGINT, signal.SIGTERM) * 50:
        running.process.send_signal(number)
    assert running.ended()["state"] == "switch on disabled"


def test_set_points_are_played_in_turn_and_end_at_the_last_one() -> None:
    with detent.live(detent.example("cascade.toml"), wall=False) as axis:
        axis.enable()
        axis.confirm()
        way = [0.02 + 1e-7 * min(k, 100) ** 2 for k in range(300)]
        axis.stream(way)
        stream = axis.link.host.board.operation.stream  # pyright: ignore[reportAttributeAccessIssue]
        assert (stream.taken, stream.late, stream.dropped) == (300, 0, 0)
        assert axis.position == pytest.approx(0.021, abs=2e-6)
        axis.stream([0.01] * 60, of="velocity", period="2 ms")
        assert axis.position == pytest.approx(0.021 + 60 * 2e-3 * 0.01, abs=1e-4)
        under_way = axis.do("stream_position", "1 ms", wait=False)
        axis.link.points(under_way.id, [axis.position] * 50, in_turn=True)
        axis.link.host.run(5)  # pyright: ignore[reportAttributeAccessIssue]
        axis.stop()
        with pytest.raises(CommandError) as ended:
            under_way.wait()
        assert ended.value.args[0].startswith("stream_position aborted")


@pytest.mark.parametrize(
    ("period", "told"),
    [
        ("0.5 ms", "a stream with a set-point every 500 us; expected: 1 ms, the period of the loop, to 1 s"),
        (2.0, "a stream with a set-point every 2 s; expected: 1 ms"),
        ("3 mm", "'3 mm' is not a value such as \"1 ms\""),
        (float("inf"), "a stream with a set-point every inf"),
        (None, 'a command with nothing; it needs a value such as "1 ms"'),
    ],
)
def test_what_is_no_interpolation_period_is_said(period: object, told: str) -> None:
    with detent.live(detent.example("cascade.toml"), wall=False) as axis, pytest.raises(DetentError) as refused:
        axis.do("stream_position", period)
    assert str(refused.value).startswith(told)


def test_set_points_that_are_none_are_told_and_those_of_nobody_change_nothing() -> None:
    with detent.live(detent.example("cascade.toml"), wall=False) as axis:
        axis.enable()
        axis.confirm()
        for wrong in ("x", [True], [float("nan")], [1e12], [None]):
            with pytest.raises(DetentError, match=r"points: got .*; expected: numbers below 1e\+12"):
                axis.link.points(3, wrong)  # type: ignore[arg-type]
        with pytest.raises(DetentError, match="points: got -1; expected a whole number"):
            axis.link.points(-1, [0.0])
        before = axis.position
        assert axis.link.points(99, [0.1]) == 1
        axis.link.host.run(5)  # pyright: ignore[reportAttributeAccessIssue]
        assert axis.position == pytest.approx(before, abs=2e-6)
        assert axis.link.host.board.operation.stream.dropped == 1  # pyright: ignore[reportAttributeAccessIssue]


def test_another_process_plays_set_points_over_the_channel(tmp_path: Path) -> None:
    with live_folder(tmp_path) as made:
        file = made / "axis.toml"
        file.write_text(Path(detent.example("cascade.toml")).read_text(encoding="utf-8"), encoding="utf-8")
        Running(file, "--headless", "--no-store", "--period", "10 ms")
        with detent.connect(file) as axis:
            axis.enable()
            axis.confirm()
            begin = axis.position
            axis.stream([begin + 1e-5 * min(k, 100) for k in range(150)], period="10 ms")
            assert axis.position == pytest.approx(begin + 1e-3, abs=1e-5)
            assert axis.link.points(1, [0.0] * 2) == 2  # type: ignore[attr-defined]
