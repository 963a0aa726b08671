"""The machine of a cascade axis: what its encoders show, and when."""

import math

import pytest
from tests.cascade_rig import SAMPLE_TICKS, Rig, make_params

from detent.methods.cascade.system import set_count
from detent.sensing.home_marks import EndSwitchParams, EndWires, latch, sense_ends
from detent.sensing.position_sensor import EncoderWord

COUNT = 1e-5


@pytest.mark.parametrize(
    ("place", "count"), [(0.0, 0), (0.49, 0), (0.51, 1), (-0.49, 0), (-0.51, -1), (123456.4, 123456), (-7.6, -8)]
)
def test_the_nearest_count_is_shown(place, count):
    word = EncoderWord(lost=1)
    latch(word, COUNT, place * COUNT)
    assert (word.count, word.place, word.lost) == (count, 0.0, 0)


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


@pytest.mark.parametrize(("place", "closed"), [(-0.02, (0, 1)), (-0.01, (0, 1)), (0.0, (1, 1)), (0.5, (1, 0))])
def test_a_limit_switch_opens_at_its_place_and_stays_open_beyond(place, closed):
    p, wires = EndSwitchParams(present=1, lower=-0.01, upper=0.5), EndWires()
    sense_ends(p, wires, place)
    assert (wires.lower, wires.upper) == closed


def test_limit_switches_are_seen_with_the_encoders():
    p = make_params()
    p.plant.ends.present, p.plant.ends.lower, p.plant.ends.upper = 1, -1.0, 1.0
    rig = Rig(p, 2.0).run(SAMPLE_TICKS)
    assert (rig.r.lines.ends.lower, rig.r.lines.ends.upper) == (1, 0)
