"""Print-head specification, acceptance tests 28 to 53: speed selection, low speed, high speed."""

import math

import numpy as np
import pytest

from detent.control.feed_forward import low_speed_start_emitters, ramp_interval_us, stop_distance_up, window_reference
from detent.control.head_computer import (
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    IDLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    OK,
    HeadComputer,
    HeadParams,
)
from detent.control.head_motion import put_low, trim_high, trim_low
from detent.control.speed_selection import fits, select_speed
from detent.kernel.step import step
from tests.print_head_rig import EMITTER, TICK, Rig

INCH = 0.0254
LINES = (1, "right"), (-1, "left")
SIGNALS = (
    "train.velocity", "train.position", "train.mean_current", "head.state", "head.emitter", "head.interval_us",
    "head.drive", "head.drive_cmd", "head.out.count", "head.out.right_left", "head.out.transition",
)  # fmt: skip
FRICTION = {1: 36, -1: 28}
"""Counts, default plant."""

OPEN_LOOP = "method.trim=false"
"""Where a figure of the specification starts from an untrimmed steady drive."""


class Move:
    """One move from rest with identified constants, recorded at every tick until its status byte."""

    def __init__(self, s: int, direction: int, distance: int, *overrides: str, start: int | None = None) -> None:
        if start is None:
            start = 2175 - direction * distance // 2
        self.rig = Rig(overrides=overrides).pretend_identified(emitter=start)
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
        return self.rows["train.velocity"] * self.direction / INCH

    @property
    def way(self) -> np.ndarray:
        """Way along the direction of the move [emitters]."""
        return self.rows["train.position"] * self.direction / EMITTER

    def first(self, *states: int, after: int = 0) -> int:
        """First row in one of `states`."""
        return after + int(np.flatnonzero(np.isin(self.rows["head.state"][after:], states))[0])

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
    """Two opposite moves at one speed, the second queued while the first runs; times in ms from the begin of the stop."""

    def __init__(self, direction: int, s: int, *overrides: str) -> None:
        self.rig = rig = Rig(overrides=overrides).pretend_identified(emitter=400 if direction > 0 else 3950)
        if s != 240:
            rig.set_speed(s)
        for target in (3400, 800) if direction > 0 else (950, 3550):
            rig.controlled_run_to(target, wait=False)
        rows = self.rows = rig.record(3, SIGNALS, stop_at_status=False)
        state, speed = rows["head.state"], rows["train.velocity"] * direction / INCH
        self.begin = int(np.flatnonzero(np.isin(state, (HIGH_TRANSITION, HIGH_REVERSE)))[0])
        self.zero = self.begin + int(np.flatnonzero(speed[self.begin :] <= 0)[0])
        self.turn = self.begin + int(np.flatnonzero(~np.isin(state[self.begin :], (HIGH_TRANSITION, HIGH_REVERSE)))[0])
        self.end = self.turn + int(np.flatnonzero(state[self.turn :] != HIGH_ACCEL)[0])
        reached = speed[self.begin :] <= -39 / 40 * s / 6
        self.reached = self.begin + int(np.flatnonzero(reached)[0])
        self.speed = -speed

    def ms(self, row: int) -> float:
        """Time of a row."""
        return (row - self.begin + 1) * TICK * 1e3


def fastest_over(limit: int) -> int:
    """Smallest distance at which 2.5 stop distances of `limit` fit."""
    return next(d for d in range(1, 4000) if fits(d, limit))


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
        assert fastest_over(s) == math.floor(2.5 * distance) + 1


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
    # Stop position 1225, 825 from the head: 2.5 x 225 fits. To 500 it would be 375 at 15 in/s, 325 at the 90 that fits.
    for start, end, expected in ((600.0, 1000, 180), (1300.0, 1560, 90)):
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
    passed = move["head.emitter"] - move.origin
    assert set(move["head.drive_cmd"][:change]) == {132}
    assert (passed[change - 1], passed[change]) == (4, 5)
    assert move["head.drive_cmd"][change] == 55
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
    drive, interval = move["head.drive"][begin:end].astype(int), move["head.interval_us"][begin:end]
    changes = np.diff(drive)
    boundaries = np.arange(400, end - begin, 400)
    assert len(boundaries) > 40
    assert set(np.flatnonzero(changes) + 1) <= set(boundaries)
    # Interval and drive of the same tick: the computer trims with the interval of the latest emitter.
    np.testing.assert_array_equal(changes[boundaries - 1], np.sign(interval[boundaries] * 40 - 20000))
    # The memory location is the drive that goes out, unless the overspeed test halves it.
    out = move["head.out.count"][begin:end]
    assert np.all((out == drive) | (out == drive >> 1))
    assert np.mean(out == drive) > 0.9


LIMIT_CYCLE = (0, 1, 2, 1, 0, -1, -2, -1)
"""Drive of a trim cycle of 4 counts width, per 16 ms, relative to the drive that holds the speed."""


def cycle_swing(s: int, offset: float) -> float:
    """Largest relative speed deviation of LIMIT_CYCLE at speed value s, with the whole counts `offset` above the exact.

    The speed follows one count by 256/170 speed values with the mechanical time constant of 40.16 ms.
    """
    decay, y, peak = math.exp(-16 / 40.16), 0.0, 0.0
    for n in range(80):
        y = decay * y + (1 - decay) * (LIMIT_CYCLE[n % 8] + offset) * 256 / 170
        peak = max(peak, abs(y)) if n >= 64 else 0.0
    return peak / s


@pytest.mark.parametrize(("direction", "name"), LINES)
@pytest.mark.parametrize("s", [18, 24, 30, 42, 54])
def test_36_low_speed_is_held(s, direction, name):
    """Steady speed within 3 % with a trim cycle of at most 4 counts.

    The specification's two bars meet in one point only. A trim cycle 4 counts wide, which it allows, swings the speed by
    more than 3 % at 4 and 5 in/s (`cycle_swing`); it is a metastable cycle of rule 3.7 with real, whole emitter
    intervals, into which the end of the open-loop start can lead, and which decays within 0.5 s to the one 2 counts
    wide. So the 3 % hold after 0.15 s wherever the cycle is not that wide one, and after 0.55 s always.
    """
    move = Move(s, direction, min(3900, 75 * s))
    begin, end = move.first(LOW_STEADY), move.stop()
    t = np.arange(end - begin) * TICK
    error, drive = move.speed[begin:end] / (s / 6) - 1, move["head.drive"][begin:end]
    assert np.ptp(drive[t > 0.15]) <= 4
    settled = t > 0.55
    assert np.count_nonzero(settled) * TICK > 0.4
    assert np.ptp(drive[settled]) <= 3
    assert np.abs(error[settled]).max() <= 0.03
    if s in (24, 30):
        offset = math.ceil(170 * s / 256) - 170 * s / 256
        swing = cycle_swing(s, offset)
        assert swing > 0.03, "the 3 % would be reachable with the wide cycle too"
        assert np.abs(error[t > 0.15]).max() <= swing
    else:
        assert np.abs(error[t > 0.15]).max() <= 0.03
    # A drive of whole counts cannot hold the speed exactly.
    assert np.abs(error[settled]).max() >= 0.2 * 256 / 170 / s


def test_37_overspeed_test_limits_a_push():
    peaks = {}
    for test in ("true", "false"):
        rig = Rig(overrides=[f"method.overspeed_test={test}"]).pretend_identified(emitter=200)
        rig.set_speed(30)
        rig.controlled_run_to(3000, wait=False)
        rig.record(0.6, SIGNALS)
        rig.p.push.force, rig.p.push.begin, rig.p.push.end = 3.0, rig.r.tick, rig.r.tick + 1500
        rows = rig.record(0.12, SIGNALS)
        peaks[test] = rows["train.velocity"].max() / INCH
        drive, out = rows["head.drive"].astype(int), rows["head.out.count"]
        changed = np.flatnonzero(np.diff(drive))
        assert np.abs(np.diff(drive)).max() == 1
        assert np.diff(changed).min() >= 400
        halved = out == drive >> 1
        assert np.all(halved | (out == drive))
        assert np.any(halved) == (test == "true")
        if test == "true":
            fast = (rows["head.interval_us"] * 30 * 17 < 320_000) & (rows["head.interval_us"] > 0)
            np.testing.assert_array_equal(halved, fast)
    assert 5.0 < peaks["true"] <= 5.6
    assert 6.8 <= peaks["false"] < 8.0


def low_speed_stops(s):
    return [(direction, Move(s, direction, 700)) for direction in (1, -1)]


def test_38_low_speed_stop_reverses_the_running_drive():
    for s in range(18, 60):
        for direction, move in low_speed_stops(s):
            begin = move.stop()
            command = move["head.drive_cmd"]
            assert set(command[begin:-1]) == {-direction * move["head.drive"][begin - 1]}
            assert command[begin - 1] in (-command[begin], -command[begin] // 2)
            assert not np.any(move["head.out.transition"])
            distance = move.stop_distance()
            assert abs(distance - s * s / 144) <= 5.5
            if s == 54:
                # Whole emitters in the specification: 17 right, 19 left.
                assert round(distance) == {1: 17, -1: 19}[direction]
            # Drive off with the detection of zero speed, at the reversal or within the 5 ms without an emitter.
            assert command[-1] == 0
            assert (len(command) - move.standstill()) * TICK < 5e-3
            peak = move.way[move.standstill()]
            move.rig.run(2500)
            assert move.rig.r.train.velocity == 0
            back = peak - move.rig.r.train.position * direction / EMITTER
            assert 0 <= back <= 1.0


def test_39_low_speed_forgets_the_trimmed_drive():
    move = Move(30, 1, 1500, start=500)
    assert move["head.drive"][move.stop() - 1] != 55
    rig = move.rig
    rig.controlled_run_to(3500, wait=False)
    rows = rig.record(3, SIGNALS)
    change = int(np.flatnonzero(rows["head.state"] == LOW_STEADY)[0])
    assert rows["head.drive"][change] == 55


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
    assert 345 <= shortest
    assert longest <= 465
    # Without the truncation of K s/256 the interval is 0.133 s x 256/(480 K) at every speed: 350..450 us to the rounding
    # of the bounds on K; 158 and 203 are 157.6 and 202.7, rounded.
    exact = {slope: 133_000 * 256 / 480 / slope for slope in (158, 202, 203)}
    assert 350 <= exact[202] < exact[158] <= 450
    assert exact[203] == pytest.approx(350, abs=0.6)


def test_41_acceleration_profile():
    for s, duration, speed in ((240, 66.5, 39.65), (60, 16.6, 9.4), (120, 33.3, 19.5)):
        move = Move(s, 1, 3000)
        steady = move.first(HIGH_STEADY)
        drive = move["head.drive"].astype(int)
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
            assert move["head.emitter"][steady] - move.origin == pytest.approx(389, abs=8)
        first, last = round(0.1 * steady), round(0.9 * steady)
        acceleration = (move.speed[last] - move.speed[first]) / ((last - first) * TICK)
        assert acceleration == pytest.approx(600, rel=0.03)


def test_42_ramp_ends_early_when_the_speed_is_reached():
    rig = Rig().pretend_identified(emitter=200)
    rig.r.train.velocity = 30 * INCH
    rig.run_to(3000, wait=False)
    rows = rig.record(0.2, SIGNALS)
    end = int(np.flatnonzero(rows["head.state"] != HIGH_ACCEL)[0])
    assert rows["head.state"][end] == HIGH_STEADY
    assert end * TICK * 1e3 == pytest.approx(54.5, abs=2)
    assert rows["head.drive"][end - 1] == pytest.approx(262, abs=5)
    assert 0 < rows["head.interval_us"][end] <= 20000 / 240 < rows["head.interval_us"][end - 4]
    assert 28.8 <= rows["train.velocity"][:end].min() / INCH < 29.9


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
        for direction, _ in LINES:
            move = Move(s, direction, 3800)
            begin, end = move.first(HIGH_STEADY), move.stop()
            drive = move["head.drive"][begin:end].astype(int)
            changes = np.flatnonzero(np.diff(drive)) + 1
            assert set(changes) <= set(range(400, len(drive), 400))
            assert np.abs(np.diff(drive)).max() == 1
            error = move.speed[begin:end] / (s / 6) - 1
            settled = error[round(0.1 / TICK) :]
            assert low <= settled.min()
            assert settled.max() <= high
            assert np.ptp(settled) > 0.002, "a trim of whole counts cannot hold the speed exactly"


def steady_begin(rows):
    begin = int(np.flatnonzero(rows["head.state"] == HIGH_STEADY)[0])
    return int(rows["head.drive"][begin - 1]), int(rows["head.drive"][begin])


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
    drive, count = move["head.drive_cmd"], move["head.out.count"]
    transition, line = move["head.out.transition"], move["head.out.right_left"]
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
    current = move["train.mean_current"]
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
    assert move["head.drive"][begin - 1] == 87
    # Along the motion: 87 - 96 = -9 against it, to the right.
    assert (move["head.drive"][begin], move["head.drive_cmd"][begin]) == (-9, 9)
    assert (move["head.out.right_left"][begin - 1], move["head.out.right_left"][begin]) == (0, 1)
    assert not np.any(move["head.out.transition"])
    assert HIGH_TRANSITION not in move["head.state"]


def test_47_without_transition_the_head_coasts():
    for s, coasting, braked in ((240, 599, 403), (180, 320, 229), (120, 126, 104)):
        free = Move(s, 1, 3000, "method.transition=false")
        assert free.stop_distance() == pytest.approx(coasting, rel=0.05)
        assert not np.any(free["head.out.transition"])
        held = Move(s, 1, 3000)
        assert held.stop_distance() == pytest.approx(braked, rel=0.05)
        if s == 240:
            peak = np.abs(free["train.mean_current"][free.stop() : free.standstill()]).max()
            constant = np.abs(held["train.mean_current"][held.stop() : held.standstill()]).max()
            assert peak == pytest.approx(1.24, rel=0.05)
            assert 1.8 < peak / constant < 2.1
            # Nothing brakes while the drive value is still above zero.
            assert not np.any(free["train.mean_current"][free.stop() + 200 : free.first(HIGH_REVERSE) - 1])


def test_48_turn_around():
    turn = TurnAround(1, 240, OPEN_LOOP)
    rows, begin = turn.rows, turn.begin
    command = rows["head.drive_cmd"].astype(int)
    change = begin + int(np.flatnonzero(command[begin:] == 0)[0])
    # Event table 4.4.
    assert (command[begin - 1], command[begin]) == (195, 99)
    assert turn.ms(change) == pytest.approx(41.4, abs=1)
    assert -turn.speed[change] == pytest.approx(15.3, abs=0.3)
    assert turn.ms(turn.zero) == pytest.approx(66.8, abs=1.5)
    assert command[turn.zero] == pytest.approx(-60, abs=4)
    assert rows["head.emitter"][turn.zero] - rows["head.emitter"][begin] == pytest.approx(403, abs=8)
    # The jump follows when the encoder has seen the reversal, up to 2.5 ms or six counts later.
    assert command[turn.turn - 1] - command[turn.turn] in (64, 65)
    assert turn.ms(turn.turn) - turn.ms(turn.zero) <= 2.5
    assert (command[turn.end - 1], command[turn.end]) == (-283, -187)
    assert turn.ms(turn.end) == pytest.approx(133.3, abs=1.5)
    assert turn.speed[turn.end] == pytest.approx(39.7, abs=0.3)
    assert not np.any(rows["head.out.transition"][change:])
    assert not np.any(rows["head.out.right_left"][change : turn.end])
    assert rig_turned(turn) == (1, [OK, OK])
    # Both speeds, both directions, with the trim as in normal work.
    for s, time, tolerance in ((240, 133, 6), (120, 67, 6 * 67 / 133)):
        both = [TurnAround(direction, s) for direction in (1, -1)]
        times = [one.ms(one.reached) for one in both]
        assert times == pytest.approx([time, time], abs=tolerance)
        assert abs(times[0] - times[1]) <= 2
        assert [rig_turned(one)[0] for one in both] == [1, 1]


def rig_turned(turn):
    """Turn-arounds made, and the motion commands' answers."""
    answers = [code for code in turn.rig.responses if code != 0xFF]
    return turn.rig.head.turn_arounds, answers[-2:]


def test_49_turn_around_needs_same_speed_opposite_direction_and_a_queued_command():
    cases = {
        "different speed": (240, 3000, 2600),
        "same direction": (120, 1400, 2600),
        "low speed": (48, 1000, 400),
        "nothing queued": (240, 3000, None),
    }
    for name, (s, first, second) in cases.items():
        rig = Rig().pretend_identified(emitter=400)
        rig.set_speed(s)
        rig.controlled_run_to(first, wait=False)
        if second is not None:
            rig.controlled_run_to(second, wait=False)
        rows = rig.record(4, SIGNALS)
        assert rig.read_status() == OK, name
        assert rig.head.turn_arounds == 0, name
        if second is None:
            assert rows["head.drive_cmd"][-1] == 0
            assert rig.head.state == IDLE
            continue
        # The next command starts afresh: from friction + IR of its direction, not from the jumped braking value.
        direction = rig.head.direction
        assert rows["head.drive_cmd"][-1] == direction * (FRICTION[direction] + 96), name
        assert rig.head.moves == 2, name


def test_50_turn_around_without_the_friction_jump_takes_longer():
    turn = TurnAround(1, 240, "method.friction_jump=false")
    command = turn.rows["head.drive_cmd"].astype(int)
    assert abs(command[turn.turn] - command[turn.turn - 1]) <= 1
    assert turn.ms(turn.end) == pytest.approx(158, abs=4)
    assert turn.ms(turn.reached) == pytest.approx(158, abs=4)


def test_51_literal_span_ramps_too_fast():
    turn = TurnAround(1, 240, "method.span=steady", OPEN_LOOP)
    assert turn.ms(turn.end) == pytest.approx(111, rel=0.03)
    assert turn.speed[turn.end] == pytest.approx(35, rel=0.03)
    distance = (turn.rows["train.position"][turn.zero] - turn.rows["train.position"][turn.begin - 1]) / EMITTER
    assert distance == pytest.approx(377, rel=0.03)


def short_low_move(direction, *, start=5, stop=13, s=30):
    """Time of a 20-emitter run from the rules alone [ms]: 5 emitters of 132 or 124 counts, the steady drive, reversed at 13.

    Drive and speed in counts of back-EMF; electrical lag 1 ms, mechanical time constant 40.16 ms, steps of 10 us; the
    trim falls into the run once, 16 ms after the start, and finds the head too slow.
    """
    friction = FRICTION[direction]
    drive, speed, current, way, t, begun, trimmed = friction + 96, 0.0, 0.0, 0.0, 0.0, 0.0, False
    while True:
        current += (drive - speed - current) * 0.01 / 1.0
        net = current - friction if speed > 0 or current > friction else 0.0
        speed += net * 0.01 / 40.16
        way += speed * 256 / 170 * 50 * 1e-5
        t += 0.01
        if drive == friction + 96 and way >= start:
            drive, begun = (170 * s >> 8) + friction, t
        elif begun and not trimmed and t >= begun + 16:
            drive, trimmed = drive + (1 if drive > 0 else 0), True
        if drive > 0 and way >= stop:
            drive, trimmed = -drive, True
        if drive < 0 and speed <= 0:
            return t


def test_52_run_moves_end_where_they_should():
    """Final error within 6 emitters; times to zero speed within 4 %, the reference's own time base.

    A run of 20 emitters is on average 24 ms long as the specification says, but not in each direction: the rules alone
    (`short_low_move`) give 23.0 ms right and 24.4 ms left, because the start of 132 counts against 124 reaches the fifth
    emitter sooner and the reversed drive of 55 against 47 counts stops harder. On top, the first emitter of a run lies
    anywhere within one emitter. So 4 % bind the mean of both directions, and each direction its calculated time.
    """
    table = {
        4000: (402, 402), 2000: (235, 235), 1200: (167, 167), 1001: (151, 151), 1000: (202, 202), 600: (135, 135),
        251: (76, 76), 200: (85, 85), 100: (52, 52), 63: (39, 39), 50: (45, 47), 20: (24, 24),
    }  # fmt: skip
    errors, found = [], {}
    for distance, (shortest, longest) in table.items():
        for direction, _ in LINES:
            rig = Rig().pretend_identified(emitter=2175 - direction * distance // 2)
            target = rig.head.emitter + direction * distance
            rig.run_to(target, wait=False)
            rows = rig.record(1, SIGNALS)
            assert rig.read_status() == OK
            speed = rows["train.velocity"] * direction
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


def test_53_supply_headroom():
    tops = {(s, d): (170 * s >> 8) + FRICTION[d] + 96 for s in range(18, 241) for d in (1, -1)}
    assert max(tops.values()) == 291 <= 300
    for direction, _ in LINES:
        for s in range(60, 241, 20):
            rig = Rig().pretend_identified(emitter=2175 - direction * 1900)
            rig.set_speed(s)
            rig.controlled_run_to(rig.head.emitter + direction * 3800, wait=False)
            assert rig.head.ramp_top == tops[s, direction]
    # Ten per cent more motor constant, twenty more friction: 175 + 43 + 96 = 314 is clipped, and the ramp still ends.
    rig = Rig(187, 43.2, 33.6).pretend_identified(slope=187, right=43, left=34, emitter=200)
    rig.run_to(3800, wait=False)
    rows = rig.record(2, SIGNALS)
    assert rig.read_status() == OK
    end = int(np.flatnonzero(rows["head.state"] == HIGH_STEADY)[0])
    assert rows["head.drive"][end - 1] == 300 == rows["head.drive_cmd"].max()
    assert rows["head.drive"][end] == 175 + 43 == 314 - 96
    assert end * TICK < 0.1
