from dataclasses import replace

import pytest
from tests.live_rig import BAND, SENSORS, TRAVEL, read, sensor

from detent.methods.position import PositionSensor, Sensed
from detent.operate.trust import Saved, Trust, Why, judge

PARKED = Saved(moving=False, trust=Trust.REFERENCED, counts=5000, offset=77)
MOVING = replace(PARKED, moving=True)
RULED = sensor(Sensed.ABSOLUTE)


@pytest.mark.parametrize(
    ("name", "saved", "stands", "trust", "why"),
    [
        # counts from where it is switched on
        ("incremental", PARKED, 5000, Trust.UNKNOWN, Why.NOT_HELD),
        ("incremental", MOVING, 5000, Trust.UNKNOWN, Why.KILLED),
        ("incremental, held", PARKED, 5000, Trust.RESTORED, Why.PARKED),
        ("incremental, held", MOVING, 5000, Trust.UNKNOWN, Why.KILLED),
        # absolute within a band, of which the travel has several (F07)
        ("band", PARKED, 5000, Trust.UNKNOWN, Why.AMBIGUOUS),
        ("band", PARKED, 5000 + BAND, Trust.UNKNOWN, Why.AMBIGUOUS),
        ("band", MOVING, 5000, Trust.UNKNOWN, Why.AMBIGUOUS),
        ("band, held", PARKED, 5003, Trust.RESTORED, Why.READ),
        ("band, held", PARKED, 5100, Trust.UNKNOWN, Why.MOVED),
        ("band, held", MOVING, 5000, Trust.UNKNOWN, Why.AMBIGUOUS),
        # the same where the band is longer than the travel: a kill in motion does no harm (F64)
        ("band over the travel", PARKED, 4995, Trust.RESTORED, Why.READ),
        ("band over the travel", MOVING, 12_000, Trust.RESTORED, Why.UNIQUE),
        ("band over the travel", PARKED, TRAVEL + 500, Trust.UNKNOWN, Why.OUTSIDE),
        ("absolute", PARKED, 5000, Trust.RESTORED, Why.READ),
        ("absolute", PARKED, 5006, Trust.UNKNOWN, Why.MOVED),
        ("absolute", MOVING, 12_000, Trust.RESTORED, Why.UNIQUE),
        ("absolute", MOVING, -6, Trust.UNKNOWN, Why.OUTSIDE),
        ("absolute", MOVING, TRAVEL + 6, Trust.UNKNOWN, Why.OUTSIDE),
        ("circle", PARKED, 5003, Trust.RESTORED, Why.READ),
        ("circle", MOVING, 19_000, Trust.RESTORED, Why.UNIQUE),
        ("circle", PARKED, 19_000, Trust.UNKNOWN, Why.MOVED),
    ],
)
def test_what_a_sensor_can_tell(name, saved, stands, trust, why):
    judged = judge(SENSORS[name], saved, read(SENSORS[name], stands, 77))
    assert (judged.trust, judged.why) == (trust, why)
    assert judged.counts == (None if trust is Trust.UNKNOWN else stands)


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize(
    ("saved", "why"),
    [
        (None, Why.NEW),
        (replace(PARKED, trust=Trust.UNKNOWN), Why.UNREFERENCED),
        (replace(PARKED, elsewhere=True), Why.ELSEWHERE),
        (replace(MOVING, elsewhere=True), Why.ELSEWHERE),
    ],
)
def test_whatever_the_sensor_tells_nothing_is_guessed(name, saved, why):
    judged = judge(SENSORS[name], saved, 4923)
    assert (judged.trust, judged.why, judged.counts) == (Trust.UNKNOWN, why, None)


def test_an_absolute_sensor_needs_its_reading_and_its_zero():
    assert judge(RULED, PARKED, None).why is Why.NO_READING
    assert judge(RULED, replace(PARKED, offset=None), 4923).why is Why.NO_OFFSET


def test_on_a_circle_the_distance_is_the_short_way():
    saved = replace(PARKED, counts=10)
    judged = judge(SENSORS["circle"], saved, read(SENSORS["circle"], TRAVEL - 10, 77))
    assert (judged.why, judged.shown, judged.distance) == (Why.MOVED, TRAVEL - 10, -20)


@pytest.mark.parametrize(("left", "stands"), [(340, 15_048), (19_654, 8517), (-300, 5000), (TRAVEL + 300, 5000)])
def test_of_many_bands_that_fit_none_is_taken_however_near_the_end_it_was_left(left, stands):
    saved = replace(MOVING, counts=left)
    assert judge(SENSORS["band"], saved, read(SENSORS["band"], stands, 77)).why is Why.AMBIGUOUS


def test_a_turn_more_of_an_axis_without_ends_is_not_excluded():
    endless = sensor(Sensed.BAND, ends=None)
    assert judge(endless, PARKED, 4923 % BAND).why is Why.AMBIGUOUS
    assert judge(replace(endless, held=True), PARKED, 4923 % BAND).counts == 5000


def test_a_place_in_words():
    assert judge(RULED, PARKED, 4923).describe(RULED).endswith("(5 mm)")
    assert "7 mm" in judge(RULED, PARKED, 6923).describe(RULED)
    assert judge(RULED, None, 0).describe(RULED) == f"unknown: {Why.NEW}"


def test_positions_and_counts_are_the_same_places():
    made = PositionSensor(sensor="steps", kind=Sensed.INCREMENTAL, scale=5e-6, origin=0.01, ends=(0.01, 0.0125))
    assert made.counts(0.01) == 0
    assert made.counts(0.012) == 400
    assert made.position(400) == 0.012
    assert made.reach == (-1, 501)
