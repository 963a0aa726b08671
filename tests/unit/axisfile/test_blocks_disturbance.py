"""Disturbances of the lines and of the carriage, from the tables of the file to the blocks."""

import pytest
from tests.dump import dump_spec

from detent.axisfile.blocks import KINDS, fill_interference, fill_push
from detent.axisfile.tables import BurstTable, InterferenceTable, PushTable
from detent.plant.push import Push, push_force
from detent.sensing.interference import ENTRIES, RATES, Interference, InterferenceParams, interfere, start_interference

TICK = 2.5e-7


def filled(**tables):
    p = InterferenceParams()
    fill_interference(p, InterferenceTable.model_construct(**tables), TICK)
    return p


def burst(**values):
    return filled(burst=BurstTable.model_construct(**{"kind": "+", **values}))


def test_quiet_lines_have_no_events():
    p = filled()
    assert (p.entries, list(p.mean_ticks)) == (0, [0.0] * RATES)


@pytest.mark.parametrize(
    ("key", "counter"),
    [("removed", "remove"), ("lost_samples", "lose_sample"), ("corrupted", "corrupted"), ("inserted", "inserted")],
)
def test_a_rate_is_that_of_its_own_kind(key, counter):
    p = filled(**{key: 1000.0})
    assert sorted(p.mean_ticks) == [0.0] * (RATES - 1) + [pytest.approx(1 / (1000 * TICK))]
    r = Interference()
    start_interference(p, r, seed=5)
    seconds = 2.0
    while r.next_tick * TICK < seconds:
        interfere(p, r, r.next_tick)
    assert getattr(r, counter) == pytest.approx(1000 * seconds, rel=0.1)
    counters = {name: getattr(r, name) for name in ("remove", "lose_sample", "corrupted", "inserted")}
    assert [name for name, count in counters.items() if count] == [counter]


def test_a_burst_is_evenly_spaced_from_its_first_moment():
    p = burst(at=5e-3, count=4)
    assert [p.tick[k] for k in range(p.entries)] == [20000, 20096, 20192, 20288]
    assert {p.kind[k] for k in range(p.entries)} == {KINDS["+"]}


def test_a_burst_may_begin_with_the_run():
    assert burst(at=0.0).tick[0] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_listed_ticks_are_taken_as_they_are(kind):
    p = burst(kind=kind, ticks=[0, 7, 2**53])
    assert [p.tick[k] for k in range(p.entries)] == [0, 7, 2**53]
    assert {p.kind[k] for k in range(p.entries)} == {KINDS[kind]}


def test_the_longest_list_fits():
    p = burst(at=0.0, count=ENTRIES)
    assert p.entries == ENTRIES
    assert burst(ticks=list(range(ENTRIES))).tick[ENTRIES - 1] == ENTRIES - 1


def test_a_push_lasts_from_its_first_tick_to_its_last():
    push = Push()
    fill_push(push, PushTable.model_construct(force=-3.0, at=1e-3, duration=5e-4), TICK)
    assert (push.force, push.begin, push.end) == (-3.0, 4000, 6000)
    assert [push_force(push, tick) for tick in (3999, 4000, 5999, 6000)] == [0.0, -3.0, -3.0, 0.0]


def test_no_push_is_no_force():
    push = Push()
    fill_push(push, None, TICK)
    assert push_force(push, 0) == 0.0


@pytest.mark.parametrize("moment", ["ticks = [0, 7]", 'at = "5 ms"\ncount = 3\nspacing = "1 ms"', 'at = "0 s"'])
@pytest.mark.parametrize("kind", KINDS)
def test_a_burst_is_written_back_as_it_was_read(good_servo_text, load_text, kind, moment):
    text = f'{good_servo_text}\n[disturbance.lines.burst]\nkind = "{kind}"\n{moment}\n'
    spec = load_text(text).spec
    assert spec.disturbance.lines.burst.kind == kind
    assert load_text(dump_spec(spec)).spec == spec


@pytest.fixture(params=["phase_servo", "filtered_servo"])
def good_servo_text(request):
    from importlib.resources import files

    return files("detent").joinpath(f"examples/{request.param}.toml").read_text(encoding="utf-8")
