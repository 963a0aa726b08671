"""`detent live` and `detent connect`, called in this process: what they say, write down and refuse."""

import json
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.live_bench import Bench
from tests.live_processes import live_folder
from typer.testing import CliRunner, Result

import detent
from detent.cli import app
from detent.cli import live as commands
from detent.cli.live import _about
from detent.cli.running import places
from detent.errors import DetentError
from detent.operate.audit import Audit
from detent.operate.channel import Channel
from detent.operate.host import Log
from detent.operate.opening import channel_of, running_channel
from detent.operate.session import Session
from detent.panel.child import PanelPlace
from detent.panel.keys import keep_keys, keys_of, make_keys

pytestmark = pytest.mark.compiled  # it lives in wall time


def call(*words: object) -> Result:
    """A command; what no sentence tells is raised."""
    found = CliRunner().invoke(app, [str(word) for word in words])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


@pytest.fixture
def file(tmp_path: Path) -> Iterator[Path]:
    """An axis file, and a folder of its own for channels."""
    with live_folder(tmp_path) as made:
        yield made / "slide.toml"


class Served:
    """An axis under `detent connect`: in this process, its time passing whenever something waits."""

    def __init__(self, file: Path) -> None:
        self.bench = Bench("filtered_servo")
        self.bench.pass_time(0.1)
        self.channel = Channel(Session(self.bench.host, {"name": "slide"}), channel_of(file), Audit())
        self.channel.start()
        self._left = threading.Event()
        self._time = threading.Thread(target=self._pass_time)
        self._time.start()

    def _pass_time(self) -> None:
        while not self._left.wait(1e-3):
            self.bench.host.run(5)

    def close(self) -> None:
        self._left.set()
        self._time.join()
        self.channel.close()


@pytest.fixture
def served(file: Path) -> Iterator[Served]:
    made = Served(file)
    yield made
    made.close()


def test_an_axis_is_asked_from_a_terminal(file: Path, served: Served) -> None:
    assert "switch on disabled" in call("connect", file).stdout
    assert "not moving: no torque" in call("connect", file).stdout
    for word in ("enable", "confirm"):
        assert call("connect", file, word).exit_code == 0
    begin = served.bench.answer.position
    told = json.loads(call("connect", file, "move_by", "5 mm", "--json").stdout)
    assert (told["ended"]["how"], told["status"]["rests"]) == ("done", True)
    assert told["status"]["position"] == pytest.approx(begin + 5e-3, abs=1e-4)
    assert call("connect", file, "jog", "20 mm/s", "--for", "0.01").exit_code == 0
    beyond = call("connect", file, "move_to", "7 m")
    assert (beyond.exit_code, beyond.stdout, "31" in beyond.stderr) == (1, "", True)
    assert call("connect", file, "move_to", "7 V").exit_code == 2
    assert 'such as "20 mm/s"' in call("connect", file, "jog").stderr


def test_the_selector_is_turned_from_a_terminal(file: Path, served: Served) -> None:
    assert call("connect", file, "selector", "remote").exit_code == 0
    refused = call("connect", file, "enable")
    assert (refused.exit_code, "(116)" in refused.stderr) == (1, True)
    assert "detent connect FILE selector both" in refused.stderr
    assert "only faces command" in call("connect", file).stdout
    assert call("connect", file, "stop").exit_code == 0
    wrong = call("connect", file, "selector", "me")
    assert (wrong.exit_code, "both, local, remote" in wrong.stderr) == (2, True)
    with detent.connect(channel_of(file)) as axis:
        assert axis.select("both").done
        axis.enable()
    assert served.channel.session.selector == "both"


def test_faults_and_the_link_to_the_panel_are_told(file: Path, served: Served) -> None:
    for word in ("enable", "confirm"):
        call("connect", file, word)
    assert call("connect", file, "inject", "encoder stuck").exit_code == 0
    assert call("connect", file, "move_by", "5 mm").exit_code == 1
    assert served.bench.operation.fault
    assert "F02" in call("connect", file, "faults").stdout
    (fault,) = json.loads(call("connect", file, "faults", "--json").stdout)["faults"]
    assert fault["code"] == "F02"
    keep_keys(keys_of(channel_of(file)), "http://127.0.0.1:1", make_keys())
    assert call("connect", file, "link").stdout.startswith("http://127.0.0.1:1/enter?ticket=")


def test_where_no_axis_lives_it_says_how_to_start_one(file: Path) -> None:
    nobody = call("connect", file)
    assert (nobody.exit_code, "detent live" in nobody.stderr) == (1, True)
    assert call("live", file, "--headless", "--period", "5 m").exit_code == 2
    assert call("live", file, "--headless", "--speed", "20").exit_code == 2
    assert "--tls-key" in call("live", file, "--tls-certificate", "a.pem").stderr


@pytest.fixture
def stage(file: Path) -> Path:
    """An axis file with two motors."""
    return Path(shutil.copy(detent.example("stage.toml"), file.with_name("stage.toml")))


def test_what_is_for_one_motor_is_refused_for_two(stage: Path) -> None:
    for more in (("--record", "log"), ("--store", "kept"), ("--drive", "serial:/dev/ttyACM0")):
        refused = call("live", stage, "--headless", *more)
        assert (refused.exit_code, refused.stdout) == (2, "")
        assert f"{more[0]}: got {stage} with the motors x, y; expected: one of them; name it, as --motor x" in (
            " ".join(refused.stderr.split())
        )
    assert "got the motor z; expected: one of x, y" in call("live", stage, "--headless", "--motor", "z").stderr


def test_of_two_motors_that_run_one_is_named(stage: Path) -> None:
    channels = [channel_of(stage, motor) for motor in ("x", "y")]
    assert len({*channels, channel_of(stage)}) == 3
    assert running_channel(stage) == channel_of(stage)
    channels[1].touch()
    assert running_channel(stage) == running_channel(stage, "y") == channels[1]
    channels[0].touch()
    told = call("connect", stage)
    assert (told.exit_code, "x or y; name it with --motor" in " ".join(told.stderr.split())) == (2, True)
    assert running_channel(stage, "x") == channels[0]


def test_panels_of_two_motors_are_side_by_side() -> None:
    pair: Any = (None, None)
    assert [at.port for at in places(PanelPlace(port=8080), pair)] == [8080, 8081]
    assert [at.port for at in places(PanelPlace(), pair)] == [0, 0]


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> dict[int, Callable[..., Any]]:
    """Signals that the command wants to hear."""
    found: dict[int, Callable[..., Any]] = {}
    monkeypatch.setattr(commands.signal, "signal", found.__setitem__)
    return found


def test_an_axis_lives_and_ends_at_rest(file: Path, heard: dict[int, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    log = file.with_name("session.jsonl")
    rounds = iter([False, True])  # once round, then somebody asks for the end
    monkeypatch.setattr(commands.Ending, "wait", lambda *_: next(rounds))
    told = call("live", file, "--headless", "--period", "10 ms", "--record", log)
    assert told.exit_code == 0
    lines = told.stdout.splitlines()
    assert "live, SIMULATION; every 10 ms; switch on disabled" in lines[0]
    assert any(line.startswith("From a second terminal: detent connect") for line in lines)
    assert "At rest at" in lines[-2]
    assert lines[-1].endswith(f"{file.name}.state")
    assert {*heard} == {signal.SIGINT, signal.SIGTERM}
    assert len(Log.read(log.read_text(encoding="ascii").splitlines()).pulled) == 2
    again = call("live", file, "--headless", "--no-store", "--record", log)
    assert (again.exit_code, str(log) in again.stderr) == (1, True)  # a record is not written over


def test_a_program_is_told_in_data(file: Path, heard: dict[int, Any]) -> None:
    told = call("live", file, "--headless", "--no-store", "--period", "10 ms", "--for", "0.01", "--json").stdout
    started, _, ended = told.partition("\n")
    assert json.loads(started)["store"] is None
    assert json.loads(started)["simulated"] is True
    status = json.loads(ended)["ended"]
    assert (status["rests"], status["state"]) == (True, "switch on disabled")
    heard[signal.SIGTERM](signal.SIGTERM, None)  # one that comes late is no trouble


@pytest.mark.usefixtures("heard")
def test_two_motors_live_and_end_at_rest(stage: Path) -> None:
    told = call("live", stage, "--headless", "--no-store", "--period", "10 ms", "--for", "0.01", "--json").stdout
    started, _, ended = told.partition("\n")
    axes = json.loads(started)["axes"]
    assert [axes[motor]["name"] for motor in "xy"] == ["microscope stage, x", "microscope stage, y"]
    assert all(status["rests"] for status in json.loads(ended)["ended"].values())
    lines = call("live", stage, "--headless", "--period", "10 ms", "--for", "0.01").stdout.splitlines()
    assert f"From a second terminal: detent connect {stage} --motor y enable" in "\n".join(lines)
    assert sum(line.startswith(("x: at rest", "y: at rest")) for line in lines) == 2
    assert all(stage.with_name(f"stage.toml.{motor}.state").exists() for motor in "xy")


def test_a_place_in_the_table_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    assert commands._about("edit", "load", "0.2 in") == ["load", "0.2 in"]
    assert commands._about("export", "a.csv", None) == str(Path("a.csv").absolute())
    said: list[str] = []
    monkeypatch.setattr(commands, "tell", said.append)
    row = {"name": "load", "position": 5e-3, "counts": 1000, "taught": "today", "used": "now"}
    commands._show_positions([row], "m", as_json=False)
    assert said == ["load: 5 mm, 1000 counts, taught today, last used now"]
    commands._show_positions([], "m", as_json=False)
    assert "No positions yet" in said[-1]


def test_asked_once_or_often_it_is_heard() -> None:
    ending = commands.Ending()
    assert not ending.wait(0.0)
    for _ in range(1 << 17):  # more than a pipe holds
        ending.ask(2, None)
    assert ending.wait(0.0)


def test_a_stream_is_nothing_for_a_line():
    with pytest.raises(DetentError, match="connect: got stream_position; expected: a command that one line says"):
        _about("stream_position", "1 ms", None)
