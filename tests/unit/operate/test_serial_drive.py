"""The driver of a board: who is there, what goes to and fro, and a line that fails; the board is made of frames."""

import hashlib
import struct
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from tests.live_board import FILE

from detent.errors import AxisError, DetentError
from detent.faces.board import SimulatedBoard
from detent.kernel.registers import PLANT
from detent.methods.cascade.controller import CascadeLines
from detent.methods.cascade.led import LedCascade, LedLines, LedParams, hear, led_machine, led_wiring, tell
from detent.methods.cascade.wired import CascadeMachine, wiring
from detent.methods.load import load_spec
from detent.methods.method import Plant
from detent.methods.registry import METHODS
from detent.operate.drivers import serial_drive
from detent.operate.drivers.driver import Link, driver_of
from detent.operate.drivers.frames import Frame, Receiver, encode
from detent.operate.drivers.serial_drive import ASK, HEAD, IDENTITY, MAILBOX, RESET, TELEMETRY, SerialDrive
from detent.operate.wires import Wires, wire_hash

SPEC = load_spec(FILE, ())
MAIL = struct.Struct("<BBBdddd")  # flags, then the lines in their order


def number_of(firmware: bytes) -> int:
    """As the export writes it into its header."""
    return int(hashlib.sha256(firmware).hexdigest()[:16], 16)


class Port:
    """A board at the other end of a port: it answers what it is asked, and keeps what it was told."""

    def __init__(self, *_words: Any, **_more: Any) -> None:
        self.out, self.heard = bytearray(), list[Frame]()
        self.receiver, self.sent, self.timeout, self.broken, self.open = Receiver(), 0, 0.0, False, True
        self.identity = (
            struct.pack("<QI", number_of(led_wiring(SPEC, "position").firmware), wire_hash(LedLines)) + b"one"
        )

    @property
    def in_waiting(self) -> int:
        return len(self.out)

    def read(self, count: int) -> bytes:
        found, self.out = bytes(self.out[:count]), self.out[count:]
        return found

    def write(self, data: bytes) -> None:
        if self.broken:
            raise OSError("gone")
        for frame in self.receiver.feed(data):
            self.heard.append(frame)
            if frame.kind == ASK and self.identity:
                self.say(IDENTITY, self.identity)

    def say(self, kind: int, payload: bytes) -> None:
        """A frame of the board."""
        self.out += encode(kind, self.sent, payload)
        self.sent += 1

    def tell(self, count: int, *, fault: int = 0, samples: int = 1) -> None:
        """Telemetry."""
        lines: Any = LedLines(samples=samples)
        lines.motor.count = count
        words = struct.pack("<qdBBqqdBdq", count, 0.0, 0, 1, 0, 0, 0.0, 0, 2.5, samples)
        self.say(TELEMETRY, HEAD.pack(1, fault, 7, 2, 3) + words)

    def close(self) -> None:
        self.open = False


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    """The port that the next driver opens."""
    made = Port()
    monkeypatch.setattr(serial_drive.serial, "Serial", lambda *_words, **_more: made)
    monkeypatch.setattr(serial_drive, "PATIENCE", 0.02)
    return made


@pytest.mark.parametrize(
    "choice", ["serial:", "serial:?baud=9600", "serial:/dev/x?baud=fast", "serial:/dev/x?parity=odd"]
)
def test_a_wrong_address_says_what_is_expected(choice: str) -> None:
    with pytest.raises(DetentError, match=r"expected: PORT.*; try: serial:/dev/ttyACM0"):
        driver_of(choice)


def test_a_board_says_who_it_is_and_what_it_runs(port: Port) -> None:
    link = Link(SerialDrive("/dev/x?baud=115200", 1e-3), led_wiring(SPEC, "position"), Wires())
    facts = {fact.name: fact.value for fact in link.facts}
    assert link.driver.hardware == "serial one"
    assert "10000 counts" in facts["measures"]
    assert f"{number_of(led_wiring(SPEC, 'position').firmware):016X}" in facts["firmware"]
    assert facts["from the board"] == "1 frames, 0 missing, 0 spoilt"
    link.close()
    assert not port.open


@pytest.mark.parametrize(("which", "got"), [(0, "parameters"), (1, "lines")])
def test_another_firmware_is_refused(port: Port, which: int, got: str) -> None:
    words = [*struct.unpack_from("<QI", port.identity)]
    words[which] ^= 1
    port.identity = struct.pack("<QI", *words) + b"one"
    with pytest.raises(DetentError, match=rf"F66: got a firmware with the {got}.*try: detent export firmware"):
        SerialDrive("/dev/x").open(led_wiring(SPEC, "position"))
    assert not port.open


def test_where_no_board_answers_it_says_what_to_look_at(port: Port) -> None:
    port.identity = b""
    with pytest.raises(AxisError, match=r"no answer of a board.*expected: .*try: look at cable"):
        SerialDrive("/dev/x").open(led_wiring(SPEC, "position"))


def test_where_there_is_no_port_it_says_so() -> None:
    with pytest.raises(AxisError, match="/dev/no-such-port"):
        SerialDrive("/dev/no-such-port").open(led_wiring(SPEC, "position"))


def opened(port: Port) -> SerialDrive:
    """A driver that knows its board, which has heard nothing else yet."""
    made = SerialDrive("/dev/x", 1e-3)
    made.open(led_wiring(SPEC, "position"))
    port.heard.clear()
    return made


def test_a_mailbox_carries_what_the_controller_writes_in_its_order(port: Port) -> None:
    drive = opened(port)
    drive.write(LedLines(enable=1, known=1, zero=0.5, place=0.25, velocity=-0.125, acceleration=3.0), reset=False)
    drive.write(LedLines(), reset=True)
    assert [frame.kind for frame in port.heard] == [MAILBOX, MAILBOX]
    assert MAIL.unpack(port.heard[0].payload) == (0, 1, 1, 0.5, 0.25, -0.125, 3.0)
    assert MAIL.unpack(port.heard[1].payload)[:2] == (RESET, 0)


def test_of_what_was_told_the_last_counts_and_a_fault_bars(port: Port) -> None:
    drive, lines = opened(port), LedLines()
    assert not drive.read(lines)
    assert not drive.ready
    port.tell(5)
    port.tell(-123_456_789_012, samples=9)
    port.say(TELEMETRY, b"too short")
    assert drive.read(lines)
    assert (lines.motor.count, lines.home.switch, lines.command, lines.samples) == (-123_456_789_012, 1, 2.5, 9)
    assert (drive.ready, drive.fault) == (True, 0)
    assert [fact.value for fact in drive.counted()] == [
        "4 frames, 0 missing, 0 spoilt",
        "7 frames, 3 missing, 2 spoilt",
    ]
    port.tell(6, fault=10)
    assert drive.read(lines)
    assert (drive.ready, drive.fault) == (False, 10)


def test_a_port_that_is_pulled_out_is_silence(port: Port, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = opened(port)
    port.broken = True
    drive.write(LedLines(), reset=False)
    assert not drive.ready

    def gone(_count: int) -> bytes:
        raise OSError("gone")

    monkeypatch.setattr(port, "read", gone)
    assert not drive.read(LedLines())
    drive.close()


def test_the_end_is_told_more_than_once(port: Port) -> None:
    drive = opened(port)
    drive.close()
    assert [MAIL.unpack(frame.payload)[1] for frame in port.heard] == [0, 0, 0]
    assert not port.open


# ---- what leads it


def leading(mode: str) -> tuple[Any, Any]:
    """Parameters and registers of the example, its loops elsewhere, enabled at rest at 20 mm."""
    from detent.methods.cascade.build import build_cascade

    p, r = LedParams(controller=build_cascade(SPEC).controller, on_velocity=int(mode == "velocity")), LedCascade()
    r.lines.motor.count = r.controller.count = 20_000
    r.controller.motor_sensor.memory[:] = [0.02] * 64
    r.controller.motor_sensor.position = r.controller.reference.position = 0.02
    r.controller.on = r.controller.known = r.controller.guarded = 1
    return p, r


def one_sample(p: Any, r: Any, count: int | None) -> None:
    """A sample in which this count was told, or nothing."""
    if count is not None:
        r.lines.motor.count = count
        r.lines.samples += 1
    hear(p.controller, r.controller, r.lines)
    tell(p, r.controller, r.lines)


def test_a_sample_that_was_not_heard_is_no_jump() -> None:
    """At the largest speed each second sample is lost: the way of two comes at once, and no fault with it."""
    p, r = leading("position")
    way = SPEC.limits.speed * p.controller.law.period
    r.controller.reference.velocity = SPEC.limits.speed
    for k in range(1, 400):
        r.controller.reference.position = 0.02 + (k + 1) * way
        one_sample(p, r, round((0.02 + k * way) * 1e6) if k % 2 else None)
        assert (r.controller.guard.code, r.lines.enable) == (0, 1)
    assert r.controller.motor_sensor.position == pytest.approx(0.02 + 399 * way, abs=2e-6)


def test_an_axis_that_does_not_follow_is_let_go() -> None:
    p, r = leading("position")
    r.controller.reference.position = 0.02 + 3.0 * SPEC.method.following_error
    for _ in range(1000):
        one_sample(p, r, 20_000)
        if not r.lines.enable:
            break
    assert (r.lines.enable, r.controller.guard.code) == (0, 10)


def test_on_velocity_the_position_loop_is_closed_here_within_its_limit() -> None:
    p, r = leading("velocity")
    gain, period = SPEC.method.position_gain, p.controller.law.period
    r.controller.reference.position, r.controller.reference.velocity = 0.0201, 0.25
    one_sample(p, r, 20_000)
    assert r.lines.velocity == pytest.approx(0.25 + gain * (1e-4 - 0.25 * period), rel=1e-12)
    p.controller.law.cascade.max_velocity = 0.1
    one_sample(p, r, 20_000)
    assert r.lines.velocity == 0.1
    r.controller.on = 0
    one_sample(p, r, 20_000)
    assert (r.lines.velocity, r.lines.enable) == (0.0, 0)


def test_counts_have_their_zero_where_the_reference_was_found() -> None:
    p, r = leading("position")
    r.controller.motor_sensor.zero = -0.005
    one_sample(p, r, 30_000)
    assert (r.lines.zero, r.controller.motor_sensor.position) == (-0.005, pytest.approx(0.025, abs=1e-12))


@pytest.mark.parametrize(
    ("overrides", "mode", "got"),
    [(['load_encoder.resolution="1 um"'], "position", "on the load"),
     (['encoder.resolution="0 m"'], "position", "without counts"),
     (['limit_switches.lower="-1 mm"', 'limit_switches.upper="0.51 m"'], "velocity", "limit switches"),
     (['method.structure="pid"', 'method.proportional="60 kV/m"', 'method.derivative="60 V*s/m"'], "velocity", "pid")],
)  # fmt: skip
def test_an_axis_that_cannot_be_led_so_is_refused(overrides: list[str], mode: str, got: str) -> None:
    with pytest.raises(DetentError, match=rf"got .*{got}.*expected: .*try: "):
        led_wiring(load_spec(FILE, overrides), mode)


@pytest.mark.compiled
@pytest.mark.parametrize("mode", ["position", "velocity"])
def test_the_axis_of_the_file_follows_what_it_is_told(mode: str) -> None:
    """A drive with the loops of the file: 20 ms of a ramp, and where it then is."""
    plant, wiring = led_machine(SPEC, mode)
    lines: Any = plant.state.lines
    assert (lines.motor.count, wiring.mode) == (20_000, mode)
    speed, period = 0.05, wiring.sample
    lines.enable = 1
    for k in range(80):
        lines.velocity = min(5.0 * k * period, speed)
        lines.place = 0.02 + lines.velocity**2 / 10.0 + max(k * period - 0.01, 0.0) * speed
        plant.sample()
    expected = 0.02 + speed**2 / 10.0 + (79 * period - 0.01) * speed
    assert lines.motor.count * 1e-6 == pytest.approx(expected, abs=2e-4)


PROGRAM = """#!{python}
import struct, sys
print("/dev/its-line", file=sys.stderr, flush=True)
while len(sys.stdin.buffer.read({shown})) == {shown}:
    sys.stdout.buffer.write(struct.pack("<BBBd", 1, 1, 1, 2.5))
    sys.stdout.buffer.flush()
"""


@pytest.mark.process
def test_a_board_that_is_none_has_the_machine_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What its program tells the amplifier acts in the mechanics, once in a sample."""
    state: Any = CascadeMachine()
    seen = list[tuple[int, float]]()
    plant = Plant(state, state, lambda: seen.append((state.lines.enable, state.lines.command)))
    monkeypatch.setattr(type(METHODS["cascade"]), "machine", lambda _self, spec: (plant, wiring(spec)))
    shown = sum(leaf.width.size for leaf in CascadeLines.leaves() if leaf.by == PLANT)
    program = tmp_path / "board"
    program.write_text(PROGRAM.format(python=sys.executable, shown=shown))
    program.chmod(0o700)
    board = SimulatedBoard(program, FILE)
    assert board.line == "/dev/its-line"
    board.sample()
    left = threading.Event()
    plant_sample = plant.sample
    monkeypatch.setattr(board, "plant", Plant(state, state, lambda: (plant_sample(), len(seen) == 5 and left.set())[0]))
    board.run(left)
    assert seen == [(1, 2.5)] * 5
    assert board.close() == 0
