import json
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.rotary_table.samples import deg, run_of

import detent
from detent.methods.load import load_spec
from detent.methods.rotary_table import page as table_pages
from detent.methods.rotary_table.detail import FAILED, NEEDED, step_section, telling
from detent.methods.rotary_table.page import table_page
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, SequenceRun, run_sequence
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_job import Go, Jog, Output, SequenceJob, Step, Wait
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.page.figure import Figure
from detent.page.frame import Page
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


def detail_of(played: Played) -> Figure:
    (figure,) = step_section(*played).shown
    return figure


def chart_of(part: Page | Figure, name: str) -> dict:
    return next(chart for chart in part.charts if chart["id"] == name)


def curve_of(part: Page | Figure, chart: str, label: str) -> np.ndarray:
    """Values of a curve; NaN is a gap."""
    (found,) = [one["y"] for one in chart_of(part, chart)["series"] if one["label"].startswith(label)]
    return np.array([math.nan if value is None else value for value in found])


def t_of(part: Page | Figure, chart: str = "turn-angles") -> np.ndarray:
    return np.array(chart_of(part, chart)["x"])


def texts_of(figure: Figure) -> list[str]:
    return [event.text for event in figure.events]


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


# ---- the whole sequence, as it truly was


def test_the_figures_of_a_whole_run(mixed: Played) -> None:
    page = table_page(*mixed)
    assert [chart["id"] for chart in page.charts] == [
        "line-steps", "line-turns", "line-detected", "line-speed",
        "turn-angles", "turn-count", "turn-deviation", "turn-speed",
    ]  # fmt: skip
    assert page.headline.level == "warn"  # the second stretch of an input came after the end
    assert json.loads(json.dumps(page.charts, allow_nan=False)) == page.charts


def test_signals_are_on_between_their_changes(mixed: Played) -> None:
    _, run, _ = mixed
    page = table_page(*mixed)
    lanes = {lane["label"]: lane["bars"] for lane in chart_of(page, "line-steps")["lanes"]}
    begin, end = (run.steps[k].begin - run.time_ready for k in (1, 4))
    ((clamp_on, clamp_off, *_),) = lanes["out clamp"]
    assert (clamp_on, clamp_off) == pytest.approx((begin, end), abs=1e-4)
    ((feed_on, feed_off, *_),) = lanes["in feed"]  # the second stretch came after the end
    assert (feed_on, feed_off) == pytest.approx((4.0, 5.0), abs=1e-4)
    assert lanes["out lamp"] == []  # switched on by the last step


def test_the_path_is_where_the_table_truly_was(mixed: Played) -> None:
    spec, run, _ = mixed
    page = table_page(*mixed)
    t, true = t_of(page, "line-turns"), curve_of(page, "line-turns", "true angle")
    detected, speed = curve_of(page, "line-detected", "detected"), curve_of(page, "line-speed", "true speed")
    for step in run.steps:
        at = np.interp(step.end - run.time_ready + spec.method.strobe_period, t, true)
        assert at == pytest.approx(step.stop / math.tau, abs=1e-4)
    apart = (detected - true * 360 + 180) % 360 - 180
    assert np.abs(apart).max() < 0.01
    assert 0 <= detected.min() < detected.max() < 360.005
    assert np.trapezoid(speed, t) == pytest.approx(360 * (true[-1] - true[0]), abs=0.5)
    demanded = curve_of(page, "line-speed", "commanded")
    assert np.abs(demanded).max() == pytest.approx(60, rel=1e-3)
    assert set(np.sign(demanded[np.abs(demanded) > 0])) == {1.0, -1.0}


def test_the_target_is_drawn_while_a_positioning_is_under_way(mixed: Played) -> None:
    _, run, _ = mixed
    page = table_page(*mixed)
    t, target = t_of(page, "line-turns"), curve_of(page, "line-turns", "target")
    going = np.zeros(len(t), dtype=bool)
    for step in run.steps:
        inside = (t > step.begin - run.time_ready) & (t < step.end - run.time_ready)
        if step.kind == "go":
            assert target[inside] == pytest.approx(step.target / math.tau, abs=1e-3)
            going |= inside
    assert np.isnan(target[~going]).mean() > 0.99


@pytest.mark.parametrize("start", ["100 deg", "-10 deg", "350 deg"])
def test_the_path_counts_its_turns_as_the_steps_do(start: str) -> None:
    spec, run, trace = play(Go(1), overrides=(f'mechanics.start_angle="{start}"',))
    true = curve_of(table_page(spec, run, trace), "line-turns", "true angle")
    assert true[[0, -1]] == pytest.approx(np.array([run.steps[0].start, run.steps[0].stop]) / math.tau, abs=3e-5)


# ---- one step


def test_the_walk_forward_is_that_of_the_specification(forward: Played) -> None:
    figure = detail_of(forward)
    t = t_of(figure)
    angles = [curve_of(figure, "turn-angles", label) for label in ("D detected", "R present", "C commanded")]
    # t, D, n, R, C of the points P0, P1, P2, P3, P5, P2 (rotary-table specification, test 5).
    walk = [(0.0, 100, 0, 100, 100), (2.0, 212, 0, 212, 214), (4.47, 0.3, 1, 360.3, 362.3),
            (6.095, 97.8, 1, 457.8, 459.8), (6.105, 98.3, 0, 98.3, 100.3), (10.47, 0.3, 1, 360.3, 362.3)]  # fmt: skip
    for moment, detected, turns, present, command in walk:
        row = int(np.searchsorted(t, moment, side="right")) - 1
        shown = [np.interp(moment, t, values) for values in angles]
        assert shown == pytest.approx([detected, present, command], abs=0.5)
        assert curve_of(figure, "turn-count", "turns n")[row] == turns
        assert curve_of(figure, "turn-count", "FLG")[row] == turns
        assert curve_of(figure, "turn-angles", "M target")[row] == pytest.approx(820, abs=0.01)
        assert curve_of(figure, "turn-angles", "M \u2212")[row] == pytest.approx(460, abs=0.01)
    steady = (t > 0.5) & (t < 12.9)
    assert curve_of(figure, "turn-deviation", "deviation")[steady] == pytest.approx(2.0, abs=0.005)
    # The word of 12 bits has steps of 0.065 deg/s.
    assert curve_of(figure, "turn-speed", "speed signal")[steady] == pytest.approx(60.0, abs=0.1)
    assert curve_of(figure, "turn-speed", "true speed")[steady] == pytest.approx(60.0, abs=0.1)
    spans = chart_of(figure, "turn-angles")["bands"][0]["spans"]
    assert [moment for span in spans for moment in span] == pytest.approx([4.464, 6.1, 10.464, 12.1], abs=0.021)
    assert figure.title.startswith("Step 1: ")
    assert chart_of(figure, "turn-speed")["xLabel"] == "time since the button was seen [s]"


def test_the_walk_backward_mirrors_it() -> None:
    figure = detail_of(play(jog(-1, 7.0)))
    t = t_of(figure)
    row = int(np.searchsorted(t, 3.0))
    assert curve_of(figure, "turn-angles", "M target")[row] == pytest.approx(-620, abs=0.01)
    assert curve_of(figure, "turn-angles", "M \u2212")[row] == pytest.approx(-260, abs=0.01)
    assert curve_of(figure, "turn-count", "turns n")[row] == -1
    assert curve_of(figure, "turn-count", "FLG")[row] == 1
    lag = curve_of(figure, "turn-deviation", "deviation")  # positive where the table lags
    assert lag[(t > 0.5) & (t < 6.9)] == pytest.approx(2.0, abs=0.005)
    button, crossing, *_ = texts_of(figure)
    assert button.startswith("\u2212 button")
    assert "at \u2212620\u202fdeg; n = 0" in button
    assert crossing.endswith("from 0 to 360\u202fdeg; n = \u22121")


def test_what_happens_in_a_jog_is_told_in_order(forward: Played) -> None:
    figure = detail_of(forward)
    assert [event.t for event in figure.events] == pytest.approx([0.0, 4.464, 6.1, 10.464, 12.1, 13.0, 13.2], abs=0.021)
    assert chart_of(figure, "turn-angles")["events"] == pytest.approx([event.t for event in figure.events], abs=1e-4)
    told = ("820\u202fdeg; n = 0", "from 360 to 0\u202fdeg; n = 1", "rollover", "from 360 to 0\u202fdeg; n = 1",
            "deviation stays 2.000\u202fdeg", "button released", "at rest: M, R and C")  # fmt: skip
    for text, part in zip(texts_of(figure), told, strict=True):
        assert part in text
    assert step_section(*forward).title == "Beyond one turn"


def test_a_jog_of_many_turns_is_shown_as_far_as_its_second_rollover() -> None:
    figure = detail_of(play(jog(1, 40.0)))
    assert sum("rollover" in text for text in texts_of(figure)) == 2
    assert 12.1 < t_of(figure)[-1] < 14.0
    assert "released" not in " ".join(texts_of(figure))


def test_a_jog_that_waits_for_its_signal_is_shown_from_where_it_moves(mixed: Played) -> None:
    spec, run, trace = mixed
    figure = detail_of((spec, replace(run, steps=[run.steps[5]]), trace))
    t, target = t_of(figure), curve_of(figure, "turn-angles", "M target")
    assert t[0] == pytest.approx(-0.1, abs=0.003)
    assert t[-1] < 1.4  # a second of jog, its stop, and a little after
    assert np.isnan(target[t < 0]).all()
    assert np.isfinite(target[t >= 0]).all()
    # After the release M is where the table stops: nothing to roll over at.
    assert np.isnan(curve_of(figure, "turn-angles", "M \u2212")[-1])
    assert step_section(spec, replace(run, steps=[run.steps[5]]), trace).title == "One step in detail"


def test_without_a_jog_over_the_end_a_positioning_is_shown(mixed: Played) -> None:
    figure = detail_of(mixed)
    assert figure.title.startswith("Step 4: go to position 3")
    assert "the longest positioning that crosses the end of the turn" in figure.caption
    # From 10 to 350 degrees by the short way: M is beyond the end.
    target = curve_of(figure, "turn-angles", "M target")
    assert target[len(target) // 2] == pytest.approx(-10, abs=0.01)
    assert [series["label"] for series in figure.charts[0]["series"]] == [
        "M target", "D detected", "R present", "C commanded",
    ]  # fmt: skip
    assert [sum(word in text for text in texts_of(figure)) for word in ("crosses", "rollover")] == [1, 0]
    assert "at \u221210\u202fdeg" in texts_of(figure)[0]
    assert chart_of(figure, "turn-speed")["xLabel"] == "time since the position was taken [s]"


@pytest.mark.parametrize(
    ("steps", "number", "why"),
    [
        ((Go(1), Go(2)), 2, "the longest positioning; none crosses the end of a turn"),
        ((Go(1), jog(1, 1.0), jog(-1, 0.5)), 2, "the longest jog; none came as far as the end of the turn"),
        ((Go(3), jog(1, 1.0), Go(4), jog(-1, 0.3)), 2, "the jog that crosses the end of the turn most often"),
    ],
)
def test_the_most_telling_step_is_shown(steps: tuple[Step, ...], number: int, why: str) -> None:
    played = play(*steps)
    found = telling(played[1], math.inf)
    assert found is not None
    assert (found[0].number, found[1]) == (number, why)
    figure = detail_of(played)
    assert figure.title.startswith(f"Step {number}: ")
    assert why in figure.caption


def test_a_sequence_without_motion_has_no_detail() -> None:
    assert step_section(*play(Wait(0.5))).shown == []


def test_a_table_that_dithers_at_the_end_of_its_turn_marks_few_crossings() -> None:
    spec, run, trace = play(Go(1), Go(0), Wait(0.3))
    zero = np.where(np.arange(len(trace)) % 2 > 0, 0, spec.period - 1)
    dithering = Trace(columns={name: trace[name] for name in trace} | {"controller.positioner.angle.dar": zero})
    figure = detail_of((spec, run, dithering))
    assert sum("crosses" in text for text in texts_of(figure)) == 6
    assert min(event.t for event in figure.events) == 0.0


# ---- what went wrong


def test_the_step_that_failed_is_shown_and_a_jog_that_broke_off_has_no_target() -> None:
    played = play(Go(1), jog(1, 30.0), Go(2), overrides=('method.form="raw"', *AS_COMMANDED))
    page, figure = table_page(*played), detail_of(played)
    assert page.headline.level == "bad"
    assert "1 of 3 steps" in page.headline.lead
    assert figure.title.startswith("Step 2: ")
    assert FAILED in figure.caption
    assert np.abs(curve_of(figure, "turn-deviation", "deviation")).max() > 300
    assert figure.events[1].text.endswith("from 360 to 0\u202fdeg")
    assert chart_of(figure, "turn-angles")["bands"][0]["spans"] == []
    table = page.sections[-1].shown[0].table
    assert table is not None
    assert [cell.text for cell, _ in table.cells(table.rows[1])][7] == "\u2013"


def test_a_flag_that_throws_the_table_back_is_told_by_its_deviation() -> None:
    overrides = ('method.form="flag"', 'mechanics.start_angle="0.5 deg"', *AS_COMMANDED)
    figure = detail_of(play(jog(1, 8.0), overrides=overrides))
    rollover = next(text for text in texts_of(figure) if "rollover" in text)
    assert "jumps from 2" in rollover
    assert rollover.endswith("\u202fdeg")


def test_a_flag_is_told_where_the_axis_has_one() -> None:
    figure = detail_of(play(jog(1, 5.0), overrides=(*PLAIN, 'method.form="flag"', *AS_COMMANDED)))
    assert texts_of(figure)[1].endswith("; FLG on")
    assert texts_of(figure)[-1] == "at rest: the table is held"


# ---- less than a whole trace


@pytest.mark.parametrize("left_out", sorted({*table_pages.NEEDED, *NEEDED}))
def test_a_trace_without_a_needed_signal_gives_a_page_without_its_figures(forward: Played, left_out: str) -> None:
    spec, run, trace = forward
    part = Trace(columns={name: trace[name] for name in trace if name != left_out})
    ids = [chart["id"] for chart in table_page(spec, run, part).charts]
    assert ids[0] == "line-steps"
    assert ("line-turns" in ids) == (left_out not in table_pages.NEEDED)
    assert ("turn-angles" in ids) == (left_out not in NEEDED)


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(NEEDED) <= set(SEQUENCE_SIGNALS)


def test_of_a_trace_that_ends_early_what_it_holds_is_shown(mixed: Played) -> None:
    spec, run, trace = mixed
    early = table_page(spec, run, trace.between(0.0, run.steps[0].end))
    assert [figure.title[:7] for section in early.sections[1:2] for figure in section.shown] == ["Step 1:"]
    assert t_of(early, "line-turns")[-1] < run.steps[0].end
    assert [chart["id"] for chart in table_page(spec, run, trace.between(0.0, 0.01)).charts] == ["line-steps"]
    assert step_section(spec, run, trace.between(0.0, 0.03)).shown == []


def test_a_run_without_a_step_has_no_detail(mixed: Played) -> None:
    assert step_section(mixed[0], run_of(asked=2, failure="never ready"), mixed[2]).shown == []
