"""The machine of a cascade axis: what its encoders show, and when."""

import math

import pytest
from tests.cascade_rig import SAMPLE_TICKS, Rig, make_params

from detent.methods.cascade.system import set_count
from detent.sensing.home_marks import latch
from detent.sensing.position_sensor import EncoderWord

COUNT = 1e-5


@pytest.mark.parametrize(
    ("place", "count"), [(0.0, 0), (0.49, 0), (0.51, 1), (-0.49, 0), (-0.51, -1), (123456.4, 123456), (-7.6, -8)]
)
def test_the_nearest_count_is_shown(place, count):
    word = EncoderWord()
    latch(word, COUNT, place * COUNT)
    assert (word.count, word.place) == (count, 0.0)


def test_without_counts_the_position_itself_is_shown():
    word = EncoderWord()
    latch(word, 0.0, math.pi)
    assert (word.count, word.place) == (0, math.pi)


def test_encoders_are_latched_at_the_samples_and_hold_between_them():
    p = make_params()
    set_count(p, 1e-9, 1e-9)
    rig = Rig(p)
    rig.r.plant.machine.motor.velocity = rig.r.plant.machine.load.velocity = 0.1
    run = rig.record(3 * SAMPLE_TICKS, ["lines.motor.count", "plant.machine.motor.position", "lines.sync"])
    counts, places = run["lines.motor.count"], run["plant.machine.motor.position"]
    assert len(set(counts[SAMPLE_TICKS : 2 * SAMPLE_TICKS])) == 1
    assert counts[SAMPLE_TICKS] == round(places[SAMPLE_TICKS - 1] * 1e9)
    assert [k for k, on in enumerate(run["lines.sync"]) if on] == [19, 39, 59]


def test_an_amplifier_that_is_not_enabled_takes_no_command():
    rig = Rig(make_params())
    rig.r.controller.reference.position = 1e-3
    rig.run(SAMPLE_TICKS)
    assert rig.r.plant.source.output > 0.0
    rig.r.controller.on = 0
    rig.run(SAMPLE_TICKS)
    assert (rig.r.lines.enable, rig.r.plant.source.command, rig.r.plant.source.output) == (0, 0.0, 0.0)
