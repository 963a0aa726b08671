import math
from dataclasses import replace

import numpy as np
import pytest
from tests.page_reader import Reader
from tests.unit.methods.rotary_table.samples import angle_comparison, deg, record, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.rotary_table.page import make_table_page
from detent.methods.rotary_table.page_data import Signal, TableReportData, TurnDetail
from detent.methods.rotary_table.report import NEEDED_DETAIL, NEEDED_PATH, sequence_report
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, SequenceRun, run_sequence
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_job import Go, Jog, Output, SequenceJob, Step, Wait
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.page.page import render_page
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[RotaryTableSpec, SequenceRun, Trace]

PLAIN = ('drive.droop="0 %"', 'mechanics.start_angle="100 deg"')
"""The plant of the specification's walks: no droop, from 100 degrees."""

AS_COMMANDED = tuple(f'position.{n}.direction="as commanded"' for n in range(5))


def play(*steps: Step, overrides: tuple[str, ...] = PLAIN, **inputs: tuple[tuple[float, float], ...]) -> Played:
    spec = load_spec(detent.example("rotary_table.toml"), overrides)
    assert isinstance(spec, RotaryTableSpec)
    recorder = Recorder(RotaryTable, SEQUENCE_SIGNALS, every=20, period=TICK)
    run = run_sequence(spec, SequenceJob("shop.toml", steps, inputs), recorder=recorder)
    return spec, run, recorder.trace()


def detail_of(played: Played) -> TurnDetail:
    detail = sequence_report(*played).detail
    assert detail
    return detail


def jog(sign: int, duration: float, speed: float = 60.0) -> Jog:
    return Jog(sign, deg(speed), duration=duration)


@pytest.fixture(scope="module")
def forward() -> Played:
    """To larger angles for 13 s, from 100 degrees: specification test 5."""
    return play(jog(1, 13.0))


@pytest.fixture(scope="module")
def mixed() -> Played:
    """A positioning over the end of the turn, an output, a jog that waits for its signal."""
    return play(
        Go(4), Output("clamp", on=True), Wait(0.2), Go(3), Output("clamp", on=False), Jog(1, deg(5), signal="feed"),
        Output("lamp", on=True), feed=((4.0, 5.0), (6.0, 6.5)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def report(mixed: Played) -> TableReportData:
    return sequence_report(*mixed, comparison=angle_comparison(), settings={"seed": "3"})


# ---- the whole sequence


def test_the_report_is_of_this_run(mixed: Played, report: TableReportData) -> None:
    spec, run, _ = mixed
    assert (report.axis_name, report.job_name, report.done, report.failure) == (spec.axis.name, "shop.toml", True, "")
    assert (report.count, report.in_position, report.max_speed) == (spec.count, 2 * spec.count, spec.limits.speed)
    assert (report.figures.asked, report.figures.made, report.figures.jogs) == (7, 7, 1)
    assert report.comparison is not None
    assert report.settings == {"seed": "3"}
    assert [step.text for step in report.steps] == [step.text for step in run.steps]
    first = run.steps[0]
    assert report.steps[0].begin == 0.0
    assert report.steps[0].end == pytest.approx(first.end - run.time_ready)
    assert report.steps[0].travel == pytest.approx(first.travel)
    assert report.steps[0].offset == -first.error
    assert math.isnan(report.steps[1].offset)


def test_signals_are_on_between_their_changes_and_up_to_the_end(mixed: Played, report: TableReportData) -> None:
    _, run, _ = mixed
    clamp, lamp = report.outputs
    assert (clamp.name, len(clamp.spans)) == ("clamp", 1)
    assert clamp.spans[0] == pytest.approx((report.steps[1].begin, report.steps[4].begin))
    assert lamp == Signal("lamp", [(run.time_end - run.time_ready, run.time_end - run.time_ready)])
    (feed,) = report.inputs
    assert feed.spans[0] == pytest.approx((4.0, 5.0))
    assert len(feed.spans) == 1  # the second stretch came after the end


def test_a_signal_that_stays_on_is_on_up_to_the_end() -> None:
    changes = [
        (0.6, "a", False),
        (0.7, "a", True),
        (0.9, "b", True),
        (1.0, "b", False),
        (1.1, "a", True),
        (1.5, "b", True),
    ]
    run = run_of(record(1), outputs=changes)
    found = sequence_report(load_spec(detent.example("rotary_table.toml")), run, None).outputs
    assert {signal.name: [tuple(round(t, 9) for t in span) for span in signal.spans] for signal in found} == {
        "a": [(0.2, 2.0)], "b": [(0.4, 0.5), (1.0, 2.0)],
    }  # fmt: skip


def test_the_path_is_where_the_table_truly_was(mixed: Played, report: TableReportData) -> None:
    spec, run, _ = mixed
    path = report.path
    assert path
    for step in run.steps:
        at = int(np.searchsorted(path.t, step.end - run.time_ready))
        # The row shows the strobe before it.
        assert path.angle[min(at + 1, len(path.t) - 1)] == pytest.approx(step.stop, abs=3 * spec.count)
    apart = (path.detected - path.angle + math.pi) % math.tau - math.pi
    assert np.abs(apart).max() < 2 * spec.count
    assert 0 <= path.detected.min() < path.detected.max() < math.tau
    assert np.abs(np.gradient(path.angle, path.t) - path.velocity).max() < deg(3)
    assert np.abs(path.velocity_ref).max() == pytest.approx(deg(60), rel=1e-4)
    assert set(np.sign(path.velocity_ref[np.abs(path.velocity_ref) > 0])) == {1.0, -1.0}


def test_the_target_is_drawn_while_a_positioning_is_under_way(mixed: Played, report: TableReportData) -> None:
    _, run, _ = mixed
    path = report.path
    assert path
    going = np.zeros(len(path.t), dtype=bool)
    for step in run.steps:
        inside = (path.t > step.begin - run.time_ready) & (path.t < step.end - run.time_ready)
        if step.kind == "go":
            assert set(path.target[inside]) == {step.target}
            going |= inside
    assert not np.isfinite(path.target[~going]).sum() > 2


@pytest.mark.parametrize("start", ["-10 deg", "350 deg"])
def test_the_path_counts_its_turns_as_the_steps_do(start: str) -> None:
    spec, run, trace = played = play(Go(1), overrides=(f'mechanics.start_angle="{start}"',))
    path = sequence_report(*played).path
    assert path
    assert path.angle[0] == pytest.approx(run.steps[0].start, abs=3 * spec.count)
    assert path.angle[-1] == pytest.approx(run.steps[0].stop, abs=3 * spec.count)
    assert len(path.t) == len(trace)


# ---- one step


def test_the_walk_forward_is_that_of_the_specification(forward: Played) -> None:
    detail = detail_of(forward)
    assert (detail.number, detail.kind, detail.form, detail.failed) == (1, "jog", "turn counter", False)
    assert (detail.crossings, detail.rollovers) == (2, 2)
    # t, D, n, R, C of the points P0, P1, P2, P3, P5, P2 (rotary-table specification, test 5).
    walk = [(0.0, 100, 0, 100, 100), (2.0, 212, 0, 212, 214), (4.47, 0.3, 1, 360.3, 362.3),
            (6.095, 97.8, 1, 457.8, 459.8), (6.105, 98.3, 0, 98.3, 100.3), (10.47, 0.3, 1, 360.3, 362.3)]  # fmt: skip
    for t, detected, turns, present, command in walk:
        row = int(np.searchsorted(detail.t, t))
        shown = [np.degrees(values[row]) for values in (detail.detected, detail.present, detail.command)]
        assert shown == pytest.approx([detected, present, command], abs=0.5)
        assert detail.turns[row] == detail.flag[row] == turns
        assert np.degrees(detail.target[row]) == pytest.approx(820, abs=0.01)
        assert np.degrees(detail.threshold[row]) == pytest.approx(460, abs=0.01)
    steady = (detail.t > 0.5) & (detail.t < 12.9)
    assert np.degrees(detail.deviation[steady]) == pytest.approx(2.0, abs=0.005)
    # The word of 12 bits has steps of 0.065 deg/s.
    assert np.degrees(detail.speed_signal[steady]) == pytest.approx(60.0, abs=0.1)
    assert np.degrees(detail.velocity[steady]) == pytest.approx(60.0, abs=0.1)


def test_the_walk_backward_mirrors_it() -> None:
    detail = detail_of(play(jog(-1, 7.0)))
    row = int(np.searchsorted(detail.t, 3.0))
    assert np.degrees(detail.target[row]) == pytest.approx(-620, abs=0.01)
    assert np.degrees(detail.threshold[row]) == pytest.approx(-260, abs=0.01)
    assert (detail.turns[row], detail.flag[row]) == (-1, 1)
    steady = (detail.t > 0.5) & (detail.t < 6.9)
    assert np.degrees(detail.deviation[steady]) == pytest.approx(2.0, abs=0.005)  # positive where the table lags
    texts = [event.text for event in detail.events]
    assert texts[0] == "\u2212 button: the target M is set two turns ahead of D, at \u2212620\u202fdeg; n = 0"
    assert texts[1] == "the table crosses the end of its turn: D jumps from 0 to 360\u202fdeg; n = \u22121"


def test_what_happens_in_a_jog_is_told_in_order(forward: Played) -> None:
    events = detail_of(forward).events
    assert [event.t for event in events] == pytest.approx([0.0, 4.464, 6.1, 10.464, 12.1, 13.0, 13.2], abs=0.021)
    assert [event.text for event in events] == [
        "+ button: the target M is set two turns ahead of D, at 820\u202fdeg; n = 0",
        "the table crosses the end of its turn: D jumps from 360 to 0\u202fdeg; n = 1",
        "less than one turn remains to M: rollover, R and C go back by one turn; the deviation stays 2.000\u202fdeg",
        "the table crosses the end of its turn: D jumps from 360 to 0\u202fdeg; n = 1",
        "less than one turn remains to M: rollover, R and C go back by one turn; the deviation stays 2.000\u202fdeg",
        "button released: M comes to where the table can stop",
        "at rest: M, R and C come back to within one turn, where the table is held",
    ]


def test_a_jog_of_many_turns_is_shown_as_far_as_its_second_rollover() -> None:
    detail = detail_of(play(jog(1, 40.0)))
    assert detail.rollovers == 2
    assert 12.1 < detail.t[-1] < 14.0
    assert "released" not in " ".join(event.text for event in detail.events)


def test_a_jog_that_waits_for_its_signal_is_shown_from_where_it_moves(mixed: Played) -> None:
    spec, run, trace = mixed
    jogs = replace(run, steps=[run.steps[5]])
    detail = detail_of((spec, jogs, trace))
    assert detail.t[0] == pytest.approx(-0.1, abs=0.003)
    assert detail.t[-1] < 1.4  # a second of jog, its stop, and a little after
    assert np.isnan(detail.target[detail.t < 0]).all()
    # After the release M is where the table stops: nothing to roll over at.
    assert np.isnan(detail.threshold[-1])


def test_without_a_jog_over_the_end_a_positioning_is_shown(mixed: Played) -> None:
    detail = detail_of(mixed)
    assert (detail.number, detail.kind) == (4, "go")
    assert detail.why == "the longest positioning that crosses the end of the turn"
    # From 10 to 350 degrees by the short way: M is beyond the end.
    assert np.degrees(detail.target[len(detail.t) // 2]) == pytest.approx(-10, abs=0.01)
    assert (detail.crossings, detail.rollovers) == (1, 0)
    assert np.isnan(detail.threshold).all()
    assert detail.events[0].text == "the position is taken: the target M is set at \u221210\u202fdeg"


@pytest.mark.parametrize(
    ("steps", "number", "why"),
    [
        ((Go(1), Go(2)), 2, "the longest positioning; none crosses the end of a turn"),
        ((Go(1), jog(1, 1.0), jog(-1, 0.5)), 2, "the longest jog; none came as far as the end of the turn"),
        ((Go(3), jog(1, 1.0), Go(4), jog(-1, 0.3)), 2, "the jog that crosses the end of the turn most often"),
    ],
)
def test_the_most_telling_step_is_shown(steps: tuple[Step, ...], number: int, why: str) -> None:
    detail = detail_of(play(*steps))
    assert (detail.number, detail.why) == (number, why)


def test_a_sequence_without_motion_has_no_detail() -> None:
    assert sequence_report(*play(Wait(0.5))).detail is None


def test_a_table_that_dithers_at_the_end_of_its_turn_marks_few_crossings() -> None:
    spec, run, trace = play(Go(1), Go(0), Wait(0.3))
    zero = np.where(np.arange(len(trace)) % 2 > 0, 0, spec.period - 1)
    dithering = Trace(columns={name: trace[name] for name in trace} | {"positioner.angle.dar": zero})
    events = detail_of((spec, run, dithering)).events
    assert sum("crosses" in event.text for event in events) == 6
    assert min(event.t for event in events) == 0.0


# ---- what went wrong


def test_the_step_that_failed_is_shown_and_a_jog_that_broke_off_has_no_target() -> None:
    played = play(Go(1), jog(1, 30.0), Go(2), overrides=('method.form="raw"', *AS_COMMANDED))
    data = sequence_report(*played)
    detail = data.detail
    assert detail
    assert not data.done
    assert (detail.number, detail.why, detail.failed, detail.form) == (2, "the step that failed", True, "raw")
    assert np.degrees(np.abs(detail.deviation).max()) > 300
    assert detail.events[1].text.endswith("D jumps from 360 to 0\u202fdeg")
    assert math.isnan(data.steps[1].offset)
    text = Reader(render_page(make_table_page(data))).text
    assert "Not done" in text
    assert "Stopped after 1 of 3 steps" in text


def test_a_flag_that_throws_the_table_back_is_told_by_its_deviation() -> None:
    overrides = ('method.form="flag"', 'mechanics.start_angle="0.5 deg"', *AS_COMMANDED)
    detail = detail_of(play(jog(1, 8.0), overrides=overrides))
    rollover = next(event for event in detail.events if "rollover" in event.text)
    assert "the deviation jumps from 2" in rollover.text
    assert rollover.text.endswith("\u202fdeg")


def test_a_flag_is_told_where_the_axis_has_one() -> None:
    detail = detail_of(play(jog(1, 5.0), overrides=(*PLAIN, 'method.form="flag"', *AS_COMMANDED)))
    assert detail.events[1].text == "the table crosses the end of its turn: D jumps from 360 to 0\u202fdeg; FLG on"
    assert detail.events[-1].text == "at rest: the table is held"


def test_warnings_are_notes() -> None:
    run = run_of(record(1), warnings=["the table did not move"])
    (note,) = sequence_report(load_spec(detent.example("rotary_table.toml")), run, None).notes
    assert (note.level, note.text) == ("warning", "the table did not move")


# ---- less than a whole trace


@pytest.mark.parametrize("left_out", sorted({*NEEDED_PATH, *NEEDED_DETAIL}))
def test_a_trace_without_a_needed_signal_gives_a_report_without_its_figures(forward: Played, left_out: str) -> None:
    spec, run, trace = forward
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    data = sequence_report(spec, run, part)
    assert (data.path is None) == (left_out in NEEDED_PATH)
    assert (data.detail is None) == (left_out in NEEDED_DETAIL)
    assert data.steps


def test_without_a_trace_the_figures_over_time_are_left_out(mixed: Played) -> None:
    data = sequence_report(mixed[0], mixed[1], None)
    assert (data.path, data.detail, data.comparison, data.settings) == (None, None, None, {})
    assert "Done" in Reader(render_page(make_table_page(data))).text


def test_of_a_trace_that_ends_early_what_it_holds_is_shown(mixed: Played) -> None:
    spec, run, trace = mixed
    early = sequence_report(spec, run, trace.between(0.0, run.steps[0].end))
    assert early.detail
    assert early.detail.number == 1
    assert early.path
    assert early.path.t[-1] < run.steps[0].end
    assert sequence_report(spec, run, trace.between(0.0, 0.01)).path is None
    assert sequence_report(spec, run, trace.between(0.0, 0.03)).detail is None


def test_a_run_without_a_step_has_no_figures_over_time(mixed: Played) -> None:
    data = sequence_report(mixed[0], run_of(asked=2, failure="never ready"), mixed[2])
    assert (data.path, data.detail, data.steps) == (None, None, [])
    assert "Not done" in Reader(render_page(make_table_page(data))).text
