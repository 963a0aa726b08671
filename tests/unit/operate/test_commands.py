"""`detent live` and `detent connect` as processes; `detent.live` and `detent.connect` in Python."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import pytest

import detent
from detent.errors import AxisError, DetentError
from detent.operate.channel import MOST_CLIENTS
from detent.operate.host import Log, repeat
from detent.operate.session import Session
from detent.operate.start import make_host
from detent.operate.words import CommandError, CommandFailedError, CommandRefusedError

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop in wall time"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """An axis file, and a folder of its own for channels."""
    made = tmp_path_factory.mktemp("live")
    shutil.copy(detent.example("filtered_servo.toml"), made / "slide.toml")
    made.chmod(0o700)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(made))
        yield made


class Running:
    """`detent live` in another process."""

    def __init__(self, file: Path, *more: str) -> None:
        command = [sys.executable, "-m", "detent", "live", str(file), "--json", *more]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.started: dict[str, Any] = json.loads(self.process.stdout.readline())

    def end(self, number: int = signal.SIGINT) -> dict[str, Any]:
        """Interrupt it; what it says at its end."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=30)
        assert self.process.returncode == 0
        assert all(line.startswith("First run") for line in err.splitlines())
        return json.loads(out)["ended"]


@pytest.fixture
def running(folder: Path) -> Iterator[Running]:
    """The axis live."""
    # Other tests want the processors, too.
    one = Running(folder / "slide.toml", "--headless", "--no-store", "--period", "10 ms")
    yield one
    if one.process.poll() is None:
        one.process.kill()
        one.process.communicate()


def run(*args: str) -> subprocess.CompletedProcess[str]:
    """A command in another process."""
    return subprocess.run([sys.executable, "-m", "detent", *args], capture_output=True, text=True, check=False)


def test_54_56_an_axis_runs_until_it_is_interrupted_and_others_move_it(folder: Path, running: Running) -> None:
    file = str(folder / "slide.toml")
    assert running.started["simulated"] is True
    assert running.started["state"] == "switch on disabled"
    assert running.started["period"] == 1e-2
    with detent.connect(file) as axis:
        assert axis.about["name"]
        axis.enable()
        axis.confirm()
        at = axis.position
        axis.move_by("5 mm")
        assert axis.position == pytest.approx(at + 5e-3, abs=1e-4)
    told = run("connect", file, "--json")
    assert told.returncode == 0
    status = json.loads(told.stdout)["status"]
    assert (status["state"], status["client"]) == ("operation enabled", 0)
    assert status["position"] == pytest.approx(at + 5e-3, abs=1e-4)
    refused = run("connect", file, "move_to", "7 m")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "31" in refused.stderr
    assert run("connect", file, "move_to", "7 V").returncode == 2
    with detent.connect(file) as axis:  # interrupted while it moves: at rest before it ends
        axis.do("jog", "50 mm/s", wait=False)
        ended = running.end()
    assert ended["rests"] is True
    assert ended["state"] == "switch on disabled"
    assert run("connect", file).returncode == 1


def test_55_a_second_one_on_the_same_axis_is_refused(folder: Path, running: Running) -> None:
    second = run("live", str(folder / "slide.toml"), "--headless", "--for", "0")
    assert (second.returncode, second.stdout) == (1, "")
    assert str(running.process.pid) in second.stderr
    running.end(signal.SIGTERM)


def test_18_a_jog_of_a_killed_program_stops_within_its_lease(folder: Path, running: Running) -> None:
    """SIGSTOP: the connection stays, nobody keeps the jog."""
    script = (
        "import sys, time, detent\n"
        "axis = detent.connect(sys.argv[1])\n"
        "axis.enable(); axis.confirm()\n"
        "with axis.jog('20 mm/s'):\n"
        "    print('jogs', flush=True)\n"
        "    time.sleep(60)\n"
    )
    file = folder / "slide.toml"
    program = subprocess.Popen([sys.executable, "-c", script, str(file)], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    assert program.stdout.readline() == "jogs\n"
    with detent.connect(file) as watcher:
        while watcher.status["rests"]:
            pass
        os.kill(program.pid, signal.SIGSTOP)
        while watcher.status["running"]:
            pass
        status = watcher.status
        while not status["rests"]:
            status = watcher.status
        assert status["fault"] is None
        os.kill(program.pid, signal.SIGKILL)
        program.communicate()
        while watcher.status["client"]:  # its right to command ends with it
            pass
    running.end()


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
    assert run("connect", file, "inject", "encoder stuck").returncode == 0
    wrong = run("connect", file, "inject", "nobody")
    assert (wrong.returncode, "encoder off, stuck" in wrong.stderr) == (2, True)
    with detent.connect(file) as axis:
        axis.enable()
        axis.confirm()
        with pytest.raises(CommandFailedError):
            axis.move_by("5 mm")
    told = run("connect", file, "faults")
    assert told.returncode == 0
    assert "F02" in told.stdout
    (fault,) = json.loads(run("connect", file, "faults", "--json").stdout)["faults"]
    assert fault["code"] == "F02"
    running.end()


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
    running.end()


def test_28_a_recorded_session_is_done_again_at_a_desk(folder: Path) -> None:
    file, log = folder / "slide.toml", folder / "session.jsonl"
    one = Running(file, "--headless", "--no-store", "--period", "10 ms", "--record", str(log))
    with detent.connect(file) as axis:
        axis.enable()
        axis.confirm()
        axis.move_by("5 mm")
        with axis.jog("-30 mm/s"):
            while axis.status["rests"]:
                pass
    ended = one.end()
    again, _ = make_host(file, wall=False, period=1e-2)
    repeat(again, Log.read(log.read_text(encoding="ascii").splitlines()), ended["loop"]["periods"])
    status = Session(again, {}).status()
    assert {k: v for k, v in status.items() if k != "loop"} == {k: v for k, v in ended.items() if k != "loop"}
    assert len(again.log.pulled) == 3  # the jog's, and two at the end
    assert run("live", str(file), "--headless", "--for", "0", "--record", str(log)).returncode == 1


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


def test_33_a_killed_process_leaves_a_position_that_is_not_known(folder: Path) -> None:
    file = folder / "kept.toml"
    shutil.copy(folder / "slide.toml", file)
    first = Running(file, "--period", "10 ms")
    assert first.started["trust"] == "referenced"
    with detent.connect(file) as axis:
        axis.enable()
        axis.do("jog", "10 mm/s", wait=False)
    first.process.kill()
    first.process.communicate()
    second = Running(file, "--period", "10 ms")
    assert second.started["trust"] == "unknown"
    assert "in motion when it was last seen" in second.started["store"]["position"]
    with detent.connect(file) as axis:
        axis.do("trust", 2)
    ended = second.end()
    assert ended["trust"] == "referenced"
    assert ended["store"]["trouble"] == ""
    told = run("live", str(file), "--for", "0")
    assert told.returncode == 0
    assert str(file) + ".state" in told.stdout
    assert f"detent connect {file}" in told.stdout.splitlines()[-4]


def test_46_the_position_table_from_a_second_terminal(folder: Path) -> None:
    file = folder / "places.toml"
    shutil.copy(folder / "slide.toml", file)
    live = Running(file, "--period", "10 ms")
    assert "No positions yet" in run("connect", str(file), "positions").stdout
    assert run("connect", str(file), "teach", "3").stdout.startswith("3: 20 mm, 4000 counts")
    assert run("connect", str(file), "edit", "load", "0.2 in").returncode == 0
    table = json.loads(run("connect", str(file), "positions", "--json").stdout)["positions"]
    assert [(row["name"], row["number"], row["counts"]) for row in table] == [("3", 3, 4000), ("load", None, 1016)]
    assert run("connect", str(file), "export", str(folder / "places.csv")).returncode == 0
    missing = run("connect", str(file), "go_to", "lode")
    assert (missing.returncode, missing.stdout) == (2, "")
    assert "load" in missing.stderr
    live.end()


def test_signals_that_come_all_at_once_end_it(running: Running) -> None:
    """A second Ctrl-C while the first was heeded waited for itself for ever, and the axis stayed live."""
    for number in (signal.SIGINT, signal.SIGTERM) * 50:
        running.process.send_signal(number)
    assert running.end()["state"] == "switch on disabled"
