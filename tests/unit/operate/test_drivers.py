"""Drivers: what an address says, how a drive is led and left, and what happens at the wires when one side is silent."""

import json
import os
import struct
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from tests import live_drive
from tests.live_bench import Bench

import detent
from detent.control import operation as ops
from detent.control.axis_states import ENABLED, FAULT, FAULT_REACTION, READY, STATE_NAMES, SWITCH_ON_DISABLED, ordered
from detent.control.operation import UNREADY, Operation
from detent.errors import (
    DRIVE_FAULT,
    DRIVE_LOST,
    MOTOR_LOAD,
    OTHER_HARDWARE,
    OVER_CURRENT,
    SENSOR_LOST,
    AxisError,
    DetentError,
)
from detent.faces.cia402 import Drive
from detent.methods.cascade.controller import CascadeLines
from detent.methods.cascade.led import LedCascade, led_wiring
from detent.methods.load import load_spec
from detent.methods.method import Plant
from detent.operate.drivers import cia402
from detent.operate.drivers.canopen_drive import CanopenDrive, read_address
from detent.operate.drivers.driver import Link, driver_of
from detent.operate.session import Session
from detent.operate.wires import Ends, Wires, give_lines, take_lines
from detent.operate.words import why_not_moving

MS = 1_000_000
SAID = "canopen 0x2a.0x1.0x3.0x7"

# ---- addresses


@pytest.mark.parametrize(
    "choice",
    ["canopen:", "canopen:can0@5", "canopen:socketcan:can0", "canopen:socketcan:can0@0", "canopen:socketcan:can0@127",
     "canopen:socketcan:can0@5?mode=force", "canopen:socketcan:can0@5?speed=1",
     "canopen:socketcan:can0@5?bitrate=fast", "modbus:x", "sim:here", ""],
)  # fmt: skip
def test_a_wrong_choice_of_a_driver_says_what_is_expected(choice):
    with pytest.raises(DetentError, match=r"expected: .*; try: "):
        driver_of(choice)


def test_the_plant_of_the_file_needs_no_driver_and_a_bus_has_a_rate():
    assert driver_of("sim") is None
    bus = {"interface": "virtual", "channel": "a@b", "bitrate": 1_000_000}
    assert read_address("virtual:a@b@5") == (bus, 5, "torque")
    assert read_address("virtual:a@b@5?mode=position") == (bus, 5, "position")


def test_without_the_packages_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "can", None)
    monkeypatch.delitem(sys.modules, "detent.operate.drivers.canopen_drive")
    with pytest.raises(DetentError, match=r"detent\[can\]"):
        driver_of("canopen:virtual:a@5")


@pytest.mark.parametrize(
    ("overrides", "got"),
    [(['drive.input="voltage"'], "voltage"), (["drive.delay=0"], "drive.delay = 0"),
     (['encoder.resolution="0 m"'], "without counts"), (['load_encoder.resolution="1 um"'], "on the load")],
)  # fmt: skip
def test_an_axis_that_such_a_drive_does_not_fit_is_refused(overrides, got):
    with pytest.raises(DetentError, match=got):
        Bench("cascade", *overrides, driver=CanopenDrive("virtual:none@5"), period=live_drive.SAMPLE)


def test_a_method_whose_lines_no_drive_has_is_refused():
    with pytest.raises(DetentError, match="filtered_servo"):
        Bench("filtered_servo", driver=CanopenDrive("virtual:none@5"))


def test_samples_and_periods_are_the_same_on_a_drive():
    with pytest.raises(DetentError, match=r"0\.25 ms"):
        Bench("cascade", driver=CanopenDrive("virtual:none@5"), period=1e-3)


# ---- words of CiA 402


@pytest.mark.parametrize("state", range(8))
def test_a_statusword_tells_its_state_whatever_the_other_bits(state):
    free = 0xFFFF & ~0x6F  # those that no state looks at
    assert all(cia402.state_of(cia402.WORDS[state] | more) == state for more in (0, free, 0x0210, 0x1400))


@pytest.mark.parametrize(
    ("word", "state", "then"),
    [(0x06, 1, 2), (0x07, 2, 3), (0x0F, 3, 4), (0x0F, 2, 4), (0x07, 4, 3), (0x06, 4, 2), (0x00, 4, 1), (0x02, 4, 5),
     (0x0F, 5, 4), (0x0F, 1, 1), (0x0F, 7, 7)],
)  # fmt: skip
def test_a_controlword_leads_where_cia_402_says(word, state, then):
    for order in cia402.orders_of(word, state):
        state = ordered(state, order)
    assert state == then


# ---- the wires


class Loop:
    """The loop's side of the wires, without a loop."""

    def __init__(self, lines: Any = CascadeLines) -> None:
        self.wires: Any = Wires()
        self.operation: Any = Operation(state=ENABLED)
        self.lines: Any = lines()
        self.ends = Ends(self.wires, lines, 0.03)

    def take(self, now: int) -> None:
        take_lines(self.wires, self.operation, self.lines, now)

    def give(self) -> None:
        give_lines(self.wires, self.operation, self.lines)


def test_lines_go_both_ways_each_by_who_writes_them():
    loop = Loop()
    assert not loop.ends.hear()
    loop.lines.command, loop.lines.enable, loop.lines.motor.count = 2.5, 1, 7
    loop.ends.lines.motor.count, loop.ends.lines.command = -123_456_789_012, 9.0
    loop.give()
    loop.ends.say(0, 0)
    assert loop.ends.hear()
    loop.take(1 * MS)
    assert (loop.ends.lines.command, loop.ends.lines.enable) == (2.5, 1)
    assert (loop.lines.motor.count, loop.lines.command) == (-123_456_789_012, 2.5)
    assert (loop.operation.barred, loop.operation.state) == (0, ENABLED)


def test_a_record_that_is_not_whole_is_left_alone():
    loop = Loop()
    loop.ends.lines.motor.count = 1
    loop.ends.say(0, 0)
    loop.take(1 * MS)
    loop.ends.lines.motor.count = 0x0102030405060708
    for spoilt in range(loop.wires.ins):
        loop.ends.say(0, 0)
        place = (loop.wires.written & 1) * 256 + spoilt
        loop.wires.input[place] ^= 1
        loop.take(2 * MS)
        assert (loop.lines.motor.count, loop.wires.torn) == (1, spoilt + 1)
    loop.ends.say(0, 0)
    loop.take(2 * MS)
    assert loop.lines.motor.count == 0x0102030405060708
    loop.give()
    loop.wires.output[(loop.wires.given & 1) * 256] ^= 1
    assert not loop.ends.hear()


def test_a_drive_that_is_silent_has_lost_its_torque_once():
    loop = Loop()
    loop.ends.say(0, 0)
    loop.take(10 * MS)
    loop.take(40 * MS)
    assert (loop.operation.fault, loop.operation.barred) == (0, 0)
    for now in (41, 42, 80):
        loop.take(now * MS)
        assert (loop.operation.fault, loop.operation.barred, loop.wires.lost) == (DRIVE_LOST, DRIVE_LOST, 1)
    assert loop.operation.state == FAULT_REACTION


def test_what_a_drive_tells_is_a_fault_once_and_bars_as_long_as_it_lasts():
    loop = Loop()
    loop.ends.say(0, DRIVE_FAULT)
    loop.take(1 * MS)
    assert (loop.operation.fault, loop.operation.state) == (DRIVE_FAULT, FAULT_REACTION)
    loop.operation.state, loop.operation.fault = SWITCH_ON_DISABLED, 0  # somebody has reset it
    loop.ends.say(0, DRIVE_FAULT)
    loop.take(2 * MS)
    assert (loop.operation.fault, loop.operation.barred) == (0, DRIVE_FAULT)
    loop.ends.say(UNREADY, 0)
    loop.take(3 * MS)
    assert loop.operation.barred == UNREADY


def test_before_the_first_word_it_is_barred():
    loop = Loop()
    loop.operation.state = SWITCH_ON_DISABLED
    loop.take(1 * MS)
    assert (loop.operation.barred, loop.operation.fault) == (DRIVE_LOST, 0)


# ---- a driver and its drive, a bus between them


class Wired:
    """A loop's side, a driver, and a drive before a machine that stands still."""

    def __init__(self, drive: Any, channel: str, wanted: str = SAID, mode: str = "torque") -> None:
        wiring = live_drive.machine_wiring(mode)
        self.loop, self.drive = Loop(wiring.lines), drive
        driver = CanopenDrive(f"virtual:{channel}@5?mode={mode}", 5.0)
        self.link = Link(driver, replace(wiring, hardware=wanted), self.loop.wires)

    def go(self, times: int, **lines: float) -> None:
        """So many exchanges, the loop awake in each."""
        for name, value in lines.items():
            setattr(self.loop.lines, name, value)
        for _ in range(times):
            self.loop.give()
            self.link.exchange()
            self.loop.take(1 * MS)


def test_a_drive_is_led_to_operation_and_loses_its_torque_in_one_exchange():
    with live_drive.still_drive("led", identity=live_drive.IDENTITY, rated=2.8) as drive:
        wired = Wired(drive, "led")
        wired.go(4)
        assert (drive.state, wired.loop.operation.barred) == (READY, 0)
        wired.go(4, enable=1, command=5.0)
        assert drive.state == ENABLED
        wired.go(2)
        assert drive.torque == 500  # thousandths of 2.8 N*m: 5 V of 0.8 A/V and 0.35 N*m/A
        wired.go(1, enable=0)
        assert (drive.state, drive.torque) == (SWITCH_ON_DISABLED, 0)
        wired.go(3)
        assert drive.state == READY
        wired.link.close()
        assert drive.state == SWITCH_ON_DISABLED


def test_positions_go_on_where_the_word_of_the_drive_wraps():
    with live_drive.still_drive("wraps", identity=live_drive.IDENTITY) as drive:
        wired = Wired(drive, "wraps")
        for count in range(0, 5 << 31, 1 << 30):
            drive.plant.state.lines.motor.count = count
            wired.go(1)
            assert wired.loop.lines.motor.count == count
        wired.link.close()


def test_a_drive_is_told_a_velocity_in_its_own_unit_and_none_without_its_enable():
    with live_drive.still_drive("velocity", "velocity", identity=live_drive.IDENTITY) as drive:
        drive._keep(cia402.VELOCITY_UNIT, 0, 0xFDB44700)  # thousandths of a revolution of 10 mm in a minute
        wired = Wired(drive, "velocity", mode="velocity")
        wired.go(4, velocity=0.1)
        assert struct.unpack("<Hi", drive._told)[1] == 0
        wired.go(5, enable=1, zero=-0.5)
        assert (drive.state, struct.unpack("<Hi", drive._told)[1]) == (ENABLED, 600_000)
        assert wired.loop.lines.samples == 9
        for _ in range(round(0.11 / live_drive.SAMPLE)):  # nobody steers
            wired.link.exchange()
        assert (drive.state != ENABLED, struct.unpack("<Hi", drive._told)[1], drive.torque) == (True, 0, 0)
        wired.link.close()


def test_a_drive_that_closes_its_own_loops_tells_its_torque_as_the_command_that_makes_it():
    with live_drive.still_drive("effort", "velocity", identity=live_drive.IDENTITY, rated=2.8) as drive:
        wired = Wired(drive, "effort", mode="velocity")
        drive.plant.state.lines.command = -5.0
        wired.go(9, enable=1)
        assert (drive.torque, wired.loop.lines.command) == (-500, pytest.approx(-5.0, abs=1e-9))
        wired.go(2, enable=0)
        assert (drive.torque, wired.loop.lines.command) == (0, 0.0)
        wired.link.close()


def test_a_drive_of_an_axis_whose_torque_per_command_is_not_known_is_not_asked_for_it():
    spec = load_spec(live_drive.FILE, ['drive.input="voltage"'])
    wiring = led_wiring(spec, "position")
    state: Any = LedCascade()
    drive = Drive(Plant(state, state, lambda: None), wiring, live_drive.NODE)
    state.lines.command = 5.0
    with live_drive.joined(drive, "no effort"):
        driver = CanopenDrive("virtual:no effort@5?mode=position", 5.0)
        assert "tells" not in {fact.name for fact in driver.open(wiring)}
        drive.state = ENABLED
        assert drive.torque == 0
        driver.close()


def test_a_drive_is_told_the_place_where_it_is_until_it_is_enabled_and_its_word_wraps():
    with live_drive.still_drive("position", "position", identity=live_drive.IDENTITY) as drive:
        wired, lines = Wired(drive, "position", mode="position"), drive.plant.state.lines
        lines.motor.count = 5 << 30
        wired.go(4, place=7.0)
        there, here = (5 << 30) * 1e-6, wired.loop.lines.motor.count  # which knows of the last 32 bits
        assert (lines.place, here) == (pytest.approx(there, abs=1e-9), 1 << 30)
        wired.go(6, enable=1, zero=-0.5, place=here * 1e-6 - 0.5 + 0.003)  # 3 mm from here, count 0 at -0.5 m
        assert (lines.place, lines.enable) == (pytest.approx(there + 0.003, abs=1e-9), 1)
        lines.motor.count += 3000
        wired.go(2, enable=0)
        assert (lines.place, lines.enable) == (pytest.approx(there + 0.003, abs=1e-9), 0)
        wired.link.close()
        assert drive.state == SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("mode", "offered", "got"),
    [("velocity", "position", r"without cyclic synchronous velocity .*try: \?mode=position"),
     ("torque", "velocity", r"without cyclic synchronous torque .*try: \?mode=velocity")],
)  # fmt: skip
def test_a_drive_without_the_mode_is_refused_and_another_named(mode, offered, got):
    with live_drive.still_drive("mode", offered), pytest.raises(DetentError, match=got):
        CanopenDrive(f"virtual:mode@5?mode={mode}", 5.0).open(live_drive.machine_wiring(mode))


def test_a_drive_that_stays_in_another_mode_is_refused(monkeypatch):
    monkeypatch.setattr("detent.faces.cia402.Drive._written", lambda *_, **__: None)  # says yes to any
    with live_drive.still_drive("stays", "velocity") as drive:
        drive._mode = cia402.CYCLIC["position"]
        with pytest.raises(DetentError, match=r"mode of operation 8 \(6061\) after 9"):
            CanopenDrive("virtual:stays@5?mode=velocity", 5.0).open(live_drive.machine_wiring("velocity"))


@pytest.mark.parametrize(
    ("unit", "sample", "got"),
    [(0x00010300, 0.25e-3, "unit 0x00010300"), (0xF7B50300, 0.25e-3, "0xf7b50300"),
     (0x00B50300, 1.0 / 3.0, "cannot be told"), (0x00B50300, 1e-3, "takes no demand every 1 ms")],
)  # fmt: skip
def test_a_drive_of_other_units_or_another_pace_is_refused(unit, sample, got):
    with live_drive.still_drive("units", "velocity") as drive:
        drive._keep(cia402.VELOCITY_UNIT, 0, unit)
        wiring = replace(live_drive.machine_wiring("velocity"), sample=sample)
        with pytest.raises(DetentError, match=got):
            CanopenDrive("virtual:units@5?mode=velocity", 5.0).open(wiring)


def test_a_coarse_velocity_is_pointed_out():
    with live_drive.still_drive("coarse", "velocity") as drive:
        drive._keep(cia402.VELOCITY_UNIT, 0, 0x01B44700)  # 10 rpm: 1.67 mm/s
        driver = CanopenDrive("virtual:coarse@5?mode=velocity", 5.0)
        facts = {fact.name: fact for fact in driver.open(live_drive.machine_wiring("velocity"))}
        assert "375 of them" in facts["takes"].caution
        assert "0.00167 m/s" in facts["takes"].value
        driver.close()


@pytest.mark.parametrize("wanted", ["", "canopen 0x1.0x1.0x1.0x1"])
def test_another_drive_is_barred_and_both_are_named(wanted):
    with live_drive.still_drive("other", identity=live_drive.IDENTITY) as drive:
        wired = Wired(drive, "other", wanted)
        wired.go(4)
        assert wired.loop.operation.barred == OTHER_HARDWARE
        assert SAID in wired.link.told
        assert wanted in wired.link.told
        wired.link.close()


@pytest.mark.parametrize(("error", "code"), [(0x2310, OVER_CURRENT), (0x2350, MOTOR_LOAD), (0x7305, SENSOR_LOST),
                                              (0x4210, DRIVE_FAULT)])  # fmt: skip
def test_a_fault_of_the_drive_is_told_and_reset_only_when_the_axis_was(error, code):
    with live_drive.still_drive("fault", identity=live_drive.IDENTITY) as drive:
        wired = Wired(drive, "fault")
        wired.go(4)
        wired.go(6, enable=1)
        drive.fail(error)
        wired.go(2)
        assert (wired.loop.operation.fault, wired.loop.operation.state) == (code, FAULT_REACTION)
        wired.loop.operation.state = FAULT
        wired.go(10, enable=0)
        assert (drive.state, drive.error) == (FAULT, error)
        wired.loop.operation.state = SWITCH_ON_DISABLED
        wired.go(6)
        assert (drive.state, drive.error, wired.loop.operation.barred) == (READY, 0, 0)
        wired.link.close()


def test_a_drive_that_leaves_its_operation_by_itself_is_a_fault():
    with live_drive.still_drive("left", identity=live_drive.IDENTITY) as drive:
        wired = Wired(drive, "left")
        wired.go(8, enable=1)
        assert drive.state == ENABLED
        drive.state = SWITCH_ON_DISABLED  # its own torque-off input, say
        wired.go(2)
        assert wired.loop.operation.fault == DRIVE_FAULT
        wired.go(8)
        assert drive.state != ENABLED
        wired.link.close()


def test_a_loop_that_says_nothing_loses_the_drive():
    with live_drive.still_drive("silent", identity=live_drive.IDENTITY) as drive:
        wired = Wired(drive, "silent")
        wired.go(8, enable=1, command=5.0)
        torques = []
        for _ in range(round(0.11 / live_drive.SAMPLE)):
            wired.link.exchange()
            torques.append(drive.torque)
        assert torques[0] != 0
        falls = [k for k, (one, other) in enumerate(pairwise(torques)) if one != 0 == other]
        assert falls == [pytest.approx(0.1 / live_drive.SAMPLE, abs=3)]
        assert drive.state != ENABLED
        wired.link.close()


@pytest.mark.parametrize(("option", "state", "torque"), [(0, ENABLED, 500), (1, FAULT, 0), (2, SWITCH_ON_DISABLED, 0),
                                                         (3, SWITCH_ON_DISABLED, 0)])  # fmt: skip
def test_a_drive_without_its_master_does_what_its_option_says(option, state, torque):
    now = 0.0
    with live_drive.still_drive(f"abort {option}", identity=live_drive.IDENTITY, rated=2.8, clock=lambda: now) as drive:
        drive.node.set_data(cia402.ABORT, 0, option.to_bytes(2, "little"))
        wired = Wired(drive, f"abort {option}")
        (fact,) = [fact for fact in wired.link.facts if "6007" in fact.name]
        assert bool(fact.caution) == (option == 0)
        wired.go(8, enable=1, command=5.0)
        drive.watch()
        assert drive.torque == 500
        now = 0.031
        drive.watch()
        assert (STATE_NAMES[drive.state], drive.torque) == (STATE_NAMES[state], torque)
        wired.link.close()


@pytest.mark.parametrize(
    ("index", "part", "value", "got"),
    [(cia402.RESOLUTION, 1, 4096, "4.096 counts"), (cia402.MODES, 0, 0x1, "without cyclic synchronous torque"),
     (cia402.RATED_TORQUE, 0, 10, "rated torque of 0.01")],
)  # fmt: skip
def test_a_drive_that_does_not_fit_is_refused(index, part, value, got):
    with live_drive.still_drive("unfit") as drive:
        drive._keep(index, part, value)
        with pytest.raises(DetentError, match=got):
            CanopenDrive("virtual:unfit@5", 5.0).open(live_drive.machine_wiring())


def test_where_no_drive_answers_it_says_what_to_look_at(monkeypatch):
    monkeypatch.setattr("canopen.sdo.client.SdoClient.RESPONSE_TIMEOUT", 1e-3)
    with pytest.raises(AxisError, match=r"no answer .*expected: .*try: look at cable"):
        CanopenDrive("virtual:nobody@5", 5.0).open(live_drive.machine_wiring())


def test_a_master_cannot_map_what_the_face_does_not_have():
    with live_drive.still_drive("mapped", identity=live_drive.IDENTITY) as drive:
        network = live_drive.canopen.Network()
        network.connect(interface="virtual", channel="mapped")
        node = network.add_node(5, cia402.dictionary(5))
        with pytest.raises(live_drive.canopen.SdoAbortedError, match="0604"):
            node.sdo[cia402.RX_MAP][2].raw = 0x60FF0020
        assert node.sdo[cia402.STATUS].raw & 0x4F == 0x40
        assert drive.state == SWITCH_ON_DISABLED
        network.disconnect()


# ---- in wall time, as a command


@pytest.mark.wide
@pytest.mark.process
def test_detent_live_runs_on_a_drive_over_a_serial_bus(tmp_path):
    file = tmp_path / "cascade.toml"
    slow = live_drive.FILE.read_text().replace('"0.25 ms"', '"20 ms"')
    file.write_text(slow)
    with live_drive.wire() as (near, far), live_drive.served(f"slcan:{far}@5"):
        live_drive.open_late(f"slcan:{near}@5")
        words = [sys.executable, "-m", "detent", "live", str(file), "--json", "--period", "20 ms"]
        words += ["--drive", f"canopen:slcan:{near}@5"]
        env = os.environ | {"XDG_RUNTIME_DIR": str(tmp_path)}
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env) as process:
            assert process.stdout is not None
            said = json.loads(process.stdout.readline())
            assert (said["simulated"], said["hardware"]) == (False, SAID)
            assert any("6007" in fact for fact in said["drive"])
            with detent.connect(Path(said["channel"])) as axis:
                assert axis.position == pytest.approx(0.02, abs=2e-6)
                refused = ""
                while SAID not in refused:  # a busy machine may lose the heartbeat for a while
                    with pytest.raises(DetentError) as told:
                        axis.enable()
                    refused = str(told.value)
                    assert SAID in refused or "(40)" in refused
            process.terminate()
            assert process.wait(timeout=60) == 0


def test_why_not_moving_names_the_bar():
    bench = Bench("cascade")
    bench.pass_time(0.01)
    bench.operation.barred = DRIVE_LOST
    assert bench.do(ops.ENABLE).why == DRIVE_LOST
    assert any("(40)" in what for what, _ in why_not_moving(Session(bench.host, {}).status()))
