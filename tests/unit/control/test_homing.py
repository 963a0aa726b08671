"""The block of homing, on a point that does at once what it is told, between hard stops, a switch and marks."""

import math
from typing import Any

import pytest

from detent.control import homing
from detent.control.homing import Homing, HomingParams, Seen

DT = 1e-3


class Point:
    """It moves at the velocity demanded; a stop at `wall` holds it, and the commanded point runs on."""

    def __init__(self, way: int, at: float, *, wall: float = -0.5, edge: float = 0.0, pitch: float = 0.1) -> None:
        self.p: Any = HomingParams(
            way=way, side=-1.0, place=7.0, speed=1.0, creep=0.1, back=0.02, longest=2.0, pitch=0.12, lag=0.01,
            grain=1e-9, still=5,
        )  # fmt: skip
        self.r: Any = Homing()
        self.at = self.commanded = at
        self.velocity, self.wall, self.edge, self.pitch = 0.0, wall, edge, pitch
        self.marks, self.mark = 0, 0.0

    def see(self) -> Seen:
        return Seen(
            position=self.at, ahead=self.commanded - self.at, rests=self.velocity == 0.0, switch=self.at <= self.edge,
            marks=self.marks, mark=self.mark,
        )  # fmt: skip

    def do(self, told: int) -> None:
        if told == homing.RUN:
            self.velocity = self.r.velocity
        elif told != homing.ON:
            self.velocity, self.commanded = 0.0, self.at
        before = self.at
        self.commanded += self.velocity * DT
        self.at = max(self.commanded, self.wall)
        cells = [math.floor(one / self.pitch - 0.3) for one in (before, self.at)]
        if cells[0] != cells[1]:
            self.marks, self.mark = self.marks + 1, (max(cells) + 0.3) * self.pitch

    def home(self) -> int:
        """Home; what came of it."""
        told = homing.begin(self.p, self.r, self.see())
        for _ in range(10_000):
            self.do(told)
            told = homing.seek(self.p, self.r, self.see())
            if told in {homing.FOUND, homing.FAILED}:
                return told
        pytest.fail("it does not end")


@pytest.mark.parametrize("at", [0.0301, 0.3017, 0.9, -0.2])
@pytest.mark.parametrize(
    ("way", "zero", "within"),
    [(homing.CONTACT, -0.5, 1e-12), (homing.SWITCH, 0.0, 1.01e-4), (homing.INDEX, 0.03, 1e-12)],
)
def test_the_reference_is_where_it_is_from_everywhere(way, zero, within, at):
    point = Point(way, at)
    assert point.home() == homing.FOUND
    assert point.r.latched == pytest.approx(zero, abs=within)
    assert point.at - point.r.latched == pytest.approx(0.02, abs=2e-3)  # it ends off its reference
    assert (point.r.phase, point.r.code) == (homing.IDLE, 0)


@pytest.mark.parametrize(
    ("way", "at", "spoilt", "code"),
    [
        (homing.CONTACT, 0.3, {"wall": -9.0}, homing.NONE_FOUND),
        (homing.SWITCH, 0.3, {"edge": -9.0}, homing.NONE_FOUND),
        (homing.SWITCH, 0.3, {"edge": -9.0, "wall": -99.0}, homing.NONE_FOUND),
        (homing.SWITCH, 0.3, {"edge": 9.0}, homing.ACTIVE), (homing.INDEX, 0.3, {"pitch": 5.0}, homing.INDEX_FAR),
    ],
)  # fmt: skip
def test_what_is_not_found_is_told(way, at, spoilt, code):
    point = Point(way, at, **spoilt)
    assert point.home() == homing.FAILED
    assert (point.r.phase, point.r.code) == (homing.IDLE, code)


def test_a_switch_that_stays_on_is_told():
    point = Point(homing.SWITCH, 0.3)
    told = homing.begin(point.p, point.r, point.see())
    while point.r.phase != homing.SEEN:
        point.do(told)
        told = homing.seek(point.p, point.r, point.see())
    point.edge = 9.0
    while told != homing.FAILED:
        point.do(told)
        told = homing.seek(point.p, point.r, point.see())
    assert point.r.code == homing.NOT_CLEARED
