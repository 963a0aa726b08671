"""What the numbers of signals tell before anything is fitted: what is refused, and what is not."""

import numpy as np
import pytest
from tests.identify_rig import Recorder, make_log

from detent.identify.fit.equations import make_run
from detent.identify.fit.identification import identify
from detent.identify.fit.signals import held_rows, look_at_log, scale_off
from detent.logs.log import Action, Finding, Kind, Severity


def told(refusals):
    return [(r.subject, r.constants) for r in refusals]


def log_with(*findings, force=None):
    t, _, position, made = Recorder(seconds=2.0).columns()
    return make_log(t, {"position": position, "force": made if force is None else force}, findings=findings)


def look(*findings, force=None):
    log = log_with(*findings, force=force)
    return [*look_at_log(log, make_run(log))]


def finding(kind, signal="force", rows=(), severity=Severity.ERROR, advice=""):
    return Finding(kind, signal, tuple(rows), "points the other way", Action.LEFT, advice, severity)


def test_a_clean_log_is_not_refused():
    assert look() == []


@pytest.mark.parametrize(
    ("kind", "subject", "advice"),
    [
        (Kind.WRONG_SIGN, "wrong sign", "invert the signal in the mapping, as in force=-COLUMN"),
        (Kind.WRONG_UNIT, "wrong unit", "state the unit of the column in the mapping"),
        (Kind.LOST_SIGN, "lost sign", "record the signal with its sign"),
    ],
)
def test_signals_that_contradict_each_other_are_refused(kind, subject, advice):
    (found,) = look(finding(kind))
    assert (found.subject, found.record, found.constants) == (subject, advice, ())
    assert found.text == "made.csv: force points the other way"
    assert str(found) == f"refused: all constants: {subject}: made.csv: force points the other way; try: {advice}"
    (own,) = look(finding(kind, advice="do something else"))
    assert own.record == "do something else"
    assert look(finding(kind, severity=Severity.NOTE)) == []


def test_what_the_import_mended_is_not_refused():
    for kind in (Kind.SHIFTED, Kind.WRAPPED_COUNTER, Kind.DUPLICATED_ROWS):
        assert look(finding(kind, "position", [(1, 900)])) == []


@pytest.mark.parametrize(("rows", "refused"), [(40, False), (60, True)])
def test_a_stuck_signal_is_refused_beyond_five_per_cent(rows, refused):
    found = look(finding(Kind.STUCK, "position", [(101, 100 + rows)]))
    assert bool(found) is refused
    if refused:
        assert found[0].subject == "stuck signal"
        assert "is at standstill in 6% of the rows" in found[0].text
        assert found[0].record == "check the sensor and its cable, and record again"
    assert look(finding(Kind.STUCK, "temperature", [(1, 1000)])) == []


def test_an_effort_whose_small_values_are_gone_is_refused():
    """A threshold of the recorder; levels of a converter, and zeros of a drive that is off, are none."""
    _, _, _, force = Recorder(seconds=2.0).columns()
    least = 0.3 * float(np.sqrt(np.mean(force**2)))
    (refusal,) = look(force=np.where(np.abs(force) < least, 0.0, force))
    assert refusal.subject == "small values are gone"
    assert look(force=least * np.round(force / least)) == []
    off = np.where(np.arange(len(force)) < 0.02 * len(force), 0.0, force)
    assert look(force=off) == []


def test_the_age_of_a_signal_that_is_held_is_not_known():
    """Updated in every 5th row; in each; in steps of a second, which excite; in none of these orders."""
    force = Recorder(seconds=2.0).columns()[3]
    k = np.arange(len(force))
    (refusal,) = look(force=force[k // 5 * 5])
    assert refusal.constants == ("delay",)
    assert "force changes every 5 rows only" in refusal.text
    assert [held_rows(force[rows]) for rows in (k, k // 5 * 5, k // 3 * 3, k - k % (2 + k // 50 % 2))] == [1, 5, 3, 1]
    assert look(force=force[k // 200 * 200]) == []


def test_a_position_that_straight_lines_were_drawn_in():
    log = log_with()
    position = log.signals["position"]
    k = np.arange(len(position))
    drawn = make_log(log.t, log.signals | {"position": np.interp(k, k[::5], position[::5])})
    (refusal,) = look_at_log(drawn, make_run(drawn))
    assert (refusal.subject, refusal.constants) == ("coarse time", ("delay",))
    assert "the way from row to row changes every 5 rows only" in refusal.text


def with_position(change, seconds=8.0):
    t, reference, position, force = Recorder(seconds=seconds).columns()
    log = make_log(t, {"position": change(position), "reference": reference, "force": force})
    return [r.subject for r in look_at_log(log, make_run(log))]


def test_a_position_that_leaves_its_reference_is_not_that_of_the_loop():
    """Counts lost one way, a zero that creeps, a scale that is another from the middle on."""

    def lost(position):
        ways = np.diff(position, prepend=position[0])
        return position[0] + np.cumsum(np.where(ways > 0.0, 0.98 * ways, ways))

    def creeping(position):
        return position + 0.05 * np.ptp(position) * np.linspace(0.0, 1.0, len(position))

    def scaled(position):
        ways = np.diff(position, prepend=position[0])
        return position[0] + np.cumsum(np.where(np.arange(len(ways)) > len(ways) // 2, 1.1 * ways, ways))

    for change in (lost, creeping, scaled):
        assert with_position(change) == ["position leaves its reference"], change
    # What a loop does all along: it stays behind, overshoots, or goes a part of the way.
    for follows in (lambda q: q, lambda q: np.r_[np.full(30, q[0]), q[:-30]], lambda q: 0.7 * q, lambda q: 1.03 * q):
        assert with_position(follows) == []


def test_a_position_that_stays_behind_its_reference_is_refused():
    log = log_with()
    reference = Recorder(seconds=2.0).columns()[1]
    stands = log.signals["position"].copy()
    assert [*look_at_log(log, make_run(log))] == []
    for first, subjects in ((800, []), (250, ["stuck signal"])):
        stands[first:] = stands[first]
        cut = make_log(log.t, log.signals | {"position": stands, "reference": reference})
        found = [*look_at_log(cut, make_run(cut))]
        assert [r.subject for r in found] == subjects
    assert "of its travel while the position does not change" in found[0].text
    assert found[0].record == "check the encoder, its cable and the drive enable, and record again"


@pytest.mark.parametrize(("rows", "refused"), [(290, False), (310, True)])
def test_saturation_is_refused_beyond_thirty_per_cent(rows, refused):
    found = look(finding(Kind.SATURATED, "force", [(1, rows)]))
    assert bool(found) is refused
    if refused:
        assert found[0].subject == "saturated"
        assert found[0].text == "made.csv: force or position is at its limit in 31% of the rows"
        assert found[0].record == "record slower or smaller moves that stay within the limit"


def test_an_effort_between_two_limits_is_saturated_though_nobody_said_so():
    force = np.clip(Recorder(seconds=2.0).columns()[3], -1.5, 1.5)
    assert told(look(force=force)) == [("saturated", ())]
    assert told(look(force=np.zeros(1000))) == [("saturated", ())]


# -- forms that an effort has from its recorder -------------------------------------------------------------


def effort(seconds=8.0):
    return Recorder(seconds=seconds).columns()[3]


def subjects(force):
    t, _, position, _ = Recorder(seconds=len(force) * 0.002).columns()
    log = make_log(t, {"position": position, "force": force})
    return [r.subject for r in look_at_log(log, make_run(log))]


def reported(force, band):
    """An effort that is written anew where it has left the last number by a band."""
    found = [float(force[0])]
    for value in force[1:].tolist():
        found.append(value if abs(value - found[-1]) > band else found[-1])
    return np.array(found)


def played(force, band):
    """An effort that follows through a play of a width."""
    found = [float(force[0])]
    for value in force[1:].tolist():
        found.append(min(max(found[-1], value - band), value + band))
    return np.array(found)


def test_an_effort_that_is_written_only_where_it_has_changed():
    """As a recorder with a band does, and a sensor with hysteresis; not a converter, a command, an even update."""
    force, k = effort(), np.arange(4000)
    size = float(np.sqrt(np.mean(force**2)))
    for change in (played(force, 0.05 * size), reported(force, 0.02 * size)):
        assert subjects(change) == ["effort is held"]
    for change in (
        force,
        0.05 * size * np.round(force / (0.05 * size)),
        np.repeat(force[::200], 200),
        np.clip(force, -1.5 * size, 1.5 * size),
    ):
        assert "effort is held" not in subjects(change)
    # Rows that come in pairs and threes, as two clocks make them, are late, but no peaks are missing.
    assert "effort is held" not in subjects(force[k - k % (2 + k // 50 % 2)])


def test_the_size_of_an_effort_with_the_sign_of_another_moment():
    force = effort()
    assert subjects(np.abs(force) * np.sign(np.r_[force[:20], force[:-20]])) == []  # too few turns to tell
    _, v, a = Recorder().motion(np.arange(16000) * 0.002)
    rng = np.random.default_rng(2)
    smooth = 8.0 * a + 3.0 * v + 0.002 * rng.standard_normal(len(a))
    assert subjects(smooth) == []
    late = np.abs(smooth) * np.sign(np.r_[smooth[:20], smooth[:-20]])
    assert subjects(late) == ["sign of another moment"]
    # Friction that is fed forward turns with the motion; a square wave of many heights is flat.
    assert subjects(3.0 * np.sign(v) + 0.3 * a + 0.002 * rng.standard_normal(len(a))) == []
    heights = np.repeat(np.tile([1.0, -1.0, 2.0, -2.0, 3.0, -3.0], 14), 190)
    assert "sign of another moment" not in subjects(heights + 0.02 * rng.standard_normal(len(heights)))


def test_an_effort_of_which_an_archive_kept_few_rows():
    """Lines of many slopes; a triangle has two, and levels of a converter are none."""
    force, k = effort(), np.arange(4000)
    rng = np.random.default_rng(6)
    kept = np.unique(np.r_[0, np.cumsum(rng.integers(5, 60, 200))])
    kept = kept[kept < len(k)]
    assert subjects(np.interp(k, kept, force[kept])) == ["lines were drawn"]
    for change in (force, np.abs(k % 200 - 100.0) - 50.0, np.round(force, 1), np.round(3.0 * np.sin(k / 90.0), 2)):
        assert "lines were drawn" not in subjects(change)


def test_an_effort_that_cannot_change_faster():
    """Kept to a slope; a command of straight lines is none, nor one of steps."""
    force = effort() + 0.5 * np.random.default_rng(3).standard_normal(4000)
    place, kept = float(force[0]), []
    for value in force.tolist():
        place += min(max(value - place, -0.2), 0.2)
        kept.append(place)
    assert subjects(np.array(kept)) == ["saturated"]
    assert "changes as fast as it ever does" in look(force=np.array(kept[:1000]))[0].text
    k = np.arange(4000)
    for command in (np.abs(k % 800 - 400.0) - 200.0, 50.0 * np.sign(np.sin(k / 40.0)), force):
        assert "saturated" not in subjects(command)


# -- the scale of a position ----------------------------------------------------------------------------------


def test_the_scale_of_a_position_is_known_as_well_as_it_goes_where_it_is_asked_to():
    t, reference, position, force = Recorder(seconds=8.0, position_noise=1e-6).columns()

    def found(factor):
        log = make_log(t, {"position": factor * position, "reference": reference, "force": force})
        return [c.amplitude for c in scale_off([make_run(log)])], identify([log])

    none, right = found(1.0)
    assert none == []
    for factor in (0.95, 1.04):
        (off,), wrong = found(factor)
        assert off == pytest.approx(abs(factor - 1.0), abs=0.002)
        by_name = {e.name: e for e in right.estimates}
        assert "mass" in {e.name for e in wrong.trusted}
        for e in wrong.trusted:
            assert e.low < by_name[e.name].value < e.high
    # A loop that is soft goes a part of the way: what it is given is no measure of its sensor.
    assert found(0.6)[0] == []
    assert scale_off([make_run(make_log(t, {"position": position, "force": force}))]) == []
