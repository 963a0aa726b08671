"""Logs on even grids: gaps, uneven stamps, saturated rows and what drives the axis."""

import numpy as np
import pytest
from tests.identify_rig import make_log

from detent.errors import InputError
from detent.identify.fit.equations import find_count, make_run, noise_of
from detent.logs.headings import EFFORTS
from detent.logs.log import Action, Finding, Kind

T = np.arange(1000) * 1e-3
POSITION = 0.1 * np.sin(5 * T)
FORCE = np.cos(5 * T)


def finding(kind, signal, *rows):
    return Finding(kind, signal, rows, "", Action.LEFT)


def test_an_even_log_is_taken_as_it_is():
    run = make_run(make_log(T + 12.5, {"position": POSITION, "force": FORCE, "reference": 2 * POSITION}))
    assert run.step == pytest.approx(1e-3)
    assert run.position == pytest.approx(POSITION)
    assert run.effort == pytest.approx(FORCE)
    assert run.reference == pytest.approx(2 * POSITION)
    assert run.usable.all()
    assert run.t == pytest.approx(T)
    assert (run.name, run.effort_name, run.effort_unit, run.position_unit) == ("made.csv", "force", "N", "m")
    assert not run.is_rotary


def test_a_gap_is_bridged_and_not_used():
    keep = np.r_[0:400, 450:1000]
    run = make_run(make_log(T[keep], {"position": POSITION[keep], "force": FORCE[keep]}))
    assert len(run.position) == 1000
    assert not run.usable[401:449].any()
    assert run.usable[:400].all()
    assert run.usable[450:].all()
    # A straight line bridges the positions; the effort stands until the next sample.
    assert run.position[425] == pytest.approx(np.interp(425, [399, 450], POSITION[[399, 450]]), rel=1e-9)
    assert run.effort[425] == FORCE[399]
    assert run.effort[450:] == pytest.approx(FORCE[450:])


def test_uneven_stamps_come_onto_the_grid():
    t = T + np.random.default_rng(1).uniform(-3e-4, 3e-4, 1000)
    run = make_run(make_log(t, {"position": 0.1 * np.sin(5 * t), "force": np.cos(5 * t)}))
    grid = t[0] + run.t
    inner = slice(1, len(grid) - 1)
    assert run.position[inner] == pytest.approx(0.1 * np.sin(5 * grid[inner]), abs=1e-6)
    # A held signal is at most a stretch old.
    assert run.effort[inner] == pytest.approx(np.cos(5 * grid[inner]), abs=5 * 2e-3)
    assert run.usable.mean() > 0.99


def test_a_held_effort_changes_where_its_sample_lies():
    t = T.copy()
    t[500:] += 0.4e-3
    effort = np.where(np.arange(1000) < 500, 0.0, 1.0)
    run = make_run(make_log(t, {"position": POSITION, "force": effort}))
    change = int(np.argmax(run.effort > 0))
    assert change == 501
    assert run.t[change] >= t[500]


@pytest.mark.parametrize(
    ("kind", "signal", "counts"),
    [
        (Kind.SATURATED, "force", True),
        (Kind.SATURATED, "position", True),
        (Kind.SATURATED, "current", False),
        (Kind.MISSING_VALUES, "force", True),
        (Kind.STUCK, "position", True),
        (Kind.SHIFTED, "force", False),
    ],
)
def test_rows_that_mean_nothing_are_not_used(kind, signal, counts):
    signals = {"position": POSITION, "force": FORCE, "current": FORCE}
    log = make_log(T, signals, {"current": "A"}, (finding(kind, signal, (101, 150), (301, 301)),))
    run = make_run(log)
    expected = np.ones(1000, bool)
    if counts:
        expected[100:150] = expected[300] = False  # rows are counted from 1
    assert (run.usable == expected).all()


def test_a_winding_that_is_switched_off_is_another_axis():
    on = np.where((T > 0.3) & (T < 0.6), 0.0, 1.0)
    signals = {"position": POSITION, "voltage": FORCE, "enabled": on}
    assert (make_run(make_log(T, signals)).usable == (on > 0)).all()
    assert make_run(make_log(T, {"position": POSITION, "force": FORCE, "enabled": on})).usable.all()


def test_the_effort_nearest_to_the_mechanics_is_taken():
    signals = {name: (k + 1) * FORCE for k, name in enumerate(EFFORTS)} | {"position": POSITION}
    units = {"current": "A", "voltage": "V", "command": ""}
    for k, name in enumerate(EFFORTS):
        log = make_log(T, dict(list(signals.items())[k:]), units)
        assert make_run(log).effort_name == name
    run = make_run(make_log(T, signals, units), "voltage")
    assert run.effort == pytest.approx(4 * FORCE)
    assert make_run(make_log(T, signals, units), "command").effort_unit == "1"


def test_units_of_constants_follow_effort_and_position():
    run = make_run(make_log(T, {"position": POSITION, "force": FORCE}))
    assert [run.unit(n) for n in ("mass", "coulomb.positive", "viscous", "delay", "spring", "stribeck", "loss")] == [
        "kg", "N", "N*s/m", "s", "N/m", "m/s", "1",
    ]  # fmt: skip
    run = make_run(make_log(T, {"position": POSITION, "voltage": FORCE}, {"position": "rad"}))
    assert run.is_rotary
    assert [run.unit(n) for n in ("mass", "viscous.negative", "pendulum", "stribeck")] == [
        "V*s^2/rad", "V*s/rad", "V", "rad/s",
    ]  # fmt: skip
    run = make_run(make_log(T, {"position": POSITION, "command": FORCE}, {"position": "count"}))
    assert [run.unit(n) for n in ("mass", "viscous", "coulomb.negative")] == ["s^2/count", "s/count", "1"]


def test_a_part_holds_all_signals():
    run = make_run(make_log(T, {"position": POSITION, "force": FORCE, "reference": FORCE}))
    part = run.part(100, 300)
    assert part.position == pytest.approx(POSITION[100:300])
    assert part.effort == pytest.approx(FORCE[100:300])
    assert part.reference == pytest.approx(FORCE[100:300])
    assert len(part.usable) == 200
    assert part.t[0] == 0.0


def test_the_way_of_a_count_is_found():
    fine = 0.1 * np.sin(np.arange(5000) * 1e-3)
    assert find_count(2e-6 * np.rint(fine / 2e-6)) == pytest.approx(2e-6, rel=1e-6)
    assert find_count(1e-4 * np.rint(fine / 1e-4)) == pytest.approx(1e-4, rel=1e-6)
    assert find_count(fine) == 0.0
    assert find_count(np.zeros(5000)) == 0.0
    assert find_count(np.arange(4.0)) == 0.0


def test_the_noise_of_a_position_is_what_is_not_smooth():
    rng = np.random.default_rng(2)
    smooth = 0.1 * np.sin(np.arange(5000) * 5e-3)
    assert noise_of(smooth + 1e-4 * rng.standard_normal(5000)) == pytest.approx(1e-4, rel=0.05)
    assert noise_of(smooth) < 1e-8
    assert noise_of(smooth[:3]) == 0.0


def test_counts_are_noise_at_least():
    counts = 1e-3 * np.rint(POSITION / 1e-3)
    run = make_run(make_log(T, {"position": counts, "force": FORCE}))
    assert run.resolution == pytest.approx(1e-3, rel=1e-6)
    assert run.noise >= 0.29e-3


def refused(signals, effort=None, t=T) -> str:
    with pytest.raises(InputError) as error:
        make_run(make_log(t, signals), effort)
    return str(error.value)


def test_what_cannot_be_identified_is_said_with_what_to_do():
    text = refused({"force": FORCE})
    assert "signals force" in text
    assert "a recording with position" in text
    assert "try: name the column: position=COLUMN [UNIT]" in text
    text = refused({"position": POSITION, "reference": POSITION})
    assert "force, torque, current, voltage, command" in text
    assert "try: name its column: force=COLUMN [UNIT]" in text
    text = refused({"position": POSITION, "force": FORCE}, "voltage")
    assert "expected: voltage that drives the axis" in text
    assert "try: name its column: voltage=COLUMN [UNIT]" in text
    text = refused({"position": POSITION[:19], "force": FORCE[:19]}, t=T[:19])
    assert "got 19 samples; expected: 20 or more; try: record a longer run" in text
