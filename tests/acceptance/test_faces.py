"""Faces specification, section 3: clients that are not ours, each in an environment of its own.

What each of them needs to be told is what `detent live` prints.
"""

import json
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import httpx
import numba
import numpy as np
import pytest
from tests import foreign, page_session
from tests.cyclic_rig import NODE, Cycle, between, following_errors, master_of, stepped
from tests.face_rig import (
    Faced,
    connected,
    drive_on_virtual,
    faced,
    family,
    free_port,
    listening,
    repeater,
    wire,
)
from tests.places import ROOT

import detent
from detent.control import operation as ops
from detent.faces.child import FACES
from detent.faces.set_points import SetPoints
from detent.methods.cascade.build import motion_limits
from detent.methods.load import read_axis
from detent.planning.profile import plan_move

pytestmark = [
    pytest.mark.early,
    pytest.mark.compiled,
    pytest.mark.process,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a loop in wall time"),
]

GRAIN = 0.002  # what a position may differ by: two counts of the encoder and the window [mm]
LINES = ("--scpi", ":0", "--grbl", "pty", "--gcs", ":0", "--zaber", ":0", "--alpaca", ":0", "--modbus", ":0")
NAMES = LINES[::2]


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Faced]:
    """The cascade axis with all that needs no extra library but pymodbus."""
    pytest.importorskip("pymodbus")
    with faced(tmp_path_factory.mktemp("lines"), *LINES) as live:
        yield live


@pytest.fixture
def axis(lines: Faced) -> Faced:
    """The same at 20 mm, enabled by nobody, commanded by nobody."""
    with connected(lines) as own:
        own.do("take")
        if own.status["fault"]:
            own.reset()
        own.enable()
        own.confirm()
        own.move_to("20 mm")
        own.disable()
    return lines


def near(position: float, target: float, within: float = GRAIN * 5) -> bool:
    """In the window of the axis, which is 0.05 mm wide at most."""
    return abs(position - target) <= max(within, 0.05)


# ---- line protocols


def judge_scpi(found):
    assert found["identity"].startswith("detent,cascade axis,cascade,")
    assert (int(found["power_on"]) & 128, found["unit"]) == (128, "MM")
    assert tuple(map(float, found["limits"].split(","))) == (0.0, 500.0)
    assert (found["moving"], found["complete"]) == ("1", "1")
    assert found["took"] > 0.1  # after arrival, not at once
    assert near(found["position"], 60.0)
    assert near(found["by"], 65.0)
    done, place = found["second"].split(";")
    assert (done, near(float(place), 61.0)) == ("1", True)
    assert found["errors"] == [-113, -109, -104, -108, -222, -222, -113, -222]
    assert found["status"] == 4
    assert found["events"] & (32 | 16) == 48
    assert 61.0 < found["stopped"] < 300.0
    assert sorted(found["round_trips"])[100] < 0.02


def test_23_pyvisa_over_a_socket(axis):
    judge_scpi(foreign.run("visa", "scpi", axis.place("scpi")))


@pytest.mark.wide
def test_23_pyvisa_over_a_serial_terminal(tmp_path):
    with faced(tmp_path, "--scpi", "pty") as live:
        judge_scpi(foreign.run("visa", "scpi", live.place("scpi")))


def test_24_grbl_streamer(axis):
    found = foreign.run("grbl", "grbl", axis.place("grbl"))
    assert found["errors"] == []
    assert near(found["position"], 57.0)
    assert 80.0 < found["held"] < 250.0
    assert found["held"] == pytest.approx(found["held_later"], abs=0.05)
    assert near(found["resumed"], 260.0)
    assert found["alarm"] == ["ALARM:3"]
    assert 60.0 < found["reset_at"] < 240.0
    assert found["reset_at"] == pytest.approx(found["reset_later"], abs=0.05)
    assert (found["reset_mode"], found["unlocked"]) == ("Alarm", "Idle")


def test_25_pipython(axis):
    found = foreign.run("pi", "gcs", axis.port("gcs"))
    assert found["axes"] == ["1"]
    assert (found["without_servo"], found["servo"], found["referenced"]) == (5, True, True)
    assert found["under_way"] is False
    assert near(found["position"], 60.0)
    assert (found["target"], found["on_target"]) == (60.0, True)
    assert near(found["by"], 57.5)
    assert (found["low"], found["high"], found["limit"], found["too_fast"], found["unknown"]) == (0.0, 500.0, 7, 8, 2)
    assert found["speed"] == 40.0
    assert 57.5 < found["stopped"] < 120.0
    assert not found["moving"]


def test_26_zaber_motion(axis):
    found = foreign.run("zaber", "zaber", axis.port("zaber"))
    assert near(found["home"] * 1e-3, 10.8, 0.9)  # 0.8 mm behind the switch, which is 10 mm from the end
    assert near(found["position"] * 1e-3, 100.0)
    assert not found["busy"]
    assert near(found["by"] * 1e-3, 98.5)
    assert (found["beyond"], found["nonsense"]) == ("BADDATA", "BADCOMMAND")
    assert (found["under_way"], found["velocity_busy"]) == (True, True)
    assert 98.5 < found["stopped"] * 1e-3 < 300.0
    assert 3.0 < (found["after_velocity"] - found["stopped"]) * 1e-3 < 20.0
    assert found["checksums"]


def judge_alpaca(found, kind):
    assert found["versions"] == [1]
    (device,) = found["devices"]
    assert (device["DeviceType"], device["DeviceNumber"]) == (kind, 0)
    assert found["not_connected"] == found["left"] == "NotConnectedException"
    assert found["moving"] is True
    assert found["still"] is False
    assert (found["transaction"], found["server"]) == (77, True)
    # What is no request is HTTP 400; what the device cannot do is an error of ASCOM.
    wrong = ("wrong_case", "no_number", "unknown", "bad_mark", "not_a_number", "flag")
    assert [found[name] for name in wrong] == [400] * len(wrong)


def test_27_alpyca_focuser(axis):
    found = foreign.run("alpaca", "alpaca", axis.place("alpaca"), "focuser")
    judge_alpaca(found, "Focuser")
    assert (found["absolute"], found["max"], found["size"], found["comp"]) == (True, 500_000, 1.0, False)
    assert near(found["position"] * 1e-3, 70.0)
    assert found["temperature"] == "NotImplementedException"
    assert found["action"] == "ActionNotImplementedException"
    assert 70_000 < found["halted"] < found["far"]


@pytest.mark.wide
def test_27_alpyca_rotator(tmp_path):
    with faced(tmp_path, "--alpaca", ":0", example="turntable.toml") as live:
        found = foreign.run("alpaca", "alpaca", live.place("alpaca"), "rotator")
    judge_alpaca(found, "Rotator")
    assert found["reverse"] is False
    assert found["position"] == pytest.approx(90.0, abs=0.1)
    assert found["mechanical"] == pytest.approx(90.0, abs=0.1)
    assert found["target"] == 90.0
    assert found["by"] == pytest.approx(80.0, abs=0.1)
    assert found["beyond"] == "InvalidValueException"
    assert found["synced"] == [pytest.approx(45.0, abs=0.1), pytest.approx(80.0, abs=0.1)]


# ---- Modbus

IDENTITY, POSITION, SEQUENCE = 0, 16, 23


def poll(axis: Faced, *words: str) -> subprocess.CompletedProcess[str]:
    """mbpoll of Debian, once, with addresses as they are sent."""
    program = foreign.program("mbpoll", "mbpoll")
    command = [program, "-m", "tcp", "-p", axis.port("modbus"), "-0", "-1", "-q", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def polled(axis: Faced, address: int, *kind: str) -> int:
    """One value that mbpoll has read."""
    out = poll(axis, "-r", str(address), *kind, "127.0.0.1").stdout
    (line,) = [line for line in out.splitlines() if line.startswith(f"[{address}]")]
    return int(line.split()[1])


def test_19_mbpoll(axis):
    assert polled(axis, IDENTITY) == 0x4454
    assert near(polled(axis, POSITION, "-B", "-t", "4:int") * 1e-3, 20.0)
    beat, sequence = 0, polled(axis, SEQUENCE)

    def written(address: int, *values: int, kind: tuple[str, ...] = ()) -> bool:
        done = poll(axis, "-r", str(address), *kind, "127.0.0.1", "--", *map(str, values))
        return "Written" in done.stdout

    def commanded(command: int, target: int = 0) -> int:
        nonlocal beat, sequence
        sequence, beat = sequence % 60_000 + 1, beat + 1
        assert written(42, target, kind=("-B", "-t", "4:int"))
        assert written(40, beat, command)
        assert written(46, sequence)
        begin = time.monotonic()
        while polled(axis, SEQUENCE) != sequence or polled(axis, SEQUENCE + 1) == 1:
            beat += 1
            assert written(40, beat)
            assert time.monotonic() - begin < 20.0
        return polled(axis, SEQUENCE + 1)

    assert commanded(1) == 2
    assert commanded(7, 35_000) == 2
    assert near(polled(axis, POSITION, "-B", "-t", "4:int") * 1e-3, 35.0)
    refused = poll(axis, "-r", str(POSITION), "127.0.0.1", "7")
    assert "Illegal data address" in refused.stderr  # exception 2


def test_20_modbus_serial(axis):
    folder = foreign.npm(foreign.NPM)
    script = Path(__file__).parents[1] / "clients" / "modbus-serial.js"
    words = [foreign.program("node", "nodejs"), str(script), axis.port("modbus")]
    done = subprocess.run(
        [*words, str(folder / "node_modules" / "modbus-serial")],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    found = json.loads(done.stdout)
    assert (found["identification"], found["enabled"], found["moved"]) == (0x4454, [2, 0], [2, 0])
    assert near(found["position"] * 1e-3, 45.0)
    assert found["exception"] == 2


def test_20_pymodbus(axis):
    found = foreign.run("modbus", "modbus", axis.port("modbus"), "hand-shake")
    assert found["identification"][:4] == [0x4454, 1, 0, 1000]
    assert found["maker"] == "detent"
    assert (found["enabled"], found["moved"], found["beyond"]) == ([2, 0], [2, 0], [4, 31])
    assert near(found["position"] * 1e-3, 60.0)
    assert near(found["by"][1] * 1e-3, 58.0)
    assert (found["read_only"], found["no_address"], found["no_value"], found["no_function"]) == (2, 2, 3, 1)


def test_21_no_command_without_a_heartbeat(axis):
    time.sleep(0.8)  # what a test before has said is no heartbeat any more
    found = foreign.run("modbus", "modbus", axis.port("modbus"), "silent")
    assert found["enable"] == [4, 121]
    assert found["stop"] == [2, 0]
    assert found["moving"]
    assert 0.1 < found["rest"] < 1.0
    assert found["end"] < 100_000
    assert found["result"][0] == 3


def test_21_a_jog_lasts_as_long_as_the_heartbeat(axis):
    found = foreign.run("modbus", "modbus", axis.port("modbus"), "jog")
    assert found["velocity"] == pytest.approx(20_000, rel=0.05)
    assert abs(found["after"]) < 200


FRAMES = 100_000


def fuzzed(random: Random) -> bytes:
    """A frame that is nearly one: lengths, functions, counts and addresses that do not fit, and noise."""
    body = random.choice(
        (
            random.randbytes(random.randrange(12)),
            bytes([random.randrange(256)]) + random.randbytes(4),
            struct.pack(
                ">BHH",
                random.choice((1, 2, 3, 4, 5, 6, 15, 16, 22, 23, 43)),
                random.randrange(70),
                random.randrange(200),
            ),
            struct.pack(">BHHB", 16, random.randrange(60), random.randrange(130), random.randrange(256))
            + random.randbytes(4),
            struct.pack(">BHH", 6, 40, random.randrange(65536)),
        )
    )
    length = len(body) + 1 if random.random() < 0.9 else random.randrange(300)
    return (
        struct.pack(">HHHB", random.randrange(65536), int(random.random() < 0.02), length, random.randrange(256)) + body
    )


@pytest.mark.wide
def test_22_fuzzed_frames_disturb_nobody(axis):
    random, sent = Random(22), 0
    with connected(axis) as own:
        before = own.status["loop"]
        while sent < FRAMES:
            with socket.create_connection(("127.0.0.1", int(axis.port("modbus")))) as one:
                one.settimeout(0.0)
                for _ in range(2_000):
                    try:
                        one.sendall(fuzzed(random))
                    except (BlockingIOError, ConnectionError):
                        break
                    sent += 1
                    with suppress(BlockingIOError, ConnectionError):
                        one.recv(1 << 16)
            if random.random() < 0.1:
                found = foreign.run("modbus", "modbus", axis.port("modbus"), "look")
                assert found["identification"][0] == 0x4454
        after = own.status["loop"]
        assert own.status["fault"] is None
        assert after["overruns"] - before["overruns"] <= 0.01 * (after["periods"] - before["periods"])
    assert Path(f"/proc/{axis.process_of('modbus')}").exists()


# ---- EPICS

RECORD = "lab:m1"
TYPES = {
    "enum": "CNEN DIR FOFF HHSV HLSV HSV LLSV LOCK LSPG LSV NTM OMSL RMOD SET SEVR SPMG STAT STUP UEIP URIP",
    "string": "DESC DINP DOL EGU INIT NAME OUT POST PREM RDBL RINP RLNK RTYP STOO",
    "short": "ATHM CARD CDIR DMOV FOF HLS HOMF HOMR IGSET JOGF JOGR LLS LVIO MIP MISS MOVN NTMF PP PREC RCNT RHLS RLLS "
    "RTRY SSET STOP SUSE SYNC TDIR TWF TWR VOF",
    "double": "ACCL ADEL ALST BACC BDST BVEL DCOF DHLM DIFF DLLM DLY DRBV DVAL ERES HIGH HIHI HLM HOPR HVEL ICOF JAR "
    "JVEL LDVL LLM LOLO LOPR LOW LRLV LVAL MDEL MLST MRES OFF PCOF RBV RDBD RLV RRES S SBAK SBAS SMAX TWV UREV VAL "
    "VBAS VELO VMAX",
    "float": "FRAC VERS",
    "long": "LRVL MMAP MSTA NMAP RDIF REP RMP RRBV RVAL RVEL SREV",
}
"""Fields of the record (motorRecord.dbd) by their type; what is unsigned there is served as a signed word."""
NUMBERS = {"string": 0, "short": 1, "float": 2, "enum": 3, "long": 5, "double": 6}  # of Channel Access


@dataclass
class Epics:
    """An axis with both records, and what their clients are told."""

    live: Faced

    def told(self, face: str) -> dict[str, str]:
        """Environment of a client, as it is printed."""
        return dict(word.split("=") for word in self.live.place(face, 1).split())

    def run(self, face: str, script: str, *words: str) -> dict[str, Any]:
        """A client."""
        return foreign.run("epics", script, *words, **self.told(face))


@pytest.fixture(scope="module")
def epics(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Epics]:
    """The cascade axis as a motor record."""
    pytest.importorskip("caproto")
    pytest.importorskip("p4p")
    places = [f"{RECORD}@:{free_port()}" for _ in range(2)]
    options = "--epics", places[0], "--pva", places[1]
    with repeater(), faced(tmp_path_factory.mktemp("epics"), *options) as live:
        yield Epics(live)


WINDOW = 0.05  # of the example, limits.travel / 10000 [mm]


@pytest.mark.parametrize("layer", ["pyepics", pytest.param("caproto", marks=pytest.mark.wide)])
def test_01_ophyd_epics_motor(epics, layer):
    found = epics.run("epics", "ophyd_motor", RECORD, layer, "moves")
    assert found["connected"] < 10.0
    assert (found["limits"], found["unit"], found["speed"]) == ([0.0, 500.0], "mm", 500.0)
    assert found["success"]
    assert near(found["position"], 60.0)
    assert (found["limit"], found["after_limit"]) == ("LimitError", 60.0)
    assert 0.01 < found["null"] < 2.0
    assert found["moving"]
    assert 60.0 < found["stopped"] < 400.0
    assert found["stop"] == 0
    assert found["set_point"] == pytest.approx(found["stopped"], abs=WINDOW)
    assert near(found["again"], 20.0)


@pytest.mark.parametrize(("face", "scheme"), [("epics", "ca"), pytest.param("pva", "pva", marks=pytest.mark.wide)])
def test_02_03_ophyd_async_motor(epics, face, scheme):
    found = epics.run(face, "ophyd_async_motor", f"{scheme}://{RECORD}")
    assert near(found["position"], 45.0)
    assert (found["unit"], found["limit"], found["timeout"]) == ("mm", "MotorLimitsError", "TimeoutError")
    assert 45.0 < found["stopped"] < 400.0
    assert found["points"] == 21
    assert found["worst"] <= WINDOW


@pytest.mark.wide
def test_04_bluesky_scans_also_after_a_stop(epics):
    found = epics.run("epics", "ophyd_motor", RECORD, "pyepics", "scans")
    for scan in ("first", "second", "third"):
        assert found[scan]["points"] == 21
        assert found[scan]["worst"] <= WINDOW


def test_05_a_null_move_pulses_done_and_is_complete_behind_it(epics):
    found = epics.run("epics", "ophyd_motor", RECORD, "pyepics", "pulse")
    assert found["seen"] == [0, 1, "complete"]


def test_06_every_field_has_its_type(epics):
    fields = [field for names in TYPES.values() for field in names.split()]
    found = epics.run("epics", "fields", RECORD, ",".join(fields))
    expected = {field: kind for kind, names in TYPES.items() for field in names.split()}
    assert found["pyepics"] == expected
    assert found["aioca"] == {field: NUMBERS[kind] for field, kind in expected.items()}
    assert found["none"] == []
    with connected(epics.live) as own:
        assert (found["extras"]["trust"], found["extras"]["state"]) == ("referenced", own.status["state"])
    assert found["extras"]["sample"].count(",") == 4


SIGNALS = "commanded", "error", "controller:reference:velocity"
HOLDS = 8  # channels that somebody may look at


def held(live: Faced, *channels: str) -> list[str]:
    """Which channels the ring holds."""
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(live.started["channel"])
        answers = line.makefile()
        found: list[str] = []
        for one in channels:
            line.sendall(json.dumps({"do": "scope", "channels": [one.replace(":", ".")], "rows": 1}).encode() + b"\n")
            found += [one] if "scope" in json.loads(answers.readline()) else []
    return found


@pytest.mark.wide
@pytest.mark.parametrize("kind", ["ca", "pva"])
def test_06_signals_of_the_method_cost_something_while_somebody_looks(epics, kind):
    client = foreign.start(
        "epics", "signals", RECORD, kind, ",".join(SIGNALS), **epics.told({"ca": "epics", "pva": "pva"}[kind])
    )
    try:
        found = json.loads(client.stdout.readline())
        assert found["units"] == ["m", "m", "m/s"]
        assert found["severity"] == [0, 0, 0]
        assert found.get("access", [False]) == [False] * len(found.get("access", [False]))
        assert found["ends"][0] == found["last"] == pytest.approx(0.04, abs=1e-9)  # a double, not four bytes
        assert abs(found["ends"][1]) <= WINDOW * 1e-3
        assert found["ends"][2] == 0.0
        assert min(found["changes"]) > 5
        assert 5.0 < found["rate"] <= 55.0
        assert held(epics.live, SIGNALS[2], "controller:law:integral") == [SIGNALS[2]]
        client.stdin.write("\n")
        client.stdin.flush()
        assert client.stdout.readline() == "left\n"
        until(lambda: held(epics.live, SIGNALS[2]) == [])
    finally:
        client.stdin.close()
        client.wait(20)
        client.stdout.close()
        client.stderr.close()


@pytest.mark.wide
@pytest.mark.parametrize("kind", ["ca", "pva"])
def test_06_a_signal_that_finds_no_place_says_so(epics, kind):
    with connected(epics.live) as own:
        names = [one["name"].replace(".", ":") for one in own.about["channels"] if "controller." in one["name"]]
    wanted = names[: HOLDS + 1]
    client = foreign.start(
        "epics", "signals", RECORD, kind, ",".join(wanted), **epics.told({"ca": "epics", "pva": "pva"}[kind])
    )
    out, err = client.communicate("\n\n", timeout=60)
    assert client.returncode == 0, err
    assert json.loads(out.splitlines()[0])["severity"] == [0] * HOLDS + [3]


@pytest.mark.wide
def test_06_a_search_over_pv_access_is_answered_on_the_printed_address_only(epics):
    told, script = epics.told("pva"), "pva"
    assert "selector" in foreign.run("epics", script, RECORD, "look", **told)
    elsewhere = foreign.start("epics", script, RECORD, "look", **told | {"EPICS_PVA_ADDR_LIST": "127.0.0.2"})
    _, err = elsewhere.communicate(timeout=30)
    assert elsewhere.returncode
    assert "TimeoutError" in err


def test_07_a_jog_lives_by_repeated_puts(epics):
    found = epics.run("epics", "ophyd_motor", RECORD, "pyepics", "jog")
    assert 0.1 < found["once"] < 1.0
    assert 4.0 < found["once_way"] < 20.0  # 40 mm/s for the lease of 200 ms, and the stop
    assert found["kept_moving"]
    assert 50.0 < found["kept_way"] < 70.0
    assert found["stopped"] >= found["kept_way"]


# ---- CiA 402


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Faced]:
    """The cascade axis without a face; tests make that of a drive in their own process."""
    with faced(tmp_path_factory.mktemp("plain"), "--headless") as live:
        yield live


@pytest.fixture
def still(plain: Faced) -> Faced:
    """The same, off, without a fault, at rest, commanded by nobody."""
    with connected(plain) as own:
        until(lambda: own.status["client"] == 0 and own.status["rests"])  # who was there before has left
        own.disable()
        if own.status["fault"]:
            own.inject("nothing")
            own.reset()
        if own.status["trust"] == "unknown":
            own.do("trust", 2)
    return plain


def judge_session(found: dict[str, Any]) -> None:
    """What a session of a master has come to."""
    foreign.measured(found)
    assert found["device"] == 0x00020192
    assert (found["enabled"], found["quick"], found["off"]) == (
        "OPERATION ENABLED", "QUICK STOP ACTIVE", "SWITCH ON DISABLED"
    )  # fmt: skip
    assert near(found["position"] * 1e-3, 60.0)
    assert near(found["by"] * 1e-3, 58.0)
    assert near(found["homed"] * 1e-3, 10.8, 0.9)
    assert found["velocity"] == pytest.approx(40_000, abs=4_000)


def test_09_base_node_402_on_a_virtual_bus(still):
    from tests.clients.p402 import session

    with drive_on_virtual(still, "nine") as (_, network, sheet):
        judge_session(session(network, 5, sheet))


@pytest.mark.wide
def test_10_the_same_on_slcan_from_another_process(tmp_path):
    with wire() as (ours, theirs), faced(tmp_path, "--headless", "--canopen", f"slcan:{ours}@5") as live:
        sheet = live.place("canopen", 2).removeprefix("EDS ")
        judge_session(foreign.run("can", "p402", "slcan", theirs, "5", sheet))


GROUP = "239.74.163.2"


@pytest.mark.parametrize("runs", [pytest.param(2, marks=pytest.mark.wide), pytest.param(20, marks=pytest.mark.long)])
def test_11_the_same_on_udp_multicast_with_the_filters_that_are_printed(tmp_path, runs):
    with faced(tmp_path, "--headless", "--canopen", f"udp_multicast:{GROUP}@5") as live:
        sheet = live.place("canopen", 2).removeprefix("EDS ")
        filters = live.place("canopen", 1).removeprefix("can_filters ").split(", ")
        for _ in range(runs):
            judge_session(foreign.run("can", "p402", "udp_multicast", GROUP, "5", sheet, *filters))


STAMPS = "CreationDate", "CreationTime", "ModificationDate", "ModificationTime", "FileName"


def lines_of(sheet: Path) -> list[str]:
    """An electronic data sheet without what tells when and where it was written."""
    return [one for one in sheet.read_text(encoding="utf-8").splitlines() if not one.startswith(STAMPS)]


def objects_of(dictionary: Any) -> dict[tuple[int, int], tuple[Any, ...]]:
    """Name, type, access, default and limits of each variable."""
    found: dict[tuple[int, int], tuple[Any, ...]] = {}
    for thing in dictionary.values():
        for one in [thing] if hasattr(thing, "data_type") else thing.values():
            shown = one.name, one.data_type, one.access_type, one.default, one.min, one.max
            found[one.index, one.subindex] = shown
    return found


def test_12_the_sheet_is_loaded_and_comes_out_equal(still, tmp_path):
    canopen = pytest.importorskip("canopen")
    with drive_on_virtual(still, "twelve") as (desk, _, sheet):
        loaded, again = canopen.import_od(sheet, 5), tmp_path / "again.eds"
        canopen.export_od(loaded, str(again))
        assert lines_of(again) == lines_of(Path(sheet))
        assert objects_of(loaded) == objects_of(desk.server[5].object_dictionary)
        assert len(objects_of(loaded)) > 70
        assert not re.findall("=0x-", Path(sheet).read_text(encoding="utf-8"))  # as canopen writes what is below 0


@pytest.mark.wide
def test_12_the_same_run_passes_on_the_sheet_that_was_loaded_and_written_again(still, tmp_path):
    canopen = pytest.importorskip("canopen")
    from tests.clients.p402 import session

    with drive_on_virtual(still, "twelve again") as (_, network, sheet):
        again = tmp_path / "again.eds"
        canopen.export_od(canopen.import_od(sheet, 5), str(again))
        judge_session(session(network, 5, str(again)))


def remote(network: Any, sheet: str) -> Any:
    """A node of the library, set up and operational."""
    from tests.clients.p402 import patient

    p402 = pytest.importorskip("canopen.profiles.p402")
    node = patient(p402.BaseNode402(5, sheet))
    network.add_node(node)
    node.nmt.send_command(0x80)
    time.sleep(0.05)
    node.setup_402_state_machine()
    node.nmt.send_command(0x01)
    time.sleep(0.05)
    return node


def comes(node: Any, state: str) -> None:
    """The state is there soon."""
    until(lambda: (node.check_statusword(), node.state)[1] == state)


WAYS = {
    "SWITCH ON DISABLED": (0x00,), "READY TO SWITCH ON": (0x00, 0x06), "SWITCHED ON": (0x00, 0x06, 0x07),
    "OPERATION ENABLED": (0x00, 0x06, 0x07, 0x0F), "QUICK STOP ACTIVE": (0x00, 0x06, 0x07, 0x0F, 0x02),
}  # fmt: skip
"""Control words that lead to a state."""


def test_13_transitions_by_control_word(still):
    p402 = pytest.importorskip("canopen.profiles.p402")
    with drive_on_virtual(still, "thirteen") as (_, network, sheet), connected(still) as own:
        node = remote(network, sheet)

        def send(word: int) -> None:
            node.sdo[0x6040].raw = word
            time.sleep(0.06)

        def at(state: str) -> None:
            for word in WAYS[state]:
                send(word)
            comes(node, state)

        for (begin, end), word in p402.State402.TRANSITIONTABLE.items():
            if begin in WAYS:
                at(begin)
                node.sdo[0x6040].raw = word
                comes(node, end)
        for state in ("SWITCH ON DISABLED", "READY TO SWITCH ON"):  # words that mean nothing there
            at(state)
            send(0x0F if state == "SWITCH ON DISABLED" else 0x06)
            send(0x80)  # nor does the reset of no fault
            node.check_statusword()
            assert node.state == state
        at("OPERATION ENABLED")
        own.inject("encoder stuck")
        own_fault(own, node)
        comes(node, "FAULT")
        send(0x0F)
        node.check_statusword()
        assert node.state == "FAULT"
        own.inject("nothing")
        send(0x80)
        comes(node, "SWITCH ON DISABLED")


def own_fault(own: Any, node: Any) -> None:
    """Let the axis find out that its encoder is stuck: by a move."""
    node.sdo[0x607A].raw = 200_000
    node.sdo[0x6040].raw = 0x0F
    time.sleep(0.05)
    node.sdo[0x6040].raw = 0x3F
    until(lambda: own.status["fault"] is not None)


class Table:
    """Reference for set-points, from the table of the standard: what bit 12 is, and where it goes next."""

    def __init__(self) -> None:
        self.queue: list[int] = []  # under way, then waiting
        self.bit4 = self.bit12 = 0
        self.origin = 0

    def word(self, word: int, value: int) -> list[int]:
        """Targets that begin now."""
        rises, self.bit4 = word >> 4 & 1 > self.bit4, word >> 4 & 1
        begun: list[int] = []
        if rises and not self.bit12:
            target = self.origin + value if word & 64 else value
            self.origin = target
            begun = [target] if word & 32 or not self.queue else []
            self.queue = [target] if begun else [self.queue[0], target]
            self.bit12 = 1
        self.settle()
        return begun

    def arrive(self) -> list[int]:
        """The target under way is reached."""
        self.queue = self.queue[1:]
        self.settle()
        return self.queue[:1]

    def settle(self) -> None:
        """Bit 12 falls with bit 4, but not while one waits."""
        if not self.bit4 and len(self.queue) < 2:
            self.bit12 = 0


def test_14_set_points_as_the_table_has_them():
    for seed in range(200):
        random, table, ours = Random(seed), Table(), SetPoints()
        for _ in range(200):
            if random.random() < 0.2 and table.queue:
                following = ours.reached()
                assert table.arrive() == ([] if following is None else [following])
            else:
                word = random.choice((0, 0x10, 0x10, 0x30, 0x50, 0x70)) | 0x0F
                value = random.randrange(-1000, 1000)
                begun = ours.control(word, value)
                assert table.word(word, value) == ([] if begun is None else [begun])
            assert ours.acknowledged == bool(table.bit12)
            assert [one for one in (ours.active, ours.waiting) if one is not None] == table.queue


def test_16_a_fault_is_told_and_left_by_an_edge(still):
    with drive_on_virtual(still, "sixteen") as (_, network, sheet), connected(still) as own:
        node, heard = remote(network, sheet), []
        node.emcy.add_callback(lambda error: heard.append(error.code))
        node.state = "OPERATION ENABLED"
        own.inject("encoder stuck")
        own_fault(own, node)
        comes(node, "FAULT")
        code = node.sdo[0x603F].raw
        number = own.status["fault"]["code"]
        assert code == {1: 0x7305, 10: 0x8611, 12: 0x7121}.get(number, 0xFF00 | number)
        until(lambda: heard)
        assert heard[0] == code
        assert node.sdo[0x1001].raw & 1
        own.inject("nothing")
        node.sdo[0x6040].raw = 0x80
        comes(node, "SWITCH ON DISABLED")
        until(lambda: heard[-1] == 0)
        own.inject("encoder stuck")
        for word in (0x86, 0x87, 0x8F):  # the bit stays: no edge
            node.sdo[0x6040].raw = word
        assert node.sdo[0x603F].raw == 0
        own.inject("nothing")


@pytest.mark.parametrize(
    ("option", "state"),
    [(0, "OPERATION ENABLED"), (1, "FAULT"), (2, "SWITCH ON DISABLED"), (3, "QUICK STOP ACTIVE")],
)
def test_17_a_lost_master(still, option, state):
    with drive_on_virtual(still, f"seventeen {option}") as (_, network, sheet), connected(still) as own:
        node = remote(network, sheet)
        node.sdo[0x6007].raw = option
        beating = network.send_periodic(0x700 + 127, [5], 0.02)
        time.sleep(0.05)
        node.sdo[0x1016][1].raw = 127 << 16 | 200
        node.op_mode = "PROFILED VELOCITY"
        node.state = "OPERATION ENABLED"
        node.sdo[0x60FF].raw = 30_000
        until(lambda: abs(own.status["velocity"]) > 0.025)
        beating.stop()
        comes(node, state)
        until(lambda: own.status["rests"] and abs(own.status["velocity"]) < 1e-3)
        assert node.sdo[0x603F].raw == (0x8130 if option == 1 else 0)
        if option == 1:
            node.sdo[0x6040].raw = 0x80
            comes(node, "SWITCH ON DISABLED")


TABLE = """
1000 0 u32 ro 00020192|1001 0 u8 ro 0|100C 0 u16 rw 0|100D 0 u8 rw 0
1016 1 u32 rw 0|1017 0 u16 rw 0|1018 2 u32 ro 402|6007 0 i16 rw 3|603F 0 u16 ro 0
6040 0 u16 rw 0|6041 0 u16 ro *|605A 0 i16 ro 6|605E 0 i16 ro 2|6060 0 i8 rw 1|6061 0 i8 ro 1|6062 0 i32 ro *
6064 0 i32 ro *|6065 0 u32 ro FFFFFFFF|6066 0 u16 ro 0|6067 0 u32 ro FFFFFFFF|6068 0 u16 ro 0|606C 0 i32 ro *
6077 0 i16 ro *|607A 0 i32 rw 0|607D 1 i32 rw 0|607D 2 i32 rw 7A120|607F 0 u32 ro 7A120|6081 0 u32 rw 7A120
6083 0 u32 ro 4C4B40|6084 0 u32 ro 4C4B40|6085 0 u32 ro 4C4B40|6098 0 i8 ro -1|60F4 0 i32 ro *|60FF 0 i32 rw 0
6502 0 u32 ro 3A5|6071 0 i16 rw 0|60C2 1 u8 rw 1|60C2 2 i8 rw -2
1400 1 u32 rw 205|1401 1 u32 rw 305|1800 1 u32 rw 185|1801 1 u32 rw 285|1801 5 u16 ro 14
1600 1 u32 rw 60400010
1600 2 u32 rw 607A0020|1601 1 u32 rw 60600008|1A00 1 u32 rw 60410010|1A00 2 u32 rw 60640020|1A01 2 u32 rw 606C0020
2000 1 u32 ro *|2000 2 i32 ro *|2000 3 u8 ro 2|2000 4 u16 ro 0
"""
"""Index, part, type, access and default of each object, in hexadecimal; * where it shows how the axis is."""


def test_18_objects(still):
    canopen = pytest.importorskip("canopen")
    with drive_on_virtual(still, "eighteen") as (_, network, sheet):
        node = canopen.RemoteNode(5, sheet)
        network.add_node(node)
        rows = [row.split() for row in TABLE.replace("\n", "|").split("|") if row]
        for index_, part_, kind, access, default in rows:
            index, part, size = int(index_, 16), int(part_), int(kind[1:]) // 8
            data = node.sdo.upload(index, part)
            assert len(data) == size, index_
            if default != "*":
                assert int.from_bytes(data, "little", signed=kind[0] == "i") == int(default, 16), (index_, part_)
            codes: list[int] = []
            for wrong in (data, data + b"\0"):
                try:
                    node.sdo.download(index, part, wrong)
                except canopen.SdoAbortedError as error:
                    codes.append(error.code)
            read_only = [0x06010002, 0x06010002]
            assert codes == (read_only if access == "ro" else [0x06070010]), (index_, codes)
        for index, part, value, code in (
            (0x5FFF, 0, 1, 0x06020000), (0x1018, 9, 1, 0x06090011), (0x6060, 0, 7, 0x06090030),
            (0x60C2, 1, 0, 0x06090030),
            (0x607D, 2, 500_001, 0x06090031), (0x6081, 0, 500_001, 0x06090031), (0x6007, 0, 9, 0x06090030),
        ):  # fmt: skip
            size = {0x6060: 1, 0x60C2: 1, 0x6007: 2}.get(index, 4)
            with pytest.raises(canopen.SdoAbortedError) as refused:
                node.sdo.download(index, part, value.to_bytes(size, "little"))
            assert refused.value.code == code, hex(index)


# ---- rules for all


@pytest.mark.parametrize("face", ["scpi", "modbus"])
def test_08_a_killed_face_leaves_an_axis_that_stops_in_a_ramp(axis, face):
    """Killed in a move of its own; the panel's line says who was lost, and the face comes back."""
    if face == "scpi":
        client = socket.create_connection(("127.0.0.1", int(axis.port("scpi"))))
        client.sendall(b"ENAB\nMOVE:ABS 450,50\n")
    else:
        client = foreign.start("modbus", "modbus", axis.port("modbus"), "leave moving")
    with connected(axis) as own:
        until(lambda: abs(own.status["velocity"]) > 0.045)
        killed = axis.process_of(face)
        os.kill(killed, signal.SIGKILL)
        begin, speeds = time.monotonic(), [0.05]
        while time.monotonic() - begin < 2.0 and not (status := own.status)["rests"]:
            speeds.append(abs(status["commanded"]))
        assert status["rests"]
        assert status["state"] == "operation enabled"
        assert status["fault"] is None
        assert status["client"] == 0
        lines = [json.loads(line) for line in audit_of(axis)]
        lost = [line["note"] for line in lines if f"{face} face" in line.get("note", "")]
        assert lost[-1].endswith("has gone in a move to, which was stopped")
        told = watched(axis)
        assert f"{face} face" in told["lost"]
    client.close() if face == "scpi" else (client.kill(), client.communicate())
    until(lambda: reached(axis.port(face)))


def until(met: Callable[[], object], seconds: float = 10.0) -> None:
    """Wait until something holds."""
    begin = time.monotonic()
    while not met():
        assert time.monotonic() - begin < seconds, "it did not come"
        time.sleep(0.005)


def reached(port: str) -> bool:
    """Whether somebody listens."""
    with suppress(OSError), socket.create_connection(("127.0.0.1", int(port)), timeout=1.0):
        return True
    return False


def audit_of(axis: Faced) -> list[str]:
    """The log of who asked for what."""
    (file,) = Path(axis.started["channel"]).parent.glob("*.audit")
    return file.read_text(encoding="utf-8").splitlines()


def watched(axis: Faced) -> dict[str, Any]:
    """What a panel is told, once."""
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(axis.started["channel"])
        line.sendall(b'{"do": "watch", "rate": 50}\n')
        for text in line.makefile():
            message = json.loads(text)
            if "why" in message:
                return message
    raise AssertionError("no status came")


SECOND, ON_LOCAL = 43, 115  # refusals: somebody else commands; the selector stands on local
WHYS = pytest.mark.parametrize("why", [SECOND, pytest.param(ON_LOCAL, marks=pytest.mark.wide)])


@contextmanager
def stopped_by_another(live: Faced, why: int = SECOND) -> Iterator[Any]:
    """Somebody leads a move from 20 mm, and has it ended by a stop of another, who may not command."""
    with connected(live) as own:
        own.select("local" if why == ON_LOCAL else "both")
        own.do("take")
        own.enable()
        own.confirm()
        own.move_to("20 mm")
        moving = own.move_to("450 mm", speed=0.05, wait=False)
        yield own
        with pytest.raises(Exception, match="stop ended it"):
            moving.wait()
        own.select("both")
        own.do("leave")


def refusals_of(axis: Faced, why: int) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Of each client, what it was told, and what is right; each has asked for a motion, and stopped."""
    found = foreign.run("visa", "scpi", axis.place("scpi"), "refused")
    assert f"({why})" in found["move_refused"]
    names, number = ("refused", "move_refused", "stop"), {SECOND: "-200", ON_LOCAL: "-201"}[why]
    yield {name: found[name].partition(",")[0] for name in names}, dict(zip(names, (number, number, "0"), strict=True))
    code = {SECOND: 5, ON_LOCAL: 51}[why]
    yield foreign.run("pi", "gcs", axis.port("gcs"), "refused"), {"servo": code, "move": code}
    words = {"home": "REMOTE", "move": "REMOTE", "stop": ""}
    yield foreign.run("zaber", "zaber", axis.port("zaber"), "refused"), words
    found = foreign.run("alpaca", "alpaca", axis.place("alpaca"), "focuser", "refused")
    yield found, {"move": "InvalidOperationException", "halt": ""}
    found = foreign.run("modbus", "modbus", axis.port("modbus"), "refused")
    assert [found["identification"][12] >> bit & 1 for bit in (11, 12)] == [1, int(why == ON_LOCAL)]
    yield found, {"move": [4, why], "stop": [2, 0]}


@WHYS
def test_29_a_second_commander_is_refused_by_each_protocol_and_may_stop(axis, why):
    with connected(axis) as own:
        own.select("local" if why == ON_LOCAL else "both")
        own.do("take")
        own.enable()
        own.confirm()
        moving = own.move_to("450 mm", speed=0.05, wait=False)
        for found, known in refusals_of(axis, why):
            assert {name: found[name] for name in known} == known
            with pytest.raises(Exception, match="stop ended it"):
                moving.wait()
            moving = own.move_to("450 mm", speed=0.05, wait=False)
        own.stop()
        own.select("both")


@WHYS
def test_29_a_second_commander_by_epics_is_refused_and_may_stop(epics, why):
    with stopped_by_another(epics.live, why):
        found = epics.run("epics", "ophyd_motor", RECORD, "pyepics", "refused")
        assert found["put"] == "ErrorResponseReceived"
        assert found["set_point"] != 60.0
        assert found["selector"] == ("local" if why == ON_LOCAL else "both")


@pytest.mark.wide
@WHYS
def test_29_a_second_commander_by_pva_is_refused_and_may_stop(epics, why):
    with stopped_by_another(epics.live, why):
        found = epics.run("pva", "pva", RECORD, "refused")
        assert f"({why})" in found["put"]
        assert found["selector"] == ("local" if why == ON_LOCAL else "both")


@WHYS
def test_29_a_second_commander_by_grbl_is_refused_and_may_stop(axis, why):
    with connected(axis) as own:
        own.select("local" if why == ON_LOCAL else "both")
        own.do("take")
        own.enable()
        client = foreign.start("grbl", "grbl", axis.place("grbl"), "refused")
        assert json.loads(client.stdout.readline()) == {"move": ["error:9"]}
        with pytest.raises(Exception, match="stop ended it"):  # whose connection is not at rest begins with a stop
            own.move_to("450 mm", speed=0.05)
        own.select("both")
        own.do("leave")
        assert client.wait(20) == 0, client.stderr.read()
        client.communicate()


@WHYS
@pytest.mark.parametrize("word", [0x0B, 0x10F])  # quick stop, halt
def test_29_a_second_master_sees_that_the_drive_is_not_remote_and_may_stop(still, word, why):
    with drive_on_virtual(still, f"second {word} {why}") as (_, network, sheet), stopped_by_another(still, why) as own:
        node = remote(network, sheet)
        assert not node.sdo[0x6041].raw >> 9 & 1
        running = own.status["running"]
        node.sdo[0x607A].raw = 60_000
        node.sdo[0x6040].raw = 0x0F
        node.sdo[0x6040].raw = 0x1F
        time.sleep(0.3)
        assert own.status["running"]["id"] == running["id"]
        node.sdo[0x6040].raw = word


def test_29_the_remote_bit_is_there_unless_the_selector_stands_on_local(still):
    with drive_on_virtual(still, "selector") as (_, network, sheet), connected(still) as own:
        node = remote(network, sheet)
        for stands, bit in (("both", 1), ("local", 0), ("remote", 1)):
            own.select(stands)
            until(lambda bit=bit: node.sdo[0x6041].raw >> 9 & 1 == bit)
        own.select("both")


def test_29_scpi_locks_the_others_out_unless_the_selector_stands_on_local(axis):
    with socket.create_connection(("127.0.0.1", int(axis.port("scpi")))) as line, connected(axis) as own:
        answers = line.makefile("rb")

        def asked(what: str) -> str:
            line.sendall(what.encode() + b"\n")
            return answers.readline().decode().strip()

        assert asked("SYST:REM;SYST:SEL?") == '"remote"'
        with pytest.raises(Exception, match="selector stands on remote"):
            own.enable()
        own.stop()  # is taken all the same
        assert asked("SYST:LOC;SYST:SEL?") == '"both"'
        own.select("local")
        assert asked("SYST:REM;SYST:SEL?") == '"local"'
        assert asked("SYST:ERR?").startswith('-201,"Invalid while in local')
        own.select("both")

        def turned() -> list[str]:
            return [one["value"] for one in map(json.loads, audit_of(axis)) if one.get("do") == "selector"]

        until(lambda: turned()[-5:] == ["remote", "both", "local", "remote", "both"])  # the refused one among them


Shown = dict[int, tuple[str, int, str, int]]  # by the number of the period: state, count, trust, fault


def by_line(port: str, question: bytes, left: threading.Event, found: Shown) -> None:
    """A client that polls a line protocol fifty times a second."""
    with socket.create_connection(("127.0.0.1", int(port))) as line:
        answers = line.makefile("rb")
        while not left.wait(0.02):
            line.sendall(question)
            text = answers.readline().decode().strip().rpartition("-- ")[2].replace("_", " ")
            number, state, position, trust, fault = text.split(",")
            found[int(number)] = (state, round(float(position) * 1e3), trust, int(fault))


def by_registers(port: str, left: threading.Event, found: Shown) -> None:
    """The same over Modbus."""
    from pymodbus.client import ModbusTcpClient

    from detent.faces.modbus import STATES, TRUSTS, signed

    client = ModbusTcpClient("127.0.0.1", port=int(port))
    client.connect()
    while not left.wait(0.02):
        r = client.read_holding_registers(10, count=8).registers
        found[r[0] << 16 | r[1]] = (STATES[r[3]], signed(r[6:8]), TRUSTS[r[4]], r[5])
    client.close()


def by_page(axis: Faced, left: threading.Event, found: Shown) -> None:
    """What a panel is sent."""
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(axis.started["channel"])
        line.sendall(b'{"do": "watch", "rate": 50}\n')
        for text in line.makefile():
            s = json.loads(text).get("status")
            if s:
                fault = s["fault"]["code"] if s["fault"] else 0
                found[s["loop"]["periods"]] = (s["state"], round(s["position"] * 1e6), s["trust"], fault)
            if left.is_set():
                return


def load_of(live: Faced, own: Any, seconds: float) -> dict[str, float]:
    """Share of periods skipped meanwhile, time of computing in one [us], and shares of a processor [%]."""
    faces = [one for one in family(live.process.pid) if "detent.faces" in Path(f"/proc/{one}/cmdline").read_text()]
    ids = [live.process.pid, *faces]
    before, used, begin = own.status["loop"], [spent(one) for one in ids], time.monotonic()
    time.sleep(seconds)
    after, took = own.status["loop"], time.monotonic() - begin
    periods = after["periods"] - before["periods"]
    work = after["mean_work"] * after["periods"] - before["mean_work"] * before["periods"]
    own_share, *others = (100 * (spent(one) - was) / took for one, was in zip(ids, used, strict=True))
    return {
        "periods": periods, "skipped": (after["skipped"] - before["skipped"]) / periods, "work": work / periods * 1e6,
        "axis": own_share, "faces": sum(others),
    }  # fmt: skip


def spent(process: int) -> float:
    """Time that a process has had of a processor [s]."""
    words = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(") ")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.wide
def test_28_four_faces_and_a_panel_show_the_same_sample(axis, plain):
    with connected(plain) as own:
        without = load_of(plain, own, 5.0)
    left, shown = threading.Event(), [Shown() for _ in range(5)]
    clients = [
        threading.Thread(target=by_line, args=(axis.port("scpi"), b"SAMP?\n", left, shown[0])),
        threading.Thread(target=by_line, args=(axis.port("gcs"), b"SAMPLE?\n", left, shown[1])),
        threading.Thread(target=by_line, args=(axis.port("zaber"), b"/1 detent\r\n", left, shown[2])),
        threading.Thread(target=by_registers, args=(axis.port("modbus"), left, shown[3])),
        threading.Thread(target=by_page, args=(axis, left, shown[4])),
    ]
    for one in clients:
        one.start()
    try:
        with connected(axis) as own:
            own.enable()
            own.confirm()
            moving = own.move_to("300 mm", speed=0.05, wait=False)
            polled_at = load_of(axis, own, 12.0)
            own.stop()
            assert moving.done
    finally:
        left.set()
        for one in clients:
            one.join()
    compared = 0
    for face in shown[:4]:
        both = face.keys() & shown[4].keys()
        compared += len(both)
        assert all(face[number] == shown[4][number] for number in both)
    assert compared >= 1000
    assert len({count for _, count, _, _ in shown[4].values()}) > 100  # it did move
    foreign.MEASURED["loop"] = {"alone": without, "polled": polled_at}
    assert polled_at["skipped"] <= 1.5 * without["skipped"] + 0.005


# ---- cyclic modes, the clock of the axis in the test's hand


CYCLE, COUNT, SAMPLES, START = 1e-3, 1e-6, 4, 0.02  # of the set-points and of the axis of the tests of cyclic modes
TEN_SECONDS = 10_000


def targets(periods: int) -> np.ndarray:
    """Moves to and fro, and rests between them, in counts.

    Rounding to counts adds up to 2 counts to a second difference, which is 2 m/s^2 here: with 3 m/s^2 of the move that
    is never more than the 5 m/s^2 that the axis may have. A first difference it makes 1 mm/s larger.
    """
    spec = read_axis(detent.example("cascade.toml"), ["limits.speed=0.45 m/s", "limits.acceleration=3 m/s^2"]).spec
    limits, place, found = motion_limits(spec), START, []
    for target in (0.2, 0.05, 0.4, 0.021, 0.3, 0.29, 0.45, 0.02) * 4:
        found += [plan_move(place, target, limits, CYCLE).position, np.full(150, target)]
        place = target
    return np.round(np.concatenate(found)[:periods] / COUNT).astype(int)


@pytest.mark.parametrize("periods", [1_000, pytest.param(TEN_SECONDS, marks=pytest.mark.wide)])
def test_15_cyclic_synchronous_position_follows_as_detent_run_does(tmp_path, periods):
    wanted = targets(periods)
    points = wanted * (COUNT * 1e3) / 1e3  # by the unit of the face, mm, as the drive reads its counts
    with stepped(tmp_path) as axis, master_of(axis, f"fifteen {periods}") as (node, network):
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
            node.state = "OPERATION ENABLED"
            axis.until(lambda: node.sdo[0x6041].raw & 0x1000)
        stream, cycle, errors = axis.operation.stream, Cycle(axis, node, network), []
        for target in wanted:
            cycle(int(target))
            errors.append(axis.state.controller.law.position_error)
        assert (stream.taken, stream.late, stream.dropped) == (periods, 0, 0)
        assert axis.operation.answer.commanded == points[-1]
    there = following_errors(between(points, START, CYCLE, SAMPLES), SAMPLES, before=100)
    assert np.abs(np.array(errors) - there).max() <= COUNT
    assert np.abs(there).max() > 10 * COUNT  # it has something to follow


def test_15_velocities_and_efforts_are_followed_too(tmp_path):
    with stepped(tmp_path) as axis, master_of(axis, "fifteen more") as (node, network):
        rpdo, answer = node.rpdo[2], axis.operation.answer
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
            node.state = "OPERATION ENABLED"
            axis.until(lambda: node.sdo[0x6041].raw & 0x1000)
        cycle = Cycle(axis, node, network)
        for k in range(200):
            rpdo["Modes of operation"].raw, rpdo["Target velocity"].raw = 9, min(500 * k, 40_000)
            cycle.sent(rpdo.transmit)
        assert answer.commanded_velocity == pytest.approx(0.04)
        assert answer.velocity == pytest.approx(0.04, rel=0.1)
        way = answer.commanded - START
        assert way == pytest.approx(sum(min(0.5e-3 * k, 0.04) for k in range(200)) * CYCLE, abs=0.5e-3 * CYCLE * 80)
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
            axis.until(lambda: axis.operation.kind == ops.STREAM_EFFORT and node.sdo[0x6041].raw & 0x1000)
        before = answer.position
        for k in range(80):
            cycle.sent(lambda k=k: setattr(node.sdo[0x6071], "raw", 100 if k else 0))
        assert answer.effort == pytest.approx(0.1)
        assert axis.state.lines.command == pytest.approx(0.1 * axis.host.axis.params.controller.law.max_command)
        assert answer.position > before + 1e-4
        axis.step(100)
        assert (answer.rests, axis.host.state) == (1, "operation enabled")


def test_15_lost_set_points_end_in_a_ramp_and_are_not_taken_up_again(tmp_path):
    with stepped(tmp_path) as axis, master_of(axis, "fifteen lost") as (node, network):
        answer, stream = axis.operation.answer, axis.operation.stream
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
            node.state = "OPERATION ENABLED"
            axis.until(lambda: node.sdo[0x6041].raw & 0x1000)
        cycle = Cycle(axis, node, network)
        for k in range(100):
            cycle(20_000 + k * k)  # 0.2 m/s at the end
        moving = []
        while axis.operation.running:
            axis.step()
            moving.append(answer.commanded_velocity)
        assert len(moving) == 5  # periods behind its own; with the end of the last one the ramp begins
        assert moving == pytest.approx([0.197] * 5, rel=0.01)
        assert moving[3] > moving[4]
        slower = [(axis.step(), answer.commanded_velocity)[1] for _ in range(100)]
        assert slower == sorted(slower, reverse=True)
        assert (answer.rests, axis.host.state) == (1, "operation enabled")
        stands = answer.commanded
        with axis.running():
            axis.until(lambda: not node.sdo[0x6041].raw & 0x1000)
            node.rpdo[1].transmit()
            network.sync.transmit()
            node.op_mode = "PROFILED POSITION"
        assert answer.commanded == stands
        assert stream.taken == 100
        with axis.running():  # from where it stands a profile begins without a jump
            node.sdo[0x607A].raw = 60_000
            node.sdo[0x6040].raw = 0x0F
            node.sdo[0x6040].raw = 0x3F
            axis.until(lambda: abs(answer.position - 0.06) < 1e-4 and answer.rests)
        assert axis.state.controller.guard.code == 0


def test_15_a_halt_ends_it_and_its_release_begins_it_anew(tmp_path):
    with stepped(tmp_path) as axis, master_of(axis, "fifteen halt") as (node, network):
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
            node.state = "OPERATION ENABLED"
            axis.until(lambda: node.sdo[0x6041].raw & 0x1000)
        cycle = Cycle(axis, node, network)
        for k in range(50):
            cycle(20_000 + 2 * k * k)
        first = axis.operation.running
        with axis.running():
            node.sdo[0x6040].raw = 0x10F
            axis.until(lambda: axis.operation.running == 0 and axis.operation.answer.rests)
            axis.until(lambda: not node.sdo[0x6041].raw & 0x1000)
            node.sdo[0x6040].raw = 0x0F
            axis.until(lambda: axis.operation.running > first and node.sdo[0x6041].raw & 0x1000)
        here = round(axis.operation.answer.commanded / COUNT)
        for k in range(50):
            cycle(here + k)
        assert axis.operation.answer.commanded == pytest.approx((here + 49) * COUNT)
        with axis.running():  # a relative way counts from there
            node.op_mode = "PROFILED POSITION"
            node.sdo[0x607A].raw = 1_000
            node.sdo[0x6040].raw = 0x5F
            axis.until(lambda: abs(axis.operation.answer.position / COUNT - here - 1_049) < 20)


@pytest.mark.wide
def test_15_through_the_process_of_the_face_in_wall_time(tmp_path):
    with wire() as (ours, theirs), faced(tmp_path, "--headless", "--canopen", f"slcan:{ours}@5") as live:
        sheet = live.place("canopen", 2).removeprefix("EDS ")
        found = foreign.run("can", "cyclic", "slcan", theirs, "5", sheet)
    assert found["modes"] == 0x3A5
    # A set-point that is late is passed on the slope of the last two, 16 mm/s at most, for five periods and no longer;
    # how late a busy machine is says nothing of the drive.
    assert 19_000 < found["way"] < 20_000 + 5 * 0.1 * 16_000
    assert found["behind"] < 1_600  # two of its periods at 16 mm/s; a busy machine may be later now and then
    assert abs(found["end"]) < 50
    assert found["state"] == "OPERATION ENABLED"
    assert 10_000 < found["velocity"] < 30_000  # the tests with a clock of their own look more closely


# ---- a master that guards a node, and falls silent


GUARDED = 0.02  # time between two questions [s]


@pytest.mark.parametrize(
    ("option", "state"),
    [
        pytest.param(0, "OPERATION ENABLED", marks=pytest.mark.wide), (1, "FAULT"),
        pytest.param(2, "SWITCH ON DISABLED", marks=pytest.mark.wide), (3, "QUICK STOP ACTIVE"),
    ],
)  # fmt: skip
def test_17_a_master_that_guards_no_more_does_what_6007_says(tmp_path, option, state):
    with stepped(tmp_path) as axis, master_of(axis, f"guarded {option}") as (node, network), axis.running():
        heard: list[int] = []
        network.subscribe(0x700 + NODE, lambda _id, data, _time: heard.append(data[0]))
        node.sdo[0x6007].raw = option
        node.sdo[0x100C].raw, node.sdo[0x100D].raw = 100, 5
        node.op_mode = "PROFILED VELOCITY"
        node.nmt.start_node_guarding(GUARDED)
        node.state = "OPERATION ENABLED"
        node.sdo[0x60FF].raw = 30_000
        axis.until(lambda: axis.operation.answer.commanded_velocity > 0.025)
        axis.until(lambda: len(heard) > 10)
        assert {code & 0x7F for code in heard} == {5}  # operational
        assert all(one ^ other == 0x80 for one, other in pairwise(heard))
        assert not node.sdo[0x6041].raw & 0x08
        node.nmt.stop_node_guarding()
        axis.until(lambda: (node.check_statusword(), node.state)[1] == state and axis.operation.answer.rests)
        assert node.sdo[0x603F].raw == (0x8130 if option == 1 else 0)


def test_17_no_answer_where_a_heartbeat_is_sent_and_no_loss_without_a_life_time(tmp_path):
    with stepped(tmp_path) as axis, master_of(axis, "not guarded") as (node, network), axis.running():
        heard: list[int] = []
        network.subscribe(0x700 + NODE, lambda _id, data, _time: heard.append(data[0]))
        node.state = "OPERATION ENABLED"
        network.send_message(0x700 + NODE, [], remote=True)
        axis.until(lambda: heard)
        assert heard == [5]
        node.nmt.send_command(0x82)  # reset of communication: it boots, and the bit begins anew
        axis.until(lambda: heard == [5, 0])
        network.send_message(0x700 + NODE, [], remote=True)
        axis.until(lambda: len(heard) == 3)
        assert heard[2] == 0x7F  # pre-operational
        node.sdo[0x1017].raw = 1000
        network.send_message(0x700 + NODE, [], remote=True)
        assert node.sdo[0x6041].raw & 0x6F == 0x27
        assert [one for one in heard[3:] if one & 0x80] == []


# ---- a stage with two motors


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Faced]:
    """The example of a microscope stage, both motors, with its list of tiles beside its file."""
    pytest.importorskip("caproto")
    pytest.importorskip("p4p")
    folder = tmp_path_factory.mktemp("stage")
    shutil.copy(detent.example("tiles.csv"), folder)
    records = [f"lab:stage@:{free_port()}" for _ in range(2)]
    with faced(folder, *LINES, "--epics", records[0], "--pva", records[1], "--headless", example="stage.toml") as live:
        yield live


STEP = 0.005  # of the stage [mm]


def visited(stage: Faced, name: str, what: str, *words: str, **environ: str) -> None:
    """Every tile of the file, in its order, to a step of the motors."""
    found = foreign.run(name, "tiles", what, str(stage.file.with_name("tiles.csv")), *words, **environ)
    assert len(found["asked"]) == len(found["found"]) == 12
    for asked, place in zip(found["asked"], found["found"], strict=True):
        assert place == pytest.approx(asked, abs=STEP * 0.5001)


def test_30_a_stage_is_two_motors_of_epics_and_bluesky_visits_its_tiles(stage):
    assert [stage.place("epics", k) for k in (0, 1)] == ["lab:stage:x", "lab:stage:y"]
    environ = dict(word.split("=") for word in stage.place("epics", 2).split())
    visited(stage, "epics", "bluesky", "lab:stage", **environ)


@pytest.mark.wide
def test_30_a_stage_is_two_axes_of_grbl(stage):
    assert stage.started["faces"]["grbl"][1:] == ["X = x", "Y = y"]
    visited(stage, "grbl", "grbl", stage.place("grbl"))


@pytest.mark.wide
def test_30_a_stage_is_two_axes_of_gcs(stage):
    visited(stage, "pi", "gcs", stage.port("gcs"))


@pytest.mark.wide
def test_30_a_stage_is_two_axes_of_a_zaber_device(stage):
    with connected(stage, "x") as x, connected(stage, "y") as y:
        about = [one.link.describe() for one in (x, y)]
    assert [one["count"] * 1e3 for one in about] == pytest.approx([STEP, STEP])
    visited(stage, "zaber", "zaber", stage.port("zaber"), str(STEP), *(str(one["origin"] * 1e3) for one in about))


def test_30_a_stage_is_two_nodes_of_cia_402(stage):
    p402 = pytest.importorskip("canopen.profiles.p402")
    from tests.clients.p402 import patient

    with drive_on_virtual(stage, "stage") as (desk, network, _):
        nodes = []
        for number, motor in ((5, "x"), (6, "y")):
            node = patient(p402.BaseNode402(number, str(desk.channels[motor].with_suffix(".eds"))))
            network.add_node(node)
            node.nmt.send_command(0x80)
            node.setup_402_state_machine()
            node.nmt.send_command(0x01)
            nodes.append(node)
        for node in nodes:
            node.sdo[0x6060].raw = 1
            for word in (0x06, 0x07, 0x0F):
                node.sdo[0x6040].raw = word
        for node in nodes:
            comes(node, "OPERATION ENABLED")
        for node, target in zip(nodes, (11_100, 8_060), strict=True):
            node.sdo[0x607A].raw = target
            node.sdo[0x6040].raw = 0x1F
            until(lambda node=node: node.sdo[0x6041].raw >> 12 & 1)
            node.sdo[0x6040].raw = 0x0F
        for node, target in zip(nodes, (11_100, 8_060), strict=True):
            until(lambda node=node: node.sdo[0x6041].raw >> 10 & 1)
            assert node.sdo[0x6064].raw == target
        for node in nodes:
            node.sdo[0x6040].raw = 0


def test_30_a_stage_is_two_devices_and_instruments_everywhere_else(stage):
    from p4p.client.thread import Context
    from pymodbus.client import ModbusTcpClient

    from detent.faces.modbus import signed

    with connected(stage, "x") as x, connected(stage, "y") as y:
        for own, place in ((x, "1 mm"), (y, "-2 mm")):
            own.do("take")
            own.enable()
            own.confirm()
            own.move_to(place)
            own.do("leave")
    client = ModbusTcpClient("127.0.0.1", port=int(stage.port("modbus")))
    client.connect()
    counts = [signed(client.read_holding_registers(16, count=2, device_id=unit).registers) for unit in (1, 2)]
    client.close()
    assert counts == [11_200, 7_600]  # from the lower ends, -55 and -40 mm, in steps
    words = dict(word.split("=") for word in stage.place("pva", 2).split())
    with Context("pva", conf=words, useenv=False) as pva:
        assert [float(pva.get(f"lab:stage:{motor}.RBV")) for motor in "xy"] == pytest.approx([1.0, -2.0])
    with socket.create_connection(("127.0.0.1", int(stage.port("scpi")))) as line:
        line.sendall(b"INST:CAT?\nINST:SEL?;POS?\nINST:SEL 'y';POS?\nINST:SEL z\nSYST:ERR?\n")
        answers = line.makefile("r")
        told = [answers.readline().strip() for _ in range(4)]
    assert told[:3] == ['"x","y"', '"x";1', "-2"]
    assert told[3].startswith('-222,"Data out of range; z: x, y')
    numbers = [
        httpx.get(f"http://{stage.place('alpaca')}/api/v1/focuser/{k}/connected").json()["ErrorNumber"] for k in (0, 1)
    ]
    assert numbers == [0, 0]
    assert httpx.get(f"http://{stage.place('alpaca')}/api/v1/focuser/2/connected").status_code == 400


SESSIONS = page_session.sessions()
OTHERS = {"cyclic"}  # scripts, of which a page shows a part, that another test here runs
SHORT = {"modbus-hand-shake"}  # of the others one takes longer than all that `make test` may


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=() if page in SHORT else pytest.mark.wide) for page in sorted(SESSIONS)]
)
def test_31_a_page_does_what_it_shows(page, tmp_path):
    begun = page_session.run(SESSIONS[page], tmp_path)
    text = (ROOT / "docs" / "how-to" / f"{page}.md").read_text(encoding="utf-8")
    shown = re.findall(r"literalinclude\} \.\./\.\./tests/clients/(\w+)\.py", text)
    assert begun == [one for one in shown if one not in OTHERS]


def test_31_each_face_has_a_page_with_a_session_and_what_its_protocol_cannot_protect():
    shown = {word for commands in SESSIONS.values() for word in commands[0].text.split() if word.startswith("--")}
    assert shown == {f"--{face}" for face in FACES} | {"--commands"}
    scripts = [command.text.split()[1] for commands in SESSIONS.values() for command in commands[1:]]
    assert {f"{script}.py" for script in page_session.SCRIPTS} == {one for one in scripts if one.endswith(".py")}
    for page in SESSIONS:
        text = (ROOT / "docs" / "how-to" / f"{page}.md").read_text(encoding="utf-8")
        first = text.split("\n\n")[1]
        assert first.startswith("What ")
        assert " protect" in first


def test_32_nothing_listens_unless_it_is_asked_for_but_the_panel_on_loopback(tmp_path):
    with faced(tmp_path) as live:
        port = int(live.started["panel"][0].partition("/enter")[0].rpartition(":")[2])
        here = {("tcp", f"0100007F:{port:04X}"), ("tcp6", f"{'0' * 24}01000000:{port:04X}")}
        found = listening(*family(live.process.pid))
        assert found
        assert found <= here
