"""Live specification, section 8: the panel under load, killed, and fed with anything (41, 52 to 54)."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import httpx
import numba
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.live_panel import Browser, PanelRig, Socket
from websockets.exceptions import ConnectionClosed

import detent
from detent.panel.app import RULES
from detent.panel.keys import ROLES

pytestmark = [pytest.mark.compiled, pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop that is compiled")]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PanelRig]:
    """A panel whose axis stands still, but takes what is asked."""
    with PanelRig(tmp_path_factory.mktemp("load")) as made:
        yield made


def flood(socket: Socket) -> None:
    """Ask without end."""
    while True:
        socket.dialled.send('{"do": "confirm"}')


def test_52_a_client_that_floods_is_put_out_and_others_are_served(rig: PanelRig) -> None:
    with rig.browser("operator").socket() as other, rig.browser("operator").socket() as flooding:
        stops = rig.bench.loop.stops
        for _ in range(200):  # stops are never counted
            flooding.dialled.send('{"do": "stop"}')
        with pytest.raises(ConnectionClosed) as closed:
            flood(flooding)
        assert "status" in other.ask(do="status")
        assert "id" in other.ask(do="stop")
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008
    assert rig.bench.loop.stops == stops + 201
    asked = [one for one in rig.audit.recent()["records"] if one.get("do") == "confirm"]
    assert 50 <= len(asked) < 150


# ---- any request

TEXT = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=30)
PATHS = st.one_of(
    st.sampled_from([path for path in RULES if path != "/ws"]),
    st.builds(lambda path, more: f"{path}/{more}", st.sampled_from(["/static", "/api", "/enter", ""]), TEXT),
)
QUERIES = st.one_of(
    st.just(""),
    TEXT.map(lambda text: f"?{text}"),
    st.builds(lambda c, f: f"?channels={c}&first={f}", TEXT, st.one_of(TEXT, st.integers().map(str))),
    TEXT.map(lambda text: f"?ticket={text}"),
)
HEADERS = st.dictionaries(
    st.sampled_from(["accept", "cookie", "origin", "range", "if-none-match", "if-modified-since", "x-csrf-token",
                     "content-type", "sec-fetch-site", "accept-encoding", "x-forwarded-for", "upgrade"]),
    TEXT, max_size=4,
)  # fmt: skip
METHODS = st.sampled_from(["GET", "POST", "HEAD", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"])


def answer(rig: PanelRig, method: str, path: str, headers: dict[str, str], body: bytes) -> int:
    """Status of a request as it is, valid or not; 0 where the connection was closed on it."""
    asked = HTTPConnection("127.0.0.1", rig.port, timeout=10.0)
    try:
        asked.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            asked.putheader(name, value)
        asked.endheaders(body)
        return asked.getresponse().status
    except (OSError, ValueError):
        return 0
    finally:
        asked.close()


def anything(rig: PanelRig, examples: int) -> None:
    """Ask anything, as anybody."""
    found: dict[int, int] = {}

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(METHODS, PATHS, QUERIES, HEADERS, st.sampled_from(["", *ROLES]), st.binary(max_size=200))
    def ask(method: str, path: str, query: str, headers: dict[str, str], role: str, body: bytes) -> None:
        known = {"host": f"127.0.0.1:{rig.port}", "content-length": str(len(body))}
        if role:
            name, value = next(iter(rig.cookie(role).items()))
            who = rig.panel.keys.read(value, "cookie")
            assert who is not None
            known |= {"cookie": f"{name}={value}", "origin": rig.base, "x-csrf-token": rig.panel.keys.form_mark(who)}
        status = answer(rig, method, path + query, known | headers, body)
        found[status] = found.get(status, 0) + 1
        assert status < 500

    ask()
    assert {200, 401, 403, 404, 405} <= set(found)


def test_53_no_request_makes_the_panel_fail(rig: PanelRig) -> None:
    anything(rig, 300)


@pytest.mark.wide
def test_53_no_request_of_thousands_makes_the_panel_fail(rig: PanelRig) -> None:
    anything(rig, 500 * len(RULES))


# ---- processes


STARTED: list[subprocess.Popen[str]] = []  # also by a test that fails


class Live:
    """`detent live` with its panel, in processes of their own."""

    def __init__(self, folder: Path, *more: str) -> None:
        self.file = folder / "slide.toml"
        shutil.copy(detent.example("filtered_servo.toml"), self.file)
        folder.chmod(0o700)
        command = [sys.executable, "-m", "detent", "live", str(self.file), *more]
        self.environment = os.environ | {"XDG_RUNTIME_DIR": str(folder)}
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=self.environment)
        STARTED.append(self.process)
        assert self.process.stdout is not None
        self.out = self.process.stdout

    def panel_id(self) -> int:
        """Process of the panel."""
        found = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text(encoding="ascii").split()
        panels = [pid for pid in found if "detent.panel" in Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")]
        return int(panels[0])

    def end(self) -> str:
        """Ctrl-C; what it says."""
        self.process.send_signal(signal.SIGINT)
        out, _ = self.process.communicate(timeout=30)
        return out


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Where channels lie."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        yield tmp_path
    while STARTED:
        one = STARTED.pop()
        if one.poll() is None:
            one.kill()
            one.communicate()


def entered(link: str) -> Browser:
    """Follow a link."""
    base = link.partition("/enter")[0]
    browser = Browser(base, "", {})
    assert browser.http.get(link).status_code == 303
    return browser


@pytest.mark.process
def test_54_the_links_are_printed_and_ctrl_c_ends_both_processes(folder: Path) -> None:
    live = Live(folder, "--period", "10 ms", "--viewer-link")
    said: list[str] = []
    while not said or "Ctrl-C" not in said[-1]:
        said.append(live.out.readline())
    text = "".join(said)
    assert "SIMULATION; every 10 ms; switch on disabled." in text
    links = [word for line in said for word in line.split() if word.startswith("http://127.0.0.1:")]
    assert len(links) == 2
    pages = [entered(link) for link in links]
    assert ['content="engineer"' in pages[0].http.get("/").text, 'content="viewer"' in pages[1].http.get("/").text] == [
        True, True,
    ]  # fmt: skip
    another = subprocess.run(
        [sys.executable, "-m", "detent", "connect", str(live.file), "link", "operator"],
        capture_output=True, text=True, check=True, env=live.environment,
    ).stdout  # fmt: skip
    third = entered(another.strip())
    assert third.http.get("/api/describe").json()["name"]
    panel = live.panel_id()
    assert "torque off" in live.end()
    assert live.process.returncode == 0
    assert not Path(f"/proc/{panel}").exists()
    assert list(folder.glob("detent/*.keys")) == []
    records = [json.loads(line) for line in live.file.with_name("slide.toml.audit").read_text("utf-8").splitlines()]
    assert [record["note"] for record in records if "note" in record] == ["enters"] * 3
    for page in (*pages, third):
        page.http.close()


@pytest.mark.process
def test_41_a_killed_panel_stops_the_jog_and_comes_back(folder: Path) -> None:
    live = Live(folder, "--period", "10 ms", "--json")
    browser = entered(json.loads(live.out.readline())["panel"][0])
    with detent.connect(live.file) as watcher, suppress(ConnectionClosed), browser.socket() as socket:
        for word in ("enable", "confirm"):
            asked = socket.ask(do=word)["id"]
            while socket.until("ended")["ended"]["id"] != asked:
                pass
        socket.ask(do="jog", value="20 mm/s")
        while watcher.status["rests"]:
            pass
        os.kill(live.panel_id(), signal.SIGKILL)
        begin = time.monotonic()
        while (status := watcher.status)["running"] or not status["rests"]:
            assert time.monotonic() - begin < 20.0
        assert status["client"] == 0
        assert status["fault"] is None
    for _ in range(500):  # it comes back at the same address, and the cookie still serves
        with suppress(httpx.TransportError):
            if browser.http.get("/").status_code == 200:
                break
        threading.Event().wait(0.02)
    assert browser.http.post("/stop", headers={"origin": "null"}).status_code == 200
    browser.http.close()
    live.end()
    assert live.process.returncode == 0


@pytest.mark.wide
@pytest.mark.process
def test_52_stop_is_quick_while_another_client_floods(folder: Path) -> None:
    """A thousand malformed frames, then ten thousand commands a second: beside each, stops of another page."""
    live = Live(folder, "--period", "10 ms", "--json")
    browser = entered(json.loads(live.out.readline())["panel"][0])
    cookies = json.dumps(dict(browser.http.cookies))
    with browser.socket() as socket, detent.connect(live.file) as watcher:
        # The reference: two processes that compute beside it, as the flood and the panel that reads it do.
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
        idle, late_idle = stops(socket, watcher)
        for one in busy:
            one.kill()
            one.wait()
        for kind in ("malformed", "commands"):
            tried = [flooded(browser, cookies, kind, socket, watcher) for _ in range(3)]  # other tests run beside it
            assert min(under for under, _ in tried) < max(0.05, 4.0 * idle), (idle, tried)
            assert min(late for _, late in tried) <= 1.5 * late_idle + 0.02, (late_idle, tried)
            assert "status" in socket.ask(do="status")
    browser.http.close()
    live.end()
    assert live.process.returncode == 0


def flooded(browser: Any, cookies: str, kind: str, socket: Socket, watcher: Any) -> tuple[float, float]:
    """Stops beside a flood."""
    flood = subprocess.Popen(
        [sys.executable, "-m", "tests.live_flood", browser.base, cookies, browser.form_mark(), kind],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert flood.stdout is not None
    assert flood.stdout.readline() == "floods\n"
    found = stops(socket, watcher)
    told = json.loads(flood.communicate(timeout=60)[0])
    assert told["sent"] >= (1000 if kind == "malformed" else 5_000)
    return found


def stops(socket: Socket, watcher: Any) -> tuple[float, float]:
    """Stops for two seconds: the time in which 99 of 100 were answered [s], and the share of periods skipped."""
    taken: list[float] = []
    before, begin = watcher.status["loop"], time.monotonic()
    while time.monotonic() - begin < 2.0:
        at = time.perf_counter()
        assert "id" in socket.ask(do="stop")
        taken.append(time.perf_counter() - at)
        threading.Event().wait(0.005)
    after = watcher.status["loop"]
    share = (after["skipped"] - before["skipped"]) / max(1, after["periods"] - before["periods"])
    return float(np.quantile(taken, 0.99)), share


# ---- for long


def resident(*processes: int) -> int:
    """Memory that processes hold [bytes]."""
    pages = [int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) for pid in processes]
    return sum(pages) * os.sysconf("SC_PAGE_SIZE")


def soak(folder: Path, warm: float, seconds: float) -> dict[str, float]:
    """Jogs, moves, a page with eight channels, and others that come and go; growth of memory after `warm` [1]."""
    live = Live(folder, "--period", "10 ms", "--json")
    browser, left = entered(json.loads(live.out.readline())["panel"][0]), threading.Event()
    processes, held, rounds, begin = (live.process.pid, live.panel_id()), 0, 0, time.monotonic()
    with browser.socket() as socket, browser.socket() as page, detent.connect(live.file) as axis:
        names = [one["name"] for one in axis.about["channels"] if one["name"] != "periods"][:8]
        page.ask(do="watch", rate=25, channels=names)

        def read() -> None:
            while not left.is_set():
                page.until("status")

        reader = threading.Thread(target=read)
        reader.start()
        for word in ("take", "enable", "confirm"):
            socket.ask(do=word)
        while (passed := time.monotonic() - begin) < warm + seconds:
            socket.ask(do="jog", value="20 mm/s" if rounds % 2 else "-20 mm/s")
            for _ in range(10):
                left.wait(0.05)
                socket.ask(do="keep")
            socket.ask(do="stop")
            socket.ask(do="move_to", value="30 mm")
            assert browser.http.get("/").status_code == 200
            with detent.connect(live.file) as other:
                assert other.status["fault"] is None
            rounds += 1
            held = held or (resident(*processes) if passed > warm else 0)
        grown = resident(*processes) / held - 1.0
        left.set()
        reader.join()
        status = axis.status
    browser.http.close()
    live.end()
    assert live.process.returncode == 0
    return {"grown": grown, "fault": status["fault"], "rounds": rounds, "skipped": status["loop"]["skipped"],
            "periods": status["loop"]["periods"]}  # fmt: skip


@pytest.mark.wide
@pytest.mark.process
def test_57_memory_does_not_grow(folder: Path) -> None:
    found = soak(folder, 20.0, 20.0)
    assert found["grown"] < 0.02
    assert found["fault"] is None
    assert found["rounds"] > 20


@pytest.mark.long
@pytest.mark.process
def test_57_memory_does_not_grow_for_half_an_hour(folder: Path) -> None:
    found = soak(folder, 60.0, 1800.0)
    assert found["grown"] < 0.01
    assert found["fault"] is None
    assert found["rounds"] > 1500
