"""Faces specification, section 3: clients that are not ours, each in an environment of its own.

What each of them needs to be told is what `detent live` prints.
"""

import json
import os
import re
import signal
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numba
import pytest
from tests import foreign
from tests.face_rig import Faced, connected, drive_on_virtual, faced, family, listening, wire
from tests.places import ROOT

from detent.faces.child import FACES
from detent.faces.set_points import SetPoints

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
    assert found["round_trip_ms"] < 20.0


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
    folder = foreign.npm("modbus-serial@8.0.25")
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


def free_port() -> int:
    """A port that nobody has now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


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
    """The cascade axis as a motor record; somebody else's repeater, so that no client leaves one of its own behind."""
    pytest.importorskip("caproto")
    pytest.importorskip("p4p")
    places = [f"{RECORD}@:{free_port()}" for _ in range(2)]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    repeater = subprocess.Popen([str(foreign.environment("epics").parent / "caproto-repeater")], **quiet)
    try:
        with faced(tmp_path_factory.mktemp("epics"), "--epics", places[0], "--pva", places[1]) as live:
            yield Epics(live)
    finally:
        repeater.terminate()
        repeater.wait()


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
    assert (found["extras"]["trust"], found["extras"]["state"]) == ("referenced", "operation enabled")
    assert found["extras"]["sample"].count(",") == 4


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


def test_12_the_sheet_is_loaded_and_comes_out_equal(still, tmp_path):
    canopen = pytest.importorskip("canopen")
    with drive_on_virtual(still, "twelve") as (_, _, sheet):
        first = canopen.import_od(sheet, 5)
        again = tmp_path / "again.eds"
        canopen.export_od(first, str(again))

        def lines(file: Path) -> list[str]:
            stamps = ("CreationDate", "CreationTime", "ModificationDate", "ModificationTime", "FileName")
            return [one for one in file.read_text().splitlines() if not one.startswith(stamps)]

        assert lines(again) == lines(Path(sheet))
        assert len(first) > 40


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


def test_29_a_second_commander_is_refused_by_each_protocol_and_may_stop(axis):
    with connected(axis) as own:
        own.do("take")
        own.enable()
        own.confirm()
        moving = own.move_to("400 mm", speed=0.1, wait=False)
        scpi = foreign.run("visa", "scpi", axis.place("scpi"), "refused")
        assert not scpi["refused"].startswith("0,")
        assert "(43)" in scpi["move_refused"]
        assert scpi["stop"].startswith("0,")
        with pytest.raises(Exception, match="stop ended it"):
            moving.wait()
        for environ, script, place in (
            ("pi", "gcs", axis.port("gcs")), ("zaber", "zaber", axis.port("zaber")),
        ):  # fmt: skip
            moving = own.move_to("400 mm", speed=0.05, wait=False)
            found = foreign.run(environ, script, place, "refused")
            assert found["move"], f"{script} moved an axis that somebody else commands"
            with pytest.raises(Exception, match="stop ended it"):
                moving.wait()
        moving = own.move_to("400 mm", speed=0.05, wait=False)
        found = foreign.run("alpaca", "alpaca", axis.place("alpaca"), "focuser", "refused")
        assert found["move"] == "InvalidOperationException"
        with pytest.raises(Exception, match="stop ended it"):
            moving.wait()
        moving = own.move_to("400 mm", speed=0.05, wait=False)
        found = foreign.run("modbus", "modbus", axis.port("modbus"), "refused")
        assert (found["move"], found["stop"]) == ([4, 43], [2, 0])
        with pytest.raises(Exception, match="stop ended it"):
            moving.wait()


@contextmanager
def stopped_by_another(live: Faced) -> Iterator[Any]:
    """Somebody leads a move from 20 mm, and has it ended by a stop of another before it arrives."""
    with connected(live) as own:
        own.do("take")
        own.enable()
        own.confirm()
        own.move_to("20 mm")
        moving = own.move_to("450 mm", speed=0.05, wait=False)
        yield own
        with pytest.raises(Exception, match="stop ended it"):
            moving.wait()
        own.do("leave")


def test_29_a_second_commander_by_epics_is_refused_and_may_stop(epics):
    with stopped_by_another(epics.live):
        found = epics.run("epics", "ophyd_motor", RECORD, "pyepics", "refused")
        assert found["put"] == "ErrorResponseReceived"
        assert found["set_point"] != 60.0


def test_29_a_second_commander_by_grbl_is_refused_and_may_stop(axis):
    with connected(axis) as own:
        own.do("take")
        own.enable()
        client = foreign.start("grbl", "grbl", axis.place("grbl"), "refused")
        assert json.loads(client.stdout.readline()) == {"move": ["error:9"]}
        with pytest.raises(Exception, match="stop ended it"):  # whose connection is not at rest begins with a stop
            own.move_to("450 mm", speed=0.05)
        own.do("leave")
        assert client.wait(20) == 0, client.stderr.read()
        client.communicate()


@pytest.mark.parametrize("word", [0x0B, 0x10F])  # quick stop, halt
def test_29_a_second_master_sees_that_the_drive_is_not_remote_and_may_stop(still, word):
    with drive_on_virtual(still, f"second {word}") as (_, network, sheet), stopped_by_another(still) as own:
        node = remote(network, sheet)
        assert not node.sdo[0x6041].raw >> 9 & 1
        running = own.status["running"]
        node.sdo[0x607A].raw = 60_000
        node.sdo[0x6040].raw = 0x0F
        node.sdo[0x6040].raw = 0x1F
        time.sleep(0.3)
        assert own.status["running"]["id"] == running["id"]
        node.sdo[0x6040].raw = word


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


def missed(own: Any, seconds: float) -> float:
    """Share of the periods that the loop skips meanwhile."""
    before = own.status["loop"]
    time.sleep(seconds)
    after = own.status["loop"]
    return (after["skipped"] - before["skipped"]) / (after["periods"] - before["periods"])


@pytest.mark.wide
def test_28_four_faces_and_a_panel_show_the_same_sample(axis, plain):
    with connected(plain) as own:
        without = missed(own, 5.0)
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
            late = missed(own, 12.0)
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
    assert late <= 1.5 * without + 0.005


PAGES = {
    "scan-with-bluesky": ("epics",), "cia402-drive-without-hardware": ("canopen",), "modbus-hand-shake": ("modbus",),
    "line-protocols": ("scpi", "grbl", "gcs", "zaber", "alpaca"),
}  # fmt: skip
"""Of each face, the page with its session."""


def test_31_each_face_has_a_page_whose_session_the_tests_run():
    tested = "".join(one.read_text(encoding="utf-8") for one in Path(__file__).parent.glob("test_faces*.py"))
    assert {face for faces in PAGES.values() for face in faces} | {"pva"} == set(FACES)
    for page, faces in PAGES.items():
        text = (ROOT / "docs" / "how-to" / f"{page}.md").read_text(encoding="utf-8")
        assert text.split("\n\n")[1].startswith("What ")
        assert "cannot protect" in text or "can protect" in text
        shown = re.findall(r"literalinclude\} \.\./\.\./tests/clients/(\w+)\.py", text)
        assert len(shown) >= len(faces)
        assert all(f'"{script}"' in tested or f"clients.{script} " in tested for script in shown)
        assert all(f"--{face}" in text for face in faces)


def test_31_a_first_scan(epics):
    found = epics.run("epics", "first_scan", RECORD)
    assert (found["points"], found["unit"]) == (21, "mm")
    assert found["worst"] <= WINDOW


def test_31_twenty_lines_of_a_plc(axis):
    found = foreign.run("modbus", "plc", axis.port("modbus"))
    assert (found["enable"], found["move"]) == ([2, 0], [2, 0])
    assert near(found["position"] * 1e-3, 45.0)


def test_32_nothing_listens_unless_it_is_asked_for_but_the_panel_on_loopback(tmp_path):
    with faced(tmp_path) as live:
        port = int(live.started["panel"][0].partition("/enter")[0].rpartition(":")[2])
        here = {("tcp", f"0100007F:{port:04X}"), ("tcp6", f"{'0' * 24}01000000:{port:04X}")}
        found = listening(*family(live.process.pid))
        assert found
        assert found <= here
