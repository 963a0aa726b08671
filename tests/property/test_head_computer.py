"""Whatever bytes come: the axis computer answers, keeps its outputs within limits, and stands where it was sent."""

from collections import deque

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.print_head_rig import EMITTER, Rig

from detent.control.head_computer import (
    FAULT,
    HIGH_TRANSITION,
    IDLE,
    ILLEGAL,
    NOT_CALIBRATED,
    OBSTRUCTION,
    OK,
    OUT_OF_RANGE,
    OVERRUN,
    POWER_ON,
)
from detent.control.speed_selection import HIGH_SPEED

pytestmark = pytest.mark.compiled

OUTPUTS = (
    "lines.count", "lines.right_left", "lines.transition", "controller.head.drive_cmd", "controller.head.state",
    "plant.timer.pulse", "plant.latch.right_left", "plant.latch.transition", "plant.train.voltage",
)  # fmt: skip
STARTS = [0x8D, 0x92, 0xA2, 0x99, 0x40, 0x41, 0x01, 0x00, 0x80, 0x83, 0xFF]
LONGEST_WAIT = 40.0
"""Seconds: a print over the whole way at 3 in/s takes 10 with its run back; two may wait, and an identification."""

positions = st.integers(0, 4500)
any_byte = st.integers(0, 255)


def two_bytes(position):
    return position >> 8, position & 0xFF


commands = st.one_of(
    positions.map(lambda x: (0x92, *two_bytes(x))),
    positions.map(lambda x: (0xA2, *two_bytes(x))),
    st.tuples(positions, any_byte, positions).map(lambda a: (0x8D, *two_bytes(a[0]), a[1], *two_bytes(a[2]))),
    st.integers(0, 255).map(lambda s: (0x99, s)),
    st.integers(18, 240).map(lambda s: (0x99, s)),
    st.sampled_from([(0x40,), (0x41,), (0x80,), (0x00,)]),
    st.lists(any_byte.filter(lambda b: b != 0x01), min_size=1, max_size=9).map(tuple),
)
pauses = st.integers(0, 8000)
"""Ticks between two commands: from back to back to a third of a second."""


class Bench:
    """Feeds bytes, reads every status byte, and knows which answers must come."""

    def __init__(self, rig):
        self.rig, self.left, self.first = rig, 0, 0
        self.answers: list[int] = []
        self.expected: deque[set[int] | None] = deque()
        rig.p.controller.ack_last = 0

    def drain(self, ticks):
        while ticks > 0:
            ticks -= self.rig.run(ticks)
            if self.rig.head.status.latch.flag:
                self.answers.append(self.rig.read_status())

    def give(self, byte):
        """One byte; removes its acknowledgement, which must come at once."""
        latch = self.rig.head.command_latch
        self.drain(1)
        assert not latch.flag, "the last byte was not taken"
        latch.byte, latch.flag = byte, 1
        before = len(self.answers)
        if self.left == 0:
            self.first = byte
            self.left = byte & 7 if byte & 0x80 else 0
        else:
            self.left -= 1
        self.drain(1)
        while self.rig.head.status.waiting or self.rig.head.status.latch.flag:
            self.drain(1)
        if self.left > 0:
            assert 0xFF in self.answers[before:], "no acknowledgement"
            self.answers.pop(self.answers.index(0xFF, before))
        else:
            self.expected.append(self.allowed())

    def allowed(self):
        """Answers the complete command may get; None is any byte."""
        if self.first in (0x40, 0x41):
            return None
        if self.first == 0x99:
            return {OK, OUT_OF_RANGE}
        if self.first in (0x92, 0xA2, 0x8D):
            return {OK, OUT_OF_RANGE, OVERRUN, NOT_CALIBRATED}
        if self.first == 0x01:
            return {OK}
        return {ILLEGAL}

    def check_answers(self):
        while self.left:  # the rest of a command that was begun
            self.give(0)
        self.drain(1)
        waited = 0
        while len(self.answers) < len(self.expected) and waited < LONGEST_WAIT / 0.1:
            self.drain(2500)
            waited += 1
        assert len(self.answers) == len(self.expected), "a command got no answer, or two"
        for answer, allowed in zip(self.answers, self.expected, strict=True):
            assert allowed is None or answer in allowed | {OVERRUN}
        assert self.rig.head.status.lost == 0
        assert self.rig.head.state in (IDLE, FAULT, POWER_ON)
        assert (self.rig.head.out.count, self.rig.head.out.transition) == (0, 0)


def many(examples):
    return settings(max_examples=examples, suppress_health_check=[HealthCheck.too_slow])


@many(60)
@given(script=st.lists(st.tuples(commands, pauses), min_size=1, max_size=8), homed=st.booleans())
def test_every_command_gets_its_one_answer_in_order(script, homed):
    rig = Rig()
    if homed:
        rig.pretend_identified(emitter=2000)
    bench = Bench(rig)
    for command, pause in script:
        for byte in command:
            bench.give(byte)
        bench.drain(pause)
    bench.check_answers()


@many(40)
@given(data=st.lists(st.sampled_from(STARTS) | any_byte, min_size=1, max_size=40))
def test_arbitrary_bytes_never_hang_the_computer(data):
    rig = Rig()
    bench = Bench(rig)
    for byte in data:
        bench.give(byte)
    # It may be identifying; every command behind it is answered in its turn.
    bench.check_answers()
    assert rig.calculate() == OK
    assert rig.run_to(2000) == OK


def check_outputs(rows, limit):
    count, drive = rows["lines.count"], rows["controller.head.drive_cmd"].astype(int)
    transition, line = rows["lines.transition"].astype(int), rows["lines.right_left"].astype(int)
    assert count.min(initial=0) >= 0
    assert count.max(initial=0) <= 300
    assert np.abs(drive).max(initial=0) <= limit
    # Timer and lines take over what the computer put out, together, at the trigger of the same period.
    np.testing.assert_array_equal(rows["plant.timer.pulse"], count)
    np.testing.assert_array_equal(rows["plant.latch.right_left"], line)
    np.testing.assert_array_equal(rows["plant.latch.transition"], transition)
    np.testing.assert_array_equal(count, np.where(transition == 1, 300 - np.abs(drive), np.abs(drive)))
    assert np.all((drive == 0) | ((drive > 0) == (line == 1)))
    assert np.all((transition == 1) == (rows["controller.head.state"] == HIGH_TRANSITION))
    begins, ends = np.flatnonzero(np.diff(transition) == 1), np.flatnonzero(np.diff(transition) == -1)
    assert np.all(line[begins] == line[begins + 1]), "transition begins on the line of the motion"
    assert np.all(drive[ends + 1] == 0), "TR falls with V = 0"
    assert np.all(line[ends] != line[ends + 1]), "and the line changes with it"


@many(40)
@given(
    script=st.lists(st.tuples(commands, pauses), min_size=1, max_size=6),
    effort=st.sampled_from([38.0, 34.0, 30.0]),
    slopes=st.tuples(st.integers(140, 200), st.integers(20, 50), st.integers(20, 50)),
)
def test_outputs_stay_within_their_limits(script, effort, slopes):
    slope, right, left = slopes
    rig = Rig(slope, right, left, overrides=[f"limits.effort={effort} V"])
    rig.pretend_identified(slope=slope, right=right, left=left, emitter=2000)
    limit = rig.p.controller.drive_limit
    assert limit == int(effort / 38 * 300 + 1e-9)
    for command, pause in script:
        for byte in command:
            while rig.head.command_latch.flag:
                check_outputs(rig.record(4e-5, OUTPUTS, stop_at_status=False), limit)
            rig.head.command_latch.byte, rig.head.command_latch.flag = byte, 1
            check_outputs(rig.record(8e-5, OUTPUTS, stop_at_status=False), limit)
        check_outputs(rig.record(pause * 4e-5, OUTPUTS, stop_at_status=False), limit)
    check_outputs(rig.record(1.5, OUTPUTS, stop_at_status=False), limit)


@many(40)
@given(
    s=st.integers(18, 240),
    direction=st.sampled_from([1, -1]),
    share=st.floats(0.02, 0.95),
    after=st.lists(commands.filter(lambda c: 0x01 not in c), max_size=5),
)
def test_after_a_fault_nothing_moves_without_calculate_parameters(s, direction, share, after):
    rig = Rig().pretend_identified(emitter=2175 - 2000 * direction)
    rig.set_speed(s)
    target = 2175 + 2000 * direction
    rig.controlled_run_to(target, wait=False)
    end = (rig.head.emitter + 0.5 + share * 4000 * direction) * EMITTER
    if direction > 0:
        rig.p.plant.train.right_end = end
    else:
        rig.p.plant.train.left_end = end
    code = rig.next_status(10)
    if code == OK:
        # The obstacle was met while braking: standing still is then the expected end of the move.
        assert abs(rig.head.emitter - target) <= s * s / 144 + 12
        return
    assert code == OBSTRUCTION
    assert (rig.head.state, rig.head.out.count, rig.head.homed) == (FAULT, 0, 0)
    rig.run(5000)
    moves, here = rig.head.moves, rig.r.plant.train.position
    bench = Bench(rig)
    for command in after:
        for byte in command:
            bench.give(byte)
        bench.drain(2000)
    bench.check_answers()
    assert (rig.head.state, rig.head.moves, rig.head.drive_cmd) == (FAULT, moves, 0)
    assert rig.r.plant.train.position == here
    rig.p.plant.train.left_end, rig.p.plant.train.right_end = 0.0, rig.spec.limits.travel
    assert rig.calculate() == OK
    assert rig.head.state == IDLE


@many(60)
@given(targets=st.lists(st.integers(15, 4335), min_size=2, max_size=6))
def test_runs_end_at_their_targets(targets):
    """Within 6 emitters in the low-speed class and at 10 in/s, within 12 above it.

    The method does not correct its final error. The trim holds the speed to 1.5 % at 40 in/s, the stop distance goes
    with its square: 3 % of 400 emitters are 12. At 20 in/s the kept drive of the last move, up to 4 counts of its trim
    cycle from the exact one, counts twice: the ramp ends 4 counts of 96 higher, and the braking is 4 counts of 96
    weaker, of 100 emitters 8. The 6 emitters of the specification's test 52 belong to the distances it names.
    """
    rig = Rig().pretend_identified(emitter=2000)
    for target in targets:
        before = rig.head.emitter
        assert rig.run_to(target) == OK
        rig.run(2500)
        assert rig.r.plant.train.velocity == 0
        if abs(target - before) >= 20:
            bound = 6 if rig.head.speed <= HIGH_SPEED else 12
            assert abs(rig.head.emitter - target) <= bound
