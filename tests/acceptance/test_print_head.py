"""Print-head specification, acceptance tests 1 to 56.

Every tolerance is the specification's; a second bound, on the side where a figure would be better than it can be, is
worked out beside it.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.print_head_rig import COUNT, EMITTER, TICK, Rig, make_spec

from detent.control.feed_forward import (
    low_speed_start_emitters,
    ramp_interval_us,
    steady_drive,
    stop_distance_up,
    window_reference,
)
from detent.control.head_computer import (
    FAULT,
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    HOME_LEFT,
    HOME_RIGHT,
    IDLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    OK,
    HeadComputer,
    HeadParams,
)
from detent.control.head_motion import put_braking, put_drive, put_low, trim_high, trim_low
from detent.control.head_sequence import decide
from detent.control.latch import QUEUE_LENGTH, Latch, StatusPort, pass_on, read_latch, send, write_latch
from detent.control.self_identification import IdentifiedLine, PlausibleLimits, identify
from detent.control.speed_selection import fits, select_speed
from detent.drive.h_bridge import Bridge, BridgeLines, decode, steer, terminal_voltage
from detent.drive.pwm_timer import CLOCKS_PER_PERIOD, PwmTimer, clock, trigger
from detent.kernel.step import step
from detent.methods.print_head.comparison import DriveComparison, DriveConstants, MeasuringBench, compare_drives
from detent.methods.print_head.controller import PrintHeadLines
from detent.plant.drive_train import DriveTrain, DriveTrainParams, fill_period
from detent.plant.switched_motor import Scratch, SwitchedParams, fill_pulse_table, move_switched

INCH = 0.0254
RIGHT, LEFT = 1, -1
Q1, Q2, Q3, Q4 = 1, 2, 4, 8

# ------------------------------------------------------------------------------------------------- PWM and bridge


@pytest.mark.parametrize(
    ("count", "high_us", "volts"),
    [
        (0, 0.0, 0.0),
        (1, 0.1333, 0.1267),
        (75, 10.0, 9.5),
        (150, 20.0, 19.0),
        (299, 39.867, 37.873),
        (300, 40.0, 38.0),
    ],
)
def test_01_high_time_and_mean_voltage_of_a_count(count, high_us, volts):
    timer = PwmTimer()
    for _ in range(3):
        high = sum(high_clocks(timer, count))
        assert high == count  # exact to one clock, and here to none: 0 is permanently low, 300 permanently high
        assert high / 7.5 == pytest.approx(high_us, abs=5e-4)
        assert 38.0 * high / CLOCKS_PER_PERIOD == pytest.approx(volts, abs=5e-4)
    bridge = Bridge()
    steer(bridge, BridgeLines(right_left=1), timer.pulse, 38.0)
    assert bridge.mean_positive == pytest.approx(volts, abs=5e-4)


def high_clocks(timer: PwmTimer, count: int) -> Iterator[bool]:
    """PWM line at each clock of one period."""
    trigger(timer, count)
    for _ in range(CLOCKS_PER_PERIOD):
        yield timer.counter > 0
        clock(timer)


def test_02_a_count_written_in_mid_period_waits_for_the_next_trigger():
    timer, lines = PwmTimer(), PrintHeadLines(count=100)
    high = 0
    for k, level in enumerate(high_clocks(timer, lines.count)):
        if k == 50:
            lines.count = 200
        high += level
    assert high == 100
    assert sum(high_clocks(timer, lines.count)) == 200


@given(value=st.integers(-300, 300), braking=st.booleans(), direction=st.sampled_from((RIGHT, LEFT)))
def test_03_the_timer_never_gets_a_negative_number(value, braking, direction):
    p, c = HeadParams(drive_limit=300, transition=1), HeadComputer(direction=direction)
    before = c.out.right_left
    if braking:
        c.drive = value
        put_braking(p, c)
        signed = direction * value
    else:
        put_drive(p, c, value)
        signed = value
    assert 0 <= c.out.count <= 300
    assert c.drive_cmd == signed
    if signed:
        assert c.out.right_left == (1 if signed > 0 else 0)
    elif not braking:
        assert c.out.right_left == before  # no drive, no direction: the line stays
    # In transition mode the modulator is the complement, so that the mean terminal voltage stays the drive value.
    assert c.out.count == (300 - value if braking and value > 0 else abs(value))


def test_04_decoder_table():
    table = {
        # (TR, right/left): gates while PWM is low, while it is high
        (0, 0): (Q3, Q3 | Q2),
        (0, 1): (Q4, Q4 | Q1),
        (1, 1): (0, Q3),
        (1, 0): (0, Q4),
    }
    for (transition, right_left), rows in table.items():
        for pwm, expected in enumerate(rows):
            gates = decode(pwm, right_left, transition)
            assert gates == expected
            assert gates & (Q1 | Q3) != Q1 | Q3, "leg A shorted"
            assert gates & (Q2 | Q4) != Q2 | Q4, "leg B shorted"
            if transition:
                assert gates.bit_count() == pwm  # exactly one switch may conduct


@dataclass(frozen=True)
class SteadyBridge:
    """What the switch-level bridge does at constant speed, after the current has settled."""

    current: float
    """Mean [A]."""
    voltage: float
    """Mean at the terminals [V]."""
    ripple: float
    """Peak to peak [A], meaningful while the current keeps its sign."""


def at_constant_speed(emf: float, bridge: Bridge) -> SteadyBridge:
    """Switch-level motor of 12 ohm, 12 mH at a constant back-EMF [V]: a carriage too heavy to change its speed."""
    p, q = _heavy_machine()
    r, w = DriveTrain(velocity=emf / p.emf_constant, position=0.5), Scratch()
    currents, voltages = [], []
    for n in range(900):  # 36 ms: 36 electrical time constants
        voltages_of = (bridge.on_positive, bridge.on_negative, bridge.off_positive, bridge.off_negative)
        r.peak_current, valley = 0.0, abs(r.current)
        move_switched(p, q, r, w, bridge.pulse, *voltages_of)
        if n >= 800:
            currents.append(r.mean_current)
            voltages.append(r.voltage)
    assert r.velocity * p.emf_constant == pytest.approx(emf, rel=1e-9)
    return SteadyBridge(float(np.mean(currents)), float(np.mean(voltages)), abs(r.peak_current - valley))


@cache
def _heavy_machine() -> tuple[DriveTrainParams, SwitchedParams]:
    p = DriveTrainParams(resistance=12.0, inductance=12e-3, force_constant=19.87, emf_constant=19.87, mass=1e12)
    p.left_end, p.right_end, p.period, p.substep = -1e6, 1e6, 40e-6, 0.25 / 1000
    fill_period(p)
    q = SwitchedParams()
    fill_pulse_table(p, q)
    return p, q


def steered(pulse: int, *, right: bool, transition: bool) -> Bridge:
    """The bridge as the decoder steers it."""
    bridge = Bridge()
    steer(bridge, BridgeLines(right_left=right, transition=transition), pulse, 38.0)
    return bridge


def gated(pulse: int, gates_on: int, gates_off: int) -> Bridge:
    """The bridge with gates that the decoder would not choose."""
    voltages = [terminal_voltage(gates, 38.0, sign) for gates in (gates_on, gates_off) for sign in (1, -1)]
    return Bridge(
        pulse=pulse,
        on_positive=voltages[0],
        on_negative=voltages[1],
        off_positive=voltages[2],
        off_negative=voltages[3],
    )


EMF_40 = 20.19
"""Back-EMF at 40 in/s moving right [V]."""


def test_05_drive_right_195():
    found = at_constant_speed(EMF_40, steered(195, right=True, transition=False))
    assert found.current == pytest.approx(0.376, rel=0.01)
    assert found.ripple == pytest.approx(0.029, rel=0.20)
    assert found.ripple == pytest.approx(38 * 0.65 * 0.35 * 40e-6 / 12e-3, rel=0.01)  # V D (1 - D) T / L


def test_06_drive_below_the_back_emf_coasts():
    found = at_constant_speed(EMF_40, steered(99, right=True, transition=False))
    assert abs(found.current) < 0.02
    # Not exactly nothing: 38 V against 20.19 V for 13.2 us, then down to zero against 20.19 V; a triangle each period.
    peak = (38 - EMF_40) / 12e-3 * 13.2e-6
    assert found.current == pytest.approx(peak * (13.2e-6 + peak * 12e-3 / EMF_40) / 2 / 40e-6, rel=0.03)


def test_07_transition_brakes_with_the_commanded_mean_voltage():
    found = at_constant_speed(EMF_40, steered(201, right=True, transition=True))
    assert found.current == pytest.approx(-0.637, rel=0.01)
    assert found.voltage == pytest.approx(12.54, rel=0.01)


def test_08_the_wrong_switch_or_a_forgotten_complement_cannot_brake():
    assert steered(201, right=True, transition=True).gates_on == Q3
    assert at_constant_speed(EMF_40, gated(201, Q4, 0)).current == 0.0
    forgotten = at_constant_speed(EMF_40, steered(99, right=True, transition=True))
    assert abs(forgotten.current) < 0.02


def test_09_transition_moving_left():
    found = at_constant_speed(-EMF_40, steered(209, right=False, transition=True))
    assert found.current == pytest.approx(0.722, rel=0.01)
    assert found.voltage == pytest.approx(-91 * COUNT, rel=0.01)


def test_10_no_jump_where_transition_becomes_opposite_drive():
    def current(value: int, *, transition: bool) -> float:
        bridge = steered(300 - value if transition else -value, right=transition, transition=transition)
        return at_constant_speed(9.0, bridge).current

    currents = [current(v, transition=True) for v in range(20, 0, -1)]
    currents += [current(v, transition=False) for v in range(0, -21, -1)]
    assert -np.diff(currents) == pytest.approx(np.full(40, 38 / 300 / 12), rel=0.15)
    assert current(0, transition=True) == pytest.approx(current(0, transition=False), abs=1e-9)


# ------------------------------------------------------------------------------------------------------- protocol


def test_11_a_run_is_answered_byte_by_byte_and_once_at_the_end():
    rig = Rig().pretend_identified()
    for byte in (0x92, 0x04):
        rig.put_byte(byte)
        assert rig.next_status(0.01) == 0xFF
    assert rig.head.moves == 0
    rig.put_byte(0xB0)  # to 1200
    assert rig.next_status() == 0x00
    assert rig.at_rest
    assert abs(rig.head.emitter - 1200) <= 6
    assert rig.next_status(0.5) is None
    assert rig.responses == [0xFF, 0xFF, 0x00]


@pytest.mark.parametrize("length", range(8))
def test_12_execution_starts_after_exactly_the_announced_byte(length):
    numbers = random.Random(length)
    rig = Rig().pretend_identified()
    sent = [0x80 | length if length else 0x07, *(numbers.randrange(256) for _ in range(length))]  # unused opcodes
    for k, byte in enumerate(sent):
        assert rig.responses == [0xFF] * k
        rig.put_byte(byte)
        last = k == length
        assert rig.head.receiver.left == length - k
        assert rig.next_status(0.01) == (0x01 if last else 0xFF)
    assert list(rig.head.receiver.buffer)[: length + 1] == sent
    assert rig.head.receiver.left == 0
    assert rig.next_status(0.1) is None


@pytest.mark.parametrize(
    "command",
    [(0x92, 0x07, 0xD0), (0xA2, 0x07, 0xD0), (0x8D, 0x07, 0xD0, 0x00, 0x09, 0xC4)],
    ids=["run", "controlled run", "print"],
)
def test_12_motion_starts_after_exactly_the_announced_byte(command):
    rig = Rig().pretend_identified()
    for byte in command[:-1]:
        rig.put_byte(byte)
        rig.next_status(0.01)
        assert rig.next_status(0.02) is None
        assert (rig.head.moves, rig.head.state, rig.r.plant.train.velocity) == (0, IDLE, 0.0)
    rig.put_byte(command[-1])
    assert rig.head.moves == 1


def test_13_position_is_read_in_two_halves():
    rig = Rig().pretend_identified(emitter=0x0FA5)
    assert rig.send(0x40) == []
    assert rig.next_status(0.01) == 0x0F
    rig.send(0x41)
    assert rig.next_status(0.01) == 0xA5
    assert rig.next_status(0.5) is None
    assert rig.responses == [0x0F, 0xA5]  # data, no SB1


def test_13_both_halves_are_of_one_moment():
    rig = Rig().pretend_identified(emitter=0x0FFE)
    rig.send(0x40)
    high = rig.next_status(0.01)
    rig.head.emitter = 0x1002
    rig.send(0x41)
    assert (high, rig.next_status(0.01)) == (0x0F, 0xFE)


def test_14_a_second_motion_command_waits_and_is_answered_second():
    rig = Rig().pretend_identified()
    rig.send(0x92, 0x07, 0xD0)  # to 2000
    rig.run(2000)
    assert rig.head.state in (HIGH_ACCEL, HIGH_STEADY)
    assert rig.send(0x92, 0x0C, 0x80) == [0xFF, 0xFF]  # to 3200
    assert rig.r.plant.train.velocity > 0.5
    assert rig.responses == [0xFF] * 4
    assert rig.next_status() == 0x00
    assert abs(rig.head.emitter - 2000) <= 6
    assert rig.next_status() == 0x00
    assert abs(rig.head.emitter - 3200) <= 6
    assert rig.responses == [0xFF] * 4 + [0x00] * 2


@pytest.mark.parametrize(
    ("command", "bit"),
    [
        ((0x3F,), 0x01),
        ((0xC0,), 0x01),
        ((0xB9, 0x10), 0x01),
        ((0x80,), 0x01),
        ((0x90,), 0x01),
        ((0x92, 0x10, 0xFF), 0x02),  # 4351, beyond the right frame at 4350
        ((0xA2, 0xFF, 0xFF), 0x02),
        ((0x8D, 0x03, 0xE8, 0x00, 0x10, 0xFF), 0x02),
    ],
)
def test_15_what_cannot_be_done_is_answered_and_moves_nothing(command, bit):
    rig = Rig().pretend_identified()
    rig.send(*command)
    assert rig.next_status(0.01) == bit
    moved = rig.record(0.1, ["plant.train.velocity", "controller.head.drive_cmd"])
    assert not moved["plant.train.velocity"].any()
    assert not moved["controller.head.drive_cmd"].any()
    assert rig.head.moves == 0


def test_16_latches_interrupt_on_write_and_clear_on_read():
    latch = Latch()
    write_latch(latch, 0xA5)
    assert latch.flag == 1
    assert read_latch(latch) == 0xA5
    assert latch.flag == 0


def test_16_the_computer_clears_the_command_interrupt_and_raises_the_status_interrupt():
    rig = Rig().pretend_identified()
    rig.head.command_latch.byte, rig.head.command_latch.flag = 0x92, 1
    rig.run(1)
    assert rig.head.command_latch.flag == 0
    assert (rig.head.status.latch.flag, rig.head.status.latch.byte) == (1, 0xFF)


def test_16_an_unread_status_is_never_overwritten():
    rig = Rig().pretend_identified(emitter=0x0FA5)
    head = rig.head
    write_latch(head.status.latch, 0x55)
    for byte in (0x40, 0x41):
        write_latch(head.command_latch, byte)
        decide(rig.p.controller, head)
        assert (head.status.latch.byte, head.status.latch.flag) == (0x55, 1)
    assert [rig.read_status() for _ in range(1)] == [0x55]
    assert [rig.next_status(0.01), rig.next_status(0.01)] == [0x0F, 0xA5]


def test_16_status_bytes_come_in_order_and_a_full_queue_is_counted():
    port = StatusPort()
    for byte in range(QUEUE_LENGTH + 3):
        send(port, byte)
    read = []
    while port.latch.flag:
        read.append(read_latch(port.latch))
        pass_on(port)
    assert read == list(range(QUEUE_LENGTH + 1))  # the latch and its queue
    assert port.lost == 2


# --------------------------------------------------------------------------------------- homing and identification


@pytest.mark.parametrize("start", [0.0, 0.001, 0.0889, 0.2, 0.3, 14.5 * INCH])
def test_17_homing_goes_left_then_measures_the_width_slowly(start):
    rig = Rig(start=start)
    rig.send(0x01)
    names = [
        "controller.head.state",
        "plant.train.velocity",
        "plant.train.position",
        "controller.head.emitter",
        "controller.head.drive_cmd",
        "controller.head.calibration_pass",
    ]
    log = rig.record(12.0, names)
    homing_left = log["controller.head.state"] == HOME_LEFT
    homing_right = log["controller.head.state"] == HOME_RIGHT
    first_right = int(np.argmax(homing_right))
    assert homing_left[0]
    assert homing_left[:first_right].all()
    assert (log["plant.train.velocity"][homing_left] <= 0).all()
    assert log["plant.train.position"][first_right - 1] == 0.0  # contact with the left frame
    assert log["controller.head.emitter"][first_right] == 0
    begin = int(np.argmax(log["controller.head.calibration_pass"] > 0))
    assert homing_right[first_right:begin].all()
    assert log["plant.train.position"][begin - 1] == pytest.approx(rig.p.plant.train.right_end)
    assert abs(rig.head.width - 4350) <= 1
    homing = homing_left | homing_right
    # 5 in/s without a trim: the defaults give 49 counts, which is 3.3 in/s right and 5.3 in/s left on this machine.
    assert 3.3 < np.max(np.abs(log["plant.train.velocity"][homing])) / INCH < 7.5
    assert np.max(np.abs(log["controller.head.drive_cmd"][homing])) <= 110
    assert rig.responses == []
    assert rig.read_status() == 0x00


@pytest.mark.parametrize("start_in", [3.5, 11.0])
def test_17_an_obstacle_is_reported_and_nothing_is_calibrated(start_in):
    rig = Rig(
        overrides=["disturbance.obstacle.position=7.25 in", f"mechanics.start_position={start_in} in"],
        start=start_in * INCH,
    )
    assert rig.calculate() == 0x08
    assert rig.head.state == FAULT
    assert (rig.head.moves, rig.head.calibration_pass, rig.head.homed) == (0, 0, 0)
    assert rig.r.plant.train.peak_current < 1.2
    after = rig.record(0.2, ["controller.head.drive_cmd", "plant.train.velocity"])
    assert not after["controller.head.drive_cmd"].any()
    assert not after["plant.train.velocity"].any()


def test_18_four_passes_in_order_each_with_a_constant_drive():
    rig = Rig()
    rig.send(0x01)
    log = rig.record(
        12.0,
        [
            "controller.head.calibration_pass",
            "controller.head.state",
            "controller.head.drive_cmd",
            "plant.train.velocity",
        ],
    )
    passes = log["controller.head.calibration_pass"]
    changes = np.flatnonzero(np.diff(passes.astype(int))) + 1
    assert [int(passes[k]) for k in changes] == [1, 2, 3, 4, 0]
    expected = {1: -174, 2: 174, 3: -67, 4: 67}
    for number, drive in expected.items():
        steady = (passes == number) & (log["controller.head.state"] == HIGH_STEADY)
        assert np.count_nonzero(np.diff(steady.astype(int)) == 1) == 1  # one steady phase
        assert np.unique(log["controller.head.drive_cmd"][steady]).tolist() == [drive]
        speed = abs(log["plant.train.velocity"][steady][-1]) / INCH
        wanted = 40 if abs(drive) == 174 else 10
        assert abs(speed / wanted - 1) > 0.015  # the speed is off, and stays off


def test_19_drive_values_of_the_power_on_defaults():
    assert [(152 * s) >> 8 for s in (240, 60)] == [142, 35]
    assert [steady_drive(152, 32, s) for s in (240, 60)] == [174, 67]
    rig = Rig()
    assert (rig.head.right.slope, rig.head.right.friction, rig.head.left.slope, rig.head.left.friction) == (
        152,
        32,
        152,
        32,
    )


LIMITS = {"slope_min": 100, "slope_max": 255, "friction_max": 80, "rise_min": 60}


@pytest.mark.parametrize(("fast", "slow", "slope", "friction"), [(208, 47, 170, 36), (220, 59, 170, 28)])
def test_20_identification_of_synthetic_data(fast, slow, slope, friction):
    line = IdentifiedLine(speed_fast=fast, speed_slow=slow)
    assert identify(line, PlausibleLimits(**LIMITS), 174, 67)
    assert (line.slope, line.friction, line.valid) == (slope, friction, 1)


@given(fast=st.integers(120, 300), slow=st.integers(20, 65))
def test_20_identification_rounds_to_the_nearest_integer(fast, slow):
    line = IdentifiedLine(speed_fast=fast, speed_slow=slow)
    if not identify(line, PlausibleLimits(**LIMITS), 174, 67):
        assert not 100 <= 256 * 107 / (fast - slow) <= 255 or fast - slow <= 60
        return
    assert line.slope == math.floor(256 * 107 / (fast - slow) + 0.5)
    assert line.friction == 67 - math.floor(line.slope * slow / 256 + 0.5)


@pytest.mark.parametrize("fidelity", ["averaged", "switch-level"])
def test_21_identification_of_the_default_plant(fidelity):
    rig = Rig(overrides=[f"axis.fidelity={fidelity}"])
    assert rig.calculate() == 0x00
    for line, fast, slow, friction in ((rig.head.right, 208, 47, 36), (rig.head.left, 220, 59, 28)):
        assert abs(line.speed_fast - fast) <= 1
        assert abs(line.speed_slow - slow) <= 1
        assert abs(line.slope - 170) <= 2
        assert abs(line.friction - friction) <= 1.5
        assert line.valid == 1


@pytest.mark.parametrize("seed", range(30))
def test_22_thirty_random_plants(seed):
    numbers = random.Random(seed)
    slope, right, left = numbers.uniform(140, 200), numbers.uniform(18, 50), numbers.uniform(18, 50)
    rig = Rig(slope, right, left)
    assert rig.calculate() == 0x00
    for line, friction in ((rig.head.right, right), (rig.head.left, left)):
        assert abs(line.slope - slope) <= 2.5
        assert abs(line.friction - friction) <= 1.5
    bench = MeasuringBench(rig.spec)
    found = constants_of(rig)
    for speed, bar in ((40, 0.015), (20, 0.03), (10, 0.05)):
        for direction in (RIGHT, LEFT):
            assert abs(bench.open_loop_error(found, speed * INCH, direction)) <= bar


def constants_of(rig: Rig) -> DriveConstants:
    """What the axis computer works with now."""
    right, left = rig.head.right, rig.head.left
    return DriveConstants(
        slope_right=right.slope, slope_left=left.slope, friction_right=right.friction, friction_left=left.friction
    )


def test_23_the_directions_are_independent():
    before, after = Rig(170, 36, 28), Rig(170, 36, 44)
    for rig in (before, after):
        assert rig.calculate() == 0x00
    assert abs(after.head.right.slope - before.head.right.slope) <= 1
    assert abs(after.head.right.friction - before.head.right.friction) <= 1
    assert after.head.left.friction - before.head.left.friction == pytest.approx(16, abs=2)


@cache
def compared(drift: int) -> DriveComparison:
    """The three methods on the default plant with K drifted by half of `drift`, friction by `drift` percent."""
    overrides = [f"disturbance.motor_constant={drift // 2} %"]
    overrides += [f"disturbance.friction_{side}={drift} %" for side in ("right", "left")]
    return compare_drives(make_spec(overrides=overrides))


def test_24_speed_error_of_the_methods_on_a_drifted_machine():
    percent = 100 * compared(20).errors
    assert compared(20).methods == ("power-on default", "nominal table", "identified")
    assert [v / INCH for v in compared(20).speeds] == pytest.approx([40, 20, 10])
    default = [[-25.4, -19.9], [-31.8, -20.8], [-45.7, -23.8]]
    table = [[-13.4, -12.5], [-18.1, -16.3], [-27.4, -23.8]]
    assert percent[0] == pytest.approx(np.array(default), abs=0.7)
    assert percent[1] == pytest.approx(np.array(table), abs=0.7)
    assert (np.abs(percent[2]) <= np.array([[1.5], [3.0], [5.0]])).all()


def test_24_speed_error_on_a_machine_drifted_the_other_way():
    percent = 100 * compared(-20).errors
    assert percent[1, 0] == pytest.approx([15.9, 14.8], abs=0.7)
    assert (np.abs(percent[2, 0]) <= 1.5).all()


def test_25_with_trim_only_the_identified_drive_is_on_speed_within_the_first_line():
    default, table, identified = compared(20).starts
    assert compared(20).target == pytest.approx(40 * INCH)
    assert default.mean_error == pytest.approx(-0.208, rel=0.20)
    assert table.mean_error == pytest.approx(-0.094, rel=0.20)
    assert abs(identified.mean_error) < 0.01
    assert default.time_to_band == pytest.approx(0.74, rel=0.20)
    assert table.time_to_band == pytest.approx(0.40, rel=0.20)
    assert identified.time_to_band < 0.08


def test_26_literal_intercept_gains_nothing_at_low_speed():
    literal, measured = Rig(overrides=["method.intercept=literal"]), Rig()
    for rig in (literal, measured):
        assert rig.calculate() == 0x00
    assert (literal.head.right.slope, literal.head.right.friction) == (170, 28)
    assert (measured.head.right.slope, measured.head.right.friction) == (170, 36)
    bench = MeasuringBench(measured.spec)
    default = DriveConstants(slope_right=152, slope_left=152, friction_right=32, friction_left=32)
    # The specification gives these to 0.1 %; it names no other tolerance.
    for constants, speed, percent in (
        (constants_of(literal), 10, -22.2),
        (default, 10, -22.2),
        (constants_of(literal), 40, -5.3),
        (constants_of(measured), 10, -2.1),
        (constants_of(measured), 40, -0.2),
    ):
        assert 100 * bench.open_loop_error(constants, speed * INCH, RIGHT) == pytest.approx(percent, abs=0.05)


@given(fast=st.integers(0, 400), slow=st.integers(0, 400))
def test_27_implausible_speeds_leave_the_defaults(fast, slow):
    line = IdentifiedLine(slope=152, friction=32, speed_fast=fast, speed_slow=slow)
    plausible = identify(line, PlausibleLimits(**LIMITS), 174, 67)
    assert line.valid == plausible
    if fast <= slow + 60:
        assert not plausible
    if plausible:
        assert 100 <= line.slope <= 255
        assert 0 <= line.friction <= 80
    else:
        assert (line.slope, line.friction) == (152, 32)


def test_27_implausible_data_set_the_status_bit():
    rig = Rig()
    rig.send(0x01)
    while rig.head.calibration_pass != 4:
        rig.run(100)
    rig.head.left.speed_fast = rig.head.left.speed_slow  # as if the left fast pass had been no faster
    assert rig.next_status() == 0x10
    assert (rig.head.left.slope, rig.head.left.friction, rig.head.left.valid) == (152, 32, 0)
    assert (rig.head.right.slope, rig.head.right.friction, rig.head.right.valid) == (170, 36, 1)


# ----------------------------------------------------------------------- speed selection, low speed, high speed

DIRECTIONS = (1, -1)
SIGNALS = (
    "plant.train.velocity", "plant.train.position", "plant.train.mean_current", "controller.head.state",
    "controller.head.emitter", "controller.head.interval_us", "controller.head.drive", "controller.head.drive_cmd",
    "lines.count", "lines.right_left", "lines.transition",
)  # fmt: skip
FRICTION = {1: 36, -1: 28}
"""Counts, default plant."""

OPEN_LOOP = "method.trim=false"
"""Where a figure of the specification starts from an untrimmed steady drive."""


class Move:
    """One move from rest with identified constants, recorded at every tick until its status byte."""

    def __init__(
        self, s: int, direction: int, distance: int, *overrides: str, start: int | None = None, fraction: float = 0.5
    ) -> None:
        if start is None:
            start = 2175 - direction * distance // 2
        self.rig = Rig(overrides=overrides).pretend_identified(emitter=start, fraction=fraction)
        if s != 240:
            assert self.rig.set_speed(s) == OK
        self.direction, self.origin = direction, start
        self.rig.controlled_run_to(start + direction * distance, wait=False)
        self.begin = self.rig.r.tick
        self.rows = self.rig.record(10, SIGNALS)
        assert self.rig.read_status() == OK
        assert self.rig.head.speed == s, "the distance is too short for the speed"

    def __getitem__(self, name: str) -> np.ndarray:
        return self.rows[name]

    @property
    def speed(self) -> np.ndarray:
        """Speed along the direction of the move [in/s]."""
        return self.rows["plant.train.velocity"] * self.direction / INCH

    @property
    def way(self) -> np.ndarray:
        """Way along the direction of the move [emitters]."""
        return self.rows["plant.train.position"] * self.direction / EMITTER

    def first(self, *states: int, after: int = 0) -> int:
        """First row in one of `states`."""
        return after + int(np.flatnonzero(np.isin(self.rows["controller.head.state"][after:], states))[0])

    def stop(self) -> int:
        """First row of the stop."""
        return self.first(LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE)

    def standstill(self) -> int:
        """First row at or past zero speed after the stop began."""
        begin = self.stop()
        return begin + int(np.flatnonzero(self.speed[begin:] <= 0)[0])

    def stop_distance(self) -> float:
        """Way from the beginning of the stop to zero speed [emitters]."""
        return float(self.way[self.standstill()] - self.way[self.stop() - 1])


class TurnAround:
    """Two opposite moves at one speed, the second queued while the first runs; times from the beginning of the stop."""

    def __init__(self, direction: int, s: int, *overrides: str) -> None:
        self.rig = rig = Rig(overrides=overrides).pretend_identified(emitter=400 if direction > 0 else 3950)
        if s != 240:
            rig.set_speed(s)
        for target in (3400, 800) if direction > 0 else (950, 3550):
            rig.controlled_run_to(target, wait=False)
        rows = self.rows = rig.record(3, SIGNALS, stop_at_status=False)
        state, speed = rows["controller.head.state"], rows["plant.train.velocity"] * direction / INCH
        self.begin = int(np.flatnonzero(np.isin(state, (HIGH_TRANSITION, HIGH_REVERSE)))[0])
        self.zero = self.begin + int(np.flatnonzero(speed[self.begin :] <= 0)[0])
        self.turn = self.begin + int(np.flatnonzero(~np.isin(state[self.begin :], (HIGH_TRANSITION, HIGH_REVERSE)))[0])
        self.end = self.turn + int(np.flatnonzero(state[self.turn :] != HIGH_ACCEL)[0])
        reached = speed[self.begin :] <= -39 / 40 * s / 6
        self.reached = self.begin + int(np.flatnonzero(reached)[0])
        self.speed = -speed

    def ms(self, row: int) -> float:
        """Time of a row [ms]."""
        return (row - self.begin + 1) * TICK * 1e3


def smallest_distance_for(s: int) -> int:
    """Smallest distance into which 2.5 stop distances of s fit [emitters]."""
    return next(d for d in range(1, 4000) if fits(d, s))


# ---------------------------------------------------------------------------------------------------- speed selection


def test_28_run_distance_selects_the_speed():
    table = {1001: 240, 1000: 120, 251: 120, 250: 60, 63: 60, 62: 30, 10: 30, 1: 30}
    assert {d: select_speed(d, 240) for d in table} == table
    for d, s in table.items():
        rig = Rig().pretend_identified(emitter=2000)
        assert rig.run_to(2000 + d) == OK
        assert (rig.head.speed, rig.head.moves) == (s, 1)


def test_29_stop_distance_is_s_squared_over_144():
    table = {18: 2.25, 30: 6.25, 60: 25, 120: 100, 180: 225, 240: 400}
    for s, distance in table.items():
        assert stop_distance_up(s) == math.ceil(distance)
        # The selection uses the exact value, not the rounded one: 2.5 times it must be below the distance.
        assert smallest_distance_for(s) == math.floor(2.5 * distance) + 1


def test_30_print_selects_from_the_commanded_maximum():
    assert [select_speed(d, 180) for d in (600, 500, 140)] == [180, 90, 45]
    distances = [*range(1, 200), *range(200, 4400, 37)]
    for maximum in range(18, 241):
        for d in distances:
            s = select_speed(d, maximum)
            assert s <= maximum
            assert 2.5 * s * s / 144 < d or s <= 30
    rig = Rig().pretend_identified(emitter=400)
    rig.set_speed(180)
    # At 180 the stop lies 225 emitters beyond the end. First 825 from the head: fits. Then a run back of 174 would be
    # needed for the run-up, 554 in all: does not; at 90 the head has its run-up, and 212 fit.
    for start, end, expected in ((650.0, 1000, 180), (1300.0, 1380, 90)):
        rig.send_print(start, end)
        assert rig.next_status() == OK
        assert rig.head.speed == expected


def test_31_ten_inches_per_second_is_the_high_speed_class():
    for s, state in ((60, HIGH_ACCEL), (59, LOW_START)):
        rig = Rig().pretend_identified()
        rig.set_speed(s)
        rig.controlled_run_to(3000, wait=False)
        assert (rig.head.speed, rig.head.state) == (s, state)


def test_32_queued_command_plans_from_the_expected_stop():
    rig = Rig().pretend_identified(emitter=1000)
    rig.run_to(2200, wait=False)
    assert rig.in_state(HIGH_STEADY)
    assert 1300 < rig.head.emitter < 1700
    rig.run_to(1500, wait=False)
    assert rig.head.plan.distance == 2200 - 1500
    assert (rig.head.plan.speed, rig.head.plan.direction) == (120, -1)
    assert rig.next_status() == OK
    # At zero speed the actual position replaces the expected one.
    assert rig.head.plan.distance == abs(rig.head.emitter - 1500) == pytest.approx(700, abs=6)


# ---------------------------------------------------------------------------------------------------------- low speed


def test_33_low_speed_start_is_five_emitters_of_friction_and_ir():
    move = Move(30, 1, 1500)
    change = move.first(LOW_STEADY)
    passed = move["controller.head.emitter"] - move.origin
    assert set(move["controller.head.drive_cmd"][:change]) == {132}
    assert (passed[change - 1], passed[change]) == (4, 5)
    assert move["controller.head.drive_cmd"][change] == 55
    assert move.speed[change] == pytest.approx(4.2, abs=0.3)
    assert [low_speed_start_emitters(s) for s in (18, 24, 30, 42, 54, 59)] == [2, 3, 5, 10, 16, 19]


def test_34_reference_interval_and_overspeed_threshold():
    p = HeadParams(drive_limit=300, overspeed_test=1)
    for s, reference, threshold in ((30, 666.7, 627.5), (59, 339.0, 319.0)):
        c = HeadComputer(speed=s, direction=1, state=LOW_STEADY)
        changes, outputs = [], []
        for interval in (math.floor(reference - 0.1), math.floor(reference - 0.1) + 1):
            c.interval_us, c.drive = interval, 50
            trim_low(c)
            changes.append(c.drive - 50)
        # One microsecond apart, on both sides of 20000/s.
        assert changes == [-1, 1]
        for interval in (math.floor(threshold), math.floor(threshold) + 1):
            c.interval_us, c.drive = interval, 50
            put_low(p, c)
            outputs.append(c.out.count)
        assert outputs == [25, 50]
        assert reference == pytest.approx(20000 / s, abs=0.05)
        assert threshold == pytest.approx(20000 / s * 16 / 17, abs=0.05)


def test_35_trim_is_one_count_per_16_ms_by_the_interval():
    c = HeadComputer(speed=40, direction=1, state=LOW_STEADY)
    for interval, expected in ((501, 61), (499, 59), (500, 60)):
        c.interval_us, c.drive = interval, 60
        trim_low(c)
        assert c.drive == expected
    move = Move(40, 1, 2000)
    begin, end = move.first(LOW_STEADY), move.stop()
    drive, interval = (
        move["controller.head.drive"][begin:end].astype(int),
        move["controller.head.interval_us"][begin:end],
    )
    changes = np.diff(drive)
    # Every 16 ms; the first trim comes half a period after the steady phase begins.
    boundaries = np.arange(200, end - begin, 400)
    assert len(boundaries) > 40
    assert set(np.flatnonzero(changes) + 1) <= set(boundaries)
    # Interval and drive of the same tick: the computer trims with the interval of the latest emitter.
    np.testing.assert_array_equal(changes[boundaries - 1], np.sign(interval[boundaries] * 40 - 20000))
    # The memory location is the drive that goes out, unless the overspeed test halves it.
    out = move["lines.count"][begin:end]
    assert np.all((out == drive) | (out == drive >> 1))
    assert np.mean(out == drive) > 0.9


FIRST_SWING, TRIM_CYCLE = (0, 1, 2, 1, 0, -1, -2, -1), (0, 1, 0, -1)
"""Drive per 16 ms, around the count that holds the speed best: a cycle as wide as the specification allows, 4 counts,
and the narrowest one by one count each 16 ms that comes back to where it began."""


@cache
def cycle_swing(s: int, cycle: tuple[int, ...]) -> float:
    """Largest relative speed deviation of a drive cycle at speed value s.

    The speed follows one count by 256/170 speed values, with time constants of 1 ms (electrical) and 40.16 ms
    (mechanical), in steps of 0.1 ms.
    """
    exact = 170 * s / 256
    offset = round(exact) - exact
    current = speed = peak = 0.0
    for n in range(160 * len(cycle) * 10):
        drive = cycle[n // 160 % len(cycle)] + offset
        current += (drive - speed - current) * 0.1 / 1.0
        speed += current * 0.1 / 40.16
        peak = max(peak, abs(speed)) if n >= 160 * len(cycle) * 9 else 0.0
    return peak * 256 / 170 / s


@dataclass(frozen=True)
class HeldSpeed:
    """What a low-speed move did from 0.15 s of its steady phase on, and from 0.55 s on, with the first swing over."""

    error: float  # largest, of the speed
    width: int  # of the drive [count]
    late_error: float
    late_width: int


def held_speed(s: int, direction: int, fraction: float) -> HeldSpeed:
    """Move at a low speed from a fraction of the way between two emitters."""
    move = Move(s, direction, min(3900, 75 * s), fraction=fraction)
    begin, end = move.first(LOW_STEADY), move.stop()
    t = np.arange(end - begin) * TICK
    assert t[-1] > 0.9
    error, drive = np.abs(move.speed[begin:end] / (s / 6) - 1), move["controller.head.drive"][begin:end]
    soon, late = t > 0.15, t > 0.55
    return HeldSpeed(error[soon].max(), int(np.ptp(drive[soon])), error[late].max(), int(np.ptp(drive[late])))


def check_held(s: int, direction: int, fraction: float) -> HeldSpeed:
    """Hold one start up to what is calculated for every start."""
    held = held_speed(s, direction, fraction)
    assert held.width <= 4
    assert held.error <= max(0.03, cycle_swing(s, FIRST_SWING)) + 0.0005
    # Once the first swing is over the specification's 3 % hold at every speed from every start: only the trim's own
    # cycle is left, calculated 2.3 % at 3 in/s and less above it.
    assert held.late_width == 2
    assert held.late_error == pytest.approx(cycle_swing(s, TRIM_CYCLE), abs=0.0005)
    assert held.late_error <= 0.03
    return held


LOW_SPEEDS = pytest.mark.parametrize("s", [18, 24, 30, 42, 54])
BOTH_DIRECTIONS = pytest.mark.parametrize("direction", DIRECTIONS, ids=("right", "left"))


@BOTH_DIRECTIONS
@LOW_SPEEDS
def test_36_low_speed_is_held(s, direction):
    """Steady speed within 3 %, trim cycle at most 4 counts wide: from a start on an emitter, as in the reference.

    The head stands just past an emitter in its direction, so that the N emitters of the open-loop start are whole ones.
    """
    held = check_held(s, direction, 0.02 if direction > 0 else 0.98)
    assert held.error <= 0.03


@BOTH_DIRECTIONS
@LOW_SPEEDS
def test_36_from_between_two_emitters_the_first_swing_is_wider(s, direction):
    """A head that rests between two emitters has an open-loop start up to an emitter shorter, and begins slower.

    The specification's 3 % after 0.15 s do NOT hold for every such start: rule 3.7 winds the drive up meanwhile, and
    the first swing back is as wide as a cycle of 4 counts makes it, 6.9 % at 3 in/s, 5.2 % at 4 and 4.3 % at 5 in/s. It
    is over after 0.55 s.
    """
    for fraction in (0.1, 0.22, 0.36, 0.5, 0.64, 0.78, 0.9):
        check_held(s, direction, fraction)


@pytest.mark.wide
@BOTH_DIRECTIONS
@LOW_SPEEDS
def test_36_no_start_within_an_emitter_swings_wider_than_is_calculated(s, direction):
    held = [check_held(s, direction, fraction) for fraction in np.arange(0.005, 1.0, 0.01)]
    worst = max(one.error for one in held)
    # What is calculated does happen where the first swing has its 4 counts; elsewhere it is narrower.
    wide = max(one.width for one in held) == 4
    assert not wide or worst >= 0.95 * cycle_swing(s, FIRST_SWING)
    assert wide == (s in (24, 30))
    assert (worst > 0.03) == (s <= 30)
    assert min(one.error for one in held) <= 0.03


def test_37_overspeed_test_limits_a_push():
    peaks = {}
    for test in ("true", "false"):
        rig = Rig(overrides=[f"method.overspeed_test={test}"]).pretend_identified(emitter=200)
        rig.set_speed(30)
        rig.controlled_run_to(3000, wait=False)
        rig.record(0.6, SIGNALS)
        rig.p.plant.push.force, rig.p.plant.push.begin, rig.p.plant.push.end = 3.0, rig.r.tick, rig.r.tick + 1500
        rows = rig.record(0.12, SIGNALS)
        peaks[test] = rows["plant.train.velocity"].max() / INCH
        drive, out = rows["controller.head.drive"].astype(int), rows["lines.count"]
        changed = np.flatnonzero(np.diff(drive))
        assert np.abs(np.diff(drive)).max() == 1
        assert np.diff(changed).min() >= 400
        halved = out == drive >> 1
        assert np.all(halved | (out == drive))
        assert np.any(halved) == (test == "true")
        if test == "true":
            fast = (rows["controller.head.interval_us"] * 30 * 17 < 320_000) & (rows["controller.head.interval_us"] > 0)
            np.testing.assert_array_equal(halved, fast)
    assert 5.0 < peaks["true"] <= 5.6
    assert 6.8 <= peaks["false"] < 8.0


def reversed_stop(direction: int, speed: float, drive: int) -> float:
    """Way of a stop by reversal [emitters], from a speed [in/s] and the drive that ran, from the rules alone.

    Drive and speed in counts of back-EMF; electrical lag 1 ms, mechanical time constant 40.16 ms, steps of 10 us. What
    current there is flows back into the supply first, against all 300 counts.
    """
    v = speed * 6 * 170 / 256
    current, way = drive - v, 0.0
    while v > 0:
        current += ((-300 if current > 0 else -drive) - v - current) * 0.01 / 1.0
        v += (current - FRICTION[direction]) * 0.01 / 40.16
        way += v * 256 / 170 * 50 * 1e-5
    return way


def low_speed_stop(s: int, direction: int, length: int, fraction: float = 0.5) -> float:
    """Hold a stop up to the rules; its way [emitters]."""
    move = Move(s, direction, length, fraction=fraction)
    begin = move.stop()
    command, drive = move["controller.head.drive_cmd"], int(move["controller.head.drive"][begin - 1])
    assert set(command[begin:-1]) == {-direction * drive}
    assert command[begin - 1] in (-command[begin], -command[begin] // 2)
    assert not np.any(move["lines.transition"])
    distance = move.stop_distance()
    assert distance == pytest.approx(reversed_stop(direction, float(move.speed[begin - 1]), drive), abs=0.2)
    # Drive off with the detection of zero speed, at the reversal or within the 5 ms without an emitter.
    assert command[-1] == 0
    assert (len(command) - move.standstill()) * TICK < 5e-3
    peak = move.way[move.standstill()]
    move.rig.run(2500)
    assert move.rig.r.plant.train.velocity == 0
    back = peak - move.rig.r.plant.train.position * direction / EMITTER
    assert 0 <= back <= 1.0
    return distance


def test_38_low_speed_stop_reverses_the_running_drive():
    for s in range(18, 60):
        for direction in DIRECTIONS:
            assert abs(low_speed_stop(s, direction, 400 + 10 * s) - s * s / 144) <= 5.5


@pytest.mark.wide
def test_38_low_speed_stops_of_moves_of_several_lengths():
    """The 5.5 emitters hold to 0.03: a move right of 550 at s = 59 ends in the first swing, and stops 5.53 short."""
    misses = [
        abs(low_speed_stop(s, direction, length) - s * s / 144)
        for s in range(18, 60)
        for direction in DIRECTIONS
        for length in (300, 420, 550, 900, 1500)
    ]
    assert sum(miss > 5.5 for miss in misses) == 1
    assert max(misses) <= 5.55


def test_38_stop_from_nine_inches_per_second():
    """17 right and 19 left, says the specification in whole emitters: so it is on average, and each stop within 0.8.

    The drive is a count or so off when the stop begins, and in a short move the first swing of the trim is not over
    (test 36): 3.5 % of speed. The way therefore depends on the length of the move, and on the place within an emitter
    from which it began: 16.2 to 17.6 emitters right, 18.3 to 19.7 left.
    """
    for direction, nominal in ((1, 17), (-1, 19)):
        ways = [
            low_speed_stop(54, direction, length, fraction)
            for length in (300, 323, 484, 560, 700, 800, 1100, 1400)
            for fraction in (0.02, 0.5, 0.98)
        ]
        drive = round(170 * 54 / 256) + FRICTION[direction]
        shortest, longest = (reversed_stop(direction, 9 * (1 + k * 0.035), drive - k) for k in (-1, 1))
        assert shortest <= min(ways) < max(ways) <= longest + 0.2
        assert np.mean(ways) == pytest.approx(nominal, abs=0.3)
        assert 1.0 < max(ways) - min(ways) < 1.6
        assert nominal - 0.8 <= min(ways) < max(ways) <= nominal + 0.8


def test_39_low_speed_forgets_the_trimmed_drive():
    move = Move(30, 1, 1500, start=500)
    assert move["controller.head.drive"][move.stop() - 1] != 55
    rig = move.rig
    rig.controlled_run_to(3500, wait=False)
    rows = rig.record(3, SIGNALS)
    change = int(np.flatnonzero(rows["controller.head.state"] == LOW_STEADY)[0])
    assert rows["controller.head.drive"][change] == 55


# --------------------------------------------------------------------------------------------------------- high speed


@step
def extreme_intervals(slow_slope: int, steep_slope: int) -> tuple[int, int]:
    """Shortest and longest ramp interval over all speeds and pairs of slopes."""
    shortest, longest = 1 << 30, 0
    for right in range(slow_slope, steep_slope + 1):
        for left in range(slow_slope, steep_slope + 1):
            for s in range(60, 241):
                t = ramp_interval_us((right * s) >> 8, (left * s) >> 8, s)
                shortest, longest = min(shortest, t), max(longest, t)
    return shortest, longest


def test_40_ramp_interval():
    def steady(slope, right, left, s):
        return ramp_interval_us((slope * s >> 8) + right, (slope * s >> 8) + left, s)

    assert steady(152, 32, 32, 240) == 382
    assert steady(152, 0, 0, 240) in (467, 468, 469)
    assert steady(170, 36, 28, 240) == 348
    assert steady(170, 0, 0, 240) == 418
    assert steady(170, 36, 28, 60) == 234
    assert steady(170, 0, 0, 60) == 426
    # The computer itself, through a move, with both readings of equation (10).
    for s, reading, expected in ((240, "emf", 418), (240, "steady", 348), (60, "emf", 426), (60, "steady", 234)):
        rig = Rig(overrides=[f"method.span={reading}"]).pretend_identified()
        rig.set_speed(s)
        rig.controlled_run_to(4000, wait=False)
        assert rig.head.ramp_us == expected
    shortest, longest = extreme_intervals(158, 203)
    assert shortest >= 345
    assert longest <= 465
    # Without the truncation of K s/256 the interval is 0.133 s x 256/(480 K) at every speed. 350..450 us are
    # K 157.6..202.7, so the specification's 203 is that bound rounded, and lies 0.6 us outside.
    exact = {slope: 133_000 * 256 / 480 / slope for slope in (158, 202, 203)}
    assert 350 <= exact[202] < exact[158] <= 450
    assert exact[203] == pytest.approx(350, abs=0.6)


def test_41_acceleration_profile():
    for s, duration, speed in ((240, 66.5, 39.65), (60, 16.6, 9.4), (120, 33.3, 19.5)):
        move = Move(s, 1, 3000)
        steady = move.first(HIGH_STEADY)
        drive = move["controller.head.drive"].astype(int)
        assert drive[0] == 132
        assert drive[steady - 1] == (170 * s >> 8) + 36 + 96
        assert drive[steady] == (170 * s >> 8) + 36
        assert set(np.diff(drive[:steady])) == {0, 1}
        # One count per T, each within a tick of its time.
        steps = np.flatnonzero(np.diff(drive[:steady])) * TICK * 1e6
        np.testing.assert_allclose(steps - steps[0], np.arange(len(steps)) * move.rig.head.ramp_us, atol=41)
        assert steady * TICK * 1e3 == pytest.approx(duration, abs=1)
        assert move.speed[steady] == pytest.approx(speed, abs=0.5)
        if s == 240:
            assert (drive[steady - 1], drive[steady]) == (291, 195)
            assert move["controller.head.emitter"][steady] - move.origin == pytest.approx(389, abs=8)
        first, last = round(0.1 * steady), round(0.9 * steady)
        acceleration = (move.speed[last] - move.speed[first]) / ((last - first) * TICK)
        assert acceleration == pytest.approx(600, rel=0.03)


def test_42_ramp_ends_early_when_the_speed_is_reached():
    rig = Rig().pretend_identified(emitter=200)
    rig.r.plant.train.velocity = 30 * INCH
    rig.run_to(3000, wait=False)
    rows = rig.record(0.2, SIGNALS)
    end = int(np.flatnonzero(rows["controller.head.state"] != HIGH_ACCEL)[0])
    assert rows["controller.head.state"][end] == HIGH_STEADY
    assert end * TICK * 1e3 == pytest.approx(54.5, abs=2)
    assert rows["controller.head.drive"][end - 1] == pytest.approx(262, abs=5)
    assert 0 < rows["controller.head.interval_us"][end] <= 20000 / 240 < rows["controller.head.interval_us"][end - 4]
    assert 28.8 <= rows["plant.train.velocity"][:end].min() / INCH < 29.9


def test_43_high_speed_trim_by_count():
    table = {60: 48, 90: 72, 120: 96, 180: 143, 240: 191}
    assert {s: window_reference(s) for s in table} == table
    c = HeadComputer(speed=240, direction=-1, state=HIGH_STEADY)
    for passed, expected in ((190, 188), (192, 186), (191, 187)):
        c.phase_start, c.emitter, c.drive = 3000, 3000 - passed, 187
        trim_high(c)
        assert (c.drive, c.phase_start) == (expected, 3000 - passed)
    # The reference 0.796 s instead of 0.8 s lets the trim settle 0.5 % low at 40 in/s; at 10 in/s 48 is exact.
    for s, low, high in ((240, -0.005 - 0.015, 0.015 - 0.005), (60, -0.02, 0.02)):
        for direction in DIRECTIONS:
            move = Move(s, direction, 3800)
            begin, end = move.first(HIGH_STEADY), move.stop()
            drive = move["controller.head.drive"][begin:end].astype(int)
            changes = np.flatnonzero(np.diff(drive)) + 1
            assert set(changes) <= set(range(400, len(drive), 400))
            assert np.abs(np.diff(drive)).max() == 1
            error = move.speed[begin:end] / (s / 6) - 1
            settled = error[round(0.1 / TICK) :]
            assert low <= settled.min()
            assert settled.max() <= high
            assert np.ptp(settled) > 0.002, "a trim of whole counts cannot hold the speed exactly"


def steady_begin(rows):
    begin = int(np.flatnonzero(rows["controller.head.state"] == HIGH_STEADY)[0])
    return int(rows["controller.head.drive"][begin - 1]), int(rows["controller.head.drive"][begin])


def test_44_trimmed_drive_is_kept_per_direction_and_speed():
    rig = Rig().pretend_identified(emitter=200)
    head = rig.head

    def controlled_run(target):
        rig.controlled_run_to(target, wait=False)
        rows = rig.record(3, SIGNALS)
        assert rig.read_status() == OK
        return steady_begin(rows)

    rig.controlled_run_to(2400, wait=False)
    assert rig.in_state(HIGH_STEADY)
    while head.target - head.emitter > 404:
        rig.run(1)
    head.drive = 194
    rig.next_status()
    assert (head.kept_speed_right, head.kept_drive_right) == (240, 194)
    left = controlled_run(300)
    assert left == (187 + 96, 187)
    assert controlled_run(2400) == (290, 194)
    rig.set_speed(120)
    controlled_run(300)
    assert controlled_run(2400) == (115 + 96, 115)
    rig.set_speed(240)
    controlled_run(300)
    assert controlled_run(2400) == (291, 195)


def test_45_deceleration_through_the_transition_mode():
    move = Move(240, 1, 3000, OPEN_LOOP)
    begin, zero = move.stop(), move.standstill()
    t = (np.arange(len(move.speed)) - begin + 1) * TICK * 1e3
    drive, count = move["controller.head.drive_cmd"], move["lines.count"]
    transition, line = move["lines.transition"], move["lines.right_left"]
    assert (drive[begin - 1], drive[begin]) == (195, 99)
    assert (count[begin], transition[begin], line[begin]) == (201, 1, 1)
    change = begin + int(np.flatnonzero(transition[begin:] == 0)[0])
    assert (drive[change], count[change], line[change]) == (0, 0, 0)
    np.testing.assert_array_equal(count[begin:change], 300 - drive[begin:change])
    np.testing.assert_array_equal(count[change:zero], -drive[change:zero])
    assert np.all(transition[begin:change] == 1)
    assert np.all(line[begin:change] == 1)
    assert not np.any(transition[change:])
    assert t[change] == pytest.approx(41.4, abs=1)
    assert t[zero] == pytest.approx(66.8, abs=1.5)
    assert drive[zero] == pytest.approx(-60, abs=4)
    assert move.stop_distance() == pytest.approx(403, abs=8)
    current = move["plant.train.mean_current"]
    braking = current[(t >= 10) & (t <= 60)]
    assert braking.mean() == pytest.approx(-0.638, rel=0.01)
    assert braking.min() >= braking.mean() * 1.08
    assert braking.max() <= braking.mean() * 0.92
    around = current[change - 25 : change + 25]
    # One drive count is 10.6 mA: there is no step at the change of the lines.
    assert np.abs(np.diff(around)).max() < 0.0106


def test_46_no_transition_below_the_ir_counts():
    move = Move(90, -1, 1500, OPEN_LOOP)
    begin = move.stop()
    assert move["controller.head.drive"][begin - 1] == 87
    # Along the motion: 87 - 96 = -9 against it, to the right.
    assert (move["controller.head.drive"][begin], move["controller.head.drive_cmd"][begin]) == (-9, 9)
    assert (move["lines.right_left"][begin - 1], move["lines.right_left"][begin]) == (0, 1)
    assert not np.any(move["lines.transition"])
    assert HIGH_TRANSITION not in move["controller.head.state"]


def test_47_without_transition_the_head_coasts():
    for s, coasting, braked in ((240, 599, 403), (180, 320, 229), (120, 126, 104)):
        free = Move(s, 1, 3000, "method.transition=false")
        assert free.stop_distance() == pytest.approx(coasting, rel=0.05)
        assert not np.any(free["lines.transition"])
        held = Move(s, 1, 3000)
        assert held.stop_distance() == pytest.approx(braked, rel=0.05)
        if s == 240:
            peak = np.abs(free["plant.train.mean_current"][free.stop() : free.standstill()]).max()
            constant = np.abs(held["plant.train.mean_current"][held.stop() : held.standstill()]).max()
            assert peak == pytest.approx(1.24, rel=0.05)
            assert 1.8 < peak / constant < 2.1
            # Nothing brakes while the drive value is still above zero.
            assert not np.any(free["plant.train.mean_current"][free.stop() + 200 : free.first(HIGH_REVERSE) - 1])


def answered(turn: TurnAround) -> tuple[int, list[int]]:
    """Turn-arounds made, and the motion commands' answers."""
    return turn.rig.head.turn_arounds, [code for code in turn.rig.responses if code != 0xFF][-2:]


@pytest.mark.parametrize("s", [240, 180, 120])
@BOTH_DIRECTIONS
def test_48_events_of_a_turn_around(direction, s):
    """Event table 4.4, which the specification gives for 40 in/s to the right, at every speed and both ways round.

    Times and ways in proportion to speed and its square, drives by friction of the two directions; the ramp takes 418.2
    us per count. Untrimmed, as the table is.
    """
    turn = TurnAround(direction, s, OPEN_LOOP)
    rows, begin, share = turn.rows, turn.begin, s / 240
    command = rows["controller.head.drive_cmd"].astype(int) * direction
    steady, friction, other = {d: (170 * s >> 8) + FRICTION[d] for d in DIRECTIONS}, FRICTION[direction], -direction
    change = begin + int(np.flatnonzero(command[begin:] == 0)[0])
    assert (command[begin - 1], command[begin]) == (steady[direction], steady[direction] - 96)
    assert turn.ms(change) == pytest.approx((steady[direction] - 96) * 0.4182, abs=1)
    # No drive, but the current of the brake: back-EMF of 96 counts less friction, seen half a lag of 1 ms late.
    assert -turn.speed[change] == pytest.approx((96 - friction) * 256 / 170 / 6 + 0.3, abs=0.3)
    assert turn.ms(turn.zero) == pytest.approx(66.8 * share, abs=1.5)
    assert command[turn.zero] == pytest.approx(friction - 96, abs=4)
    way = abs(int(rows["controller.head.emitter"][turn.zero]) - int(rows["controller.head.emitter"][begin]))
    assert way == pytest.approx(403 * share**2, abs=8)
    # The jump follows when the encoder has seen the reversal, up to 2.5 ms or six counts later.
    assert command[turn.turn - 1] - command[turn.turn] in (64, 65)
    assert turn.ms(turn.turn) - turn.ms(turn.zero) <= 2.5
    assert (command[turn.end - 1], command[turn.end]) == (-steady[other] - 96, -steady[other])
    assert turn.ms(turn.end) == pytest.approx(133.3 * share, abs=1.5)
    # The ramp ends on time, the speed lags behind it: 39.7 of 40 in the table, 19.5 of 20 in/s in test 41.
    assert turn.speed[turn.end] == pytest.approx(s / 6 - 0.4, abs=0.3)
    after = slice(change, turn.end)
    assert not np.any(rows["lines.transition"][after])
    assert np.all(rows["lines.right_left"][after] == (direction < 0))
    assert answered(turn) == (1, [OK, OK])


def test_48_turn_around_takes_133_ms_at_40_inches_per_second():
    """To 39/40 of the speed the other way, with the trim as in normal work; both ways round within 2 ms."""
    for s, time, tolerance in ((240, 133, 6), (120, 67, 6 * 67 / 133)):
        both = [TurnAround(direction, s) for direction in DIRECTIONS]
        times = [one.ms(one.reached) for one in both]
        assert times == pytest.approx([time, time], abs=tolerance)
        assert abs(times[0] - times[1]) <= 2
        assert [answered(one) for one in both] == [(1, [OK, OK])] * 2


# Preselected speed value, and the ways from the start of a first and of a queued second command [emitter].
TURNS = {
    "turns around": (120, (1000, 0)),
    "different speed": (240, (2600, 2200)),  # 400 are too short for 240
    "same direction": (120, (1000, 2000)),
    "low speed": (48, (1000, 0)),
    "nothing queued": (120, (1000,)),
}


@BOTH_DIRECTIONS
@pytest.mark.parametrize("case", TURNS)
def test_49_turn_around_needs_same_speed_opposite_direction_high_speed_and_a_queued_command(case, direction):
    """The first case has all four; each of the others lacks one, stops, and begins the next command afresh."""
    s, ways = TURNS[case]
    rig = Rig().pretend_identified(emitter=2175 - direction * 1300)
    rig.set_speed(s)
    for way in ways:
        rig.controlled_run_to(2175 - direction * (1300 - way), wait=False)
    rows = rig.record(4, SIGNALS)
    assert rig.read_status() == OK  # SB1 of the first command, at its zero speed
    last = {name: int(rows[f"controller.head.{name}"][-1]) for name in ("drive_cmd", "state")}
    second = rig.head.direction
    assert rig.head.turn_arounds == (case == "turns around")
    if case == "turns around":
        # Straight on from the braking value, by the friction of both directions.
        before = int(rows["controller.head.drive_cmd"][-2])
        assert before - last["drive_cmd"] in (direction * 64, direction * 65)
    elif case == "nothing queued":
        assert last == {"drive_cmd": 0, "state": IDLE}
        assert rig.next_status(0.2) is None
        return
    else:
        # The drive went off, and within the same tick the next command starts: friction + IR, and its own time.
        assert last["drive_cmd"] == second * (FRICTION[second] + 96)
        assert rig.head.moves == 2
        assert rig.head.next_ramp_us - rig.head.now_us == rig.head.ramp_us or case == "low speed"
    assert second == (direction if case == "same direction" else -direction)
    assert rig.next_status() == OK
    assert rig.head.state == IDLE


def test_50_turn_around_without_the_friction_jump_takes_longer():
    turn = TurnAround(1, 240, "method.friction_jump=false")
    command = turn.rows["controller.head.drive_cmd"].astype(int)
    assert abs(command[turn.turn] - command[turn.turn - 1]) <= 1
    assert turn.ms(turn.end) == pytest.approx(158, abs=4)
    assert turn.ms(turn.reached) == pytest.approx(158, abs=4)


def test_51_literal_span_ramps_too_fast():
    turn = TurnAround(1, 240, "method.span=steady", OPEN_LOOP)
    assert turn.ms(turn.end) == pytest.approx(111, rel=0.03)
    assert turn.speed[turn.end] == pytest.approx(35, rel=0.03)
    distance = (
        turn.rows["plant.train.position"][turn.zero] - turn.rows["plant.train.position"][turn.begin - 1]
    ) / EMITTER
    assert distance == pytest.approx(377, rel=0.03)


def short_low_move(direction, *, start=5, stop=13, s=30):
    """Time of a run of 20 emitters from the rules alone [ms]: 5 emitters of start, steady drive, reversed at 20 - 7.

    Drive and speed in counts of back-EMF; electrical lag 1 ms, mechanical time constant 40.16 ms, steps of 10 us. The
    steady part lasts 6 ms: no trim falls into it.
    """
    friction = FRICTION[direction]
    steady = (170 * s >> 8) + friction
    speed = current = way = t = 0.0
    while way < stop or speed > 0:
        drive = friction + 96 if way < start else (steady if way < stop else -steady)
        current += (drive - speed - current) * 0.01 / 1.0
        net = current - friction if speed > 0 or current > friction else 0.0
        speed += net * 0.01 / 40.16
        way += speed * 256 / 170 * 50 * 1e-5
        t += 0.01
    return t


def test_52_run_moves_end_where_they_should():
    """Final error within 6 emitters; times to zero speed within 4 %, the reference's own time base.

    A run of 20 emitters lasts 24 ms as the specification says, but not in each direction: the rules alone
    (`short_low_move`) give 23.0 ms right and 24.4 ms left, because the reversed drive of 55 counts right and 47 left
    brakes with the friction of 36 and 28. On top, the start lies anywhere within its emitter. So 4 % bind the mean of
    both directions, and each direction to its calculated time.
    """
    table = {
        4000: (402, 402), 2000: (235, 235), 1200: (167, 167), 1001: (151, 151), 1000: (202, 202), 600: (135, 135),
        251: (76, 76), 200: (85, 85), 100: (52, 52), 63: (39, 39), 50: (45, 47), 20: (24, 24),
    }  # fmt: skip
    errors, found = [], {}
    for distance, (shortest, longest) in table.items():
        for direction in DIRECTIONS:
            rig = Rig().pretend_identified(emitter=2175 - direction * distance // 2)
            target = rig.head.emitter + direction * distance
            rig.run_to(target, wait=False)
            rows = rig.record(1, SIGNALS)
            assert rig.read_status() == OK
            speed = rows["plant.train.velocity"] * direction
            zero = int(np.flatnonzero((speed[1:] <= 0) & (speed[:-1] > 0))[0]) + 2
            time = found[distance, direction] = zero * TICK * 1e3
            rig.run(2500)
            errors.append((rig.head.emitter - target) * direction)
            if distance == 20:
                assert time == pytest.approx(short_low_move(direction), rel=0.04)
            else:
                assert 0.96 * shortest <= time <= 1.04 * longest, (distance, direction)
    assert max(map(abs, errors)) <= 6
    # Without a correction of the final error it cannot vanish either.
    assert max(map(abs, errors)) >= 2
    calculated = (short_low_move(1) + short_low_move(-1)) / 2
    assert calculated == pytest.approx(24, rel=0.04)
    assert (found[20, 1] + found[20, -1]) / 2 == pytest.approx(24, rel=0.04)
    assert found[1001, 1] < found[1000, 1], "halving makes the longer run the faster one"


def test_53_supply_headroom_at_every_speed_and_in_both_directions():
    """Steady drive and the top of the ramp of the axis itself, just after it has begun a run at each of its speeds."""
    tops = {}
    for direction in DIRECTIONS:
        for s in range(18, 241):
            head = started(s, direction=direction)
            assert head.steady == math.floor(170 * s / 256) + FRICTION[direction]
            # Below 10 in/s there is no ramp, but a start of friction + IR.
            tops[s, direction] = head.ramp_top if s >= 60 else head.drive
            assert tops[s, direction] == 96 + (head.steady if s >= 60 else FRICTION[direction])
    assert len(tops) == 2 * 223
    assert max(tops.values()) == 291
    assert tops[240, LEFT] == 283


def test_53_a_ramp_that_is_clipped_still_ends():
    """Ten per cent more motor constant, twenty more friction: 175 + 43 + 96 = 314 is clipped at 300."""
    clipped = []
    for direction, friction in ((RIGHT, 43), (LEFT, 34)):
        for s in range(60, 241):
            top = (187 * s >> 8) + friction + 96
            head = started(s, slope=187, right=43, left=34, direction=direction)
            assert head.ramp_top == min(top, 300)
            if top > 300:
                clipped.append((s, direction, top))
    assert max(top for *_, top in clipped) == 314
    assert {d for _, d, _ in clipped} == {RIGHT, LEFT}
    for s, direction, top in clipped:
        rig = Rig(187, 43.2, 33.6).pretend_identified(slope=187, right=43, left=34, emitter=2175 - direction * 1800)
        rig.set_speed(s)
        rig.controlled_run_to(2175 + direction * 1800, wait=False)
        rows = rig.record(2, SIGNALS)
        assert rig.read_status() == OK
        end = int(np.flatnonzero(rows["controller.head.state"] == HIGH_STEADY)[0])
        drive = rows["controller.head.drive"]
        # At the clip, or before it where the speed is reached first.
        assert drive[end - 1] == np.abs(rows["controller.head.drive_cmd"]).max() <= 300
        assert drive[end - 1] == 300 or rows["controller.head.interval_us"][end] * s <= 20_000
        assert drive[end - 1] == 300 or top < 314
        assert drive[end] == top - 96
        assert end * TICK < 0.1


# ---------------------------------------------------------------------------------------------- claims as properties


def test_54_slope_is_derived_only_on_command_and_every_later_drive_depends_on_it():
    rig = Rig()
    power_on = constants_of(rig)
    rig.send(0x99, 180)
    assert rig.next_status() == 0x00
    rig.send(0x92, 0x03, 0xE8)
    assert rig.next_status() == 0x04  # not calibrated: no motion, and no derivation
    assert constants_of(rig) == power_on
    assert rig.calculate() == 0x00
    right = rig.head.right
    assert right.slope == round(256 * (174 - 67) / (right.speed_fast - right.speed_slow))
    assert constants_of(rig) != power_on
    kept = constants_of(rig)
    for target in (1200, 3000, 2950):
        assert rig.run_to(target) == 0x00
        assert constants_of(rig) == kept


@given(slope=st.integers(100, 255), s=st.integers(60, 240))
def test_54_changing_the_slope_in_memory_changes_the_drive(slope, s):
    head = started(s, slope=slope)
    assert head.steady == ((slope * s) >> 8) + 36
    assert head.ramp_top == min(head.steady + 96, 300)


@cache
def _rig_for_starts() -> Rig:
    return Rig()


def started(s: int, *, slope: int = 170, right: int = 36, left: int = 28, direction: int = RIGHT) -> HeadComputer:
    """The computer just after it has begun a controlled run at speed s."""
    rig = _rig_for_starts()
    rig.r.restore(bytes(len(rig.r.snapshot())))
    rig.pretend_identified(slope=slope, right=right, left=left, emitter=2175 - direction * 2075)
    rig.set_speed(s)
    rig.controlled_run_to(2175 + direction * 2025, wait=False)
    assert (rig.head.speed, rig.head.direction) == (s, direction)
    return rig.head


def test_55_drive_is_the_line_through_slope_and_friction_at_every_speed():
    rig = Rig()
    assert rig.calculate() == 0x00
    for line in (rig.head.right, rig.head.left):
        for s in range(18, 241):
            exact = line.slope / 256 * s + line.friction
            assert 0 <= exact - steady_drive(line.slope, line.friction, s) < 1  # truncated, never rounded up
    for s in range(18, 241):
        assert abs(started(s).steady - (170 / 256 * s + 36)) <= 1


@pytest.mark.parametrize(("s", "state"), [(48, LOW_STEADY), (120, HIGH_STEADY)], ids=["low", "high"])
@pytest.mark.parametrize("wrong", [-9, 9])
def test_56_both_groups_change_the_drive_by_one_per_interval_until_equality(s, state, wrong):
    rig = Rig().pretend_identified(right=36 + wrong, emitter=100)
    rig.set_speed(s)
    rig.send(0xA2, 4200 >> 8, 4200 & 0xFF)
    names = ("drive", "state", "emitter", "interval_us", "now_us", "last_emitter_us")
    log = rig.record(5.0, ["plant.train.velocity", *(f"controller.head.{name}" for name in names)])
    rig.next_status()
    steady = log["controller.head.state"] == state
    drive, emitter = (log[f"controller.head.{name}"][steady].astype(int) for name in ("drive", "emitter"))
    every = round(0.016 / TICK)
    steps = np.diff(drive)
    # A count needs a whole window; by the interval of one emitter the first trim comes half a period on.
    trims = np.arange(every if state == HIGH_STEADY else every // 2, len(drive), every)
    assert not np.delete(steps, trims - 1).any()  # nothing between the intervals
    if state == LOW_STEADY:  # by the time of a single emitter, against 20000 / s
        running = (
            log["controller.head.now_us"] - log["controller.head.last_emitter_us"]
        )  # the interval under way, once it is the longer one
        interval = np.maximum(log["controller.head.interval_us"], running)[steady][trims]
        expected = np.sign(interval * s - 20_000)
    else:  # by the emitters of the interval, against 0.796 s
        expected = np.sign(round(0.796 * s) - (emitter[trims] - emitter[trims - every]))
    assert steps[trims - 1].tolist() == expected.tolist()
    assert np.sum(steps[trims - 1][:14]) * -wrong > 0  # towards the right drive
    assert abs(np.mean(log["plant.train.velocity"][steady][-2000:]) / INCH * 6 / s - 1) < 0.03
    # 20000 / 48 is no whole number of microseconds, so only the count can meet equality; the next test has it for both.
    assert (0 in expected) == (state == HIGH_STEADY)
    rig.set_speed(s + 10)
    assert started_drive(rig) == ((170 * (s + 10)) >> 8) + 36 + wrong  # another speed: the trimmed value is gone


def started_drive(rig: Rig) -> int:
    """Steady drive of a second move to the right, after a run back."""
    rig.run_to(100)
    rig.send(0xA2, 4200 >> 8, 4200 & 0xFF)
    return rig.head.steady


def test_56_the_groups_measure_by_different_methods():
    # The same moment, told differently by the two measures: one interval is short, the count of the window is low.
    c = HeadComputer(direction=RIGHT, speed=50, drive=100, interval_us=300, emitter=30, phase_start=0)
    trim_low(c)
    assert c.drive == 99  # 300 us < 400 us: too fast
    c.drive = 100
    trim_high(c)
    assert c.drive == 101  # 30 emitters < 40: too slow
    c.interval_us, c.drive = 400, 100
    trim_low(c)
    assert c.drive == 100
    c.emitter, c.phase_start, c.drive = 40, 0, 100
    trim_high(c)
    assert c.drive == 100
