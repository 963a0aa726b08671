import math

import numpy as np
import pytest

import detent
from detent.methods.filtered_servo import system as filtered_servo
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.method import SIGNALS
from detent.methods.filtered_servo.page import FilteredView, command_speed
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import FilteredServo
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.page import POSITION, TARGET, VELOCITY, moves_page
from detent.methods.moves.run import MoveRun, run_moves
from detent.methods.moves.summary import move_summary
from detent.page.frame import Page
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

Played = tuple[FilteredServoSpec, MoveRun, Trace]


def play(*ways: float, overrides: tuple[str, ...] = (), **common: float) -> Played:
    spec = load_spec(detent.example("filtered_servo.toml"), overrides)
    assert isinstance(spec, FilteredServoSpec)
    job = MoveJob("steps", "moves", tuple(Move(n, n, by=way, **common) for n, way in enumerate(ways, 1)))
    recorder = Recorder(FilteredServo, SIGNALS, every=10, period=filtered_servo.TICK)
    return spec, run_moves(FilteredHost(spec, recorder), job), recorder.trace()


def curve_of(page: Page, chart: str, label: str) -> np.ndarray:
    (found,) = [
        series["y"] for one in page.charts if one["id"] == chart for series in one["series"] if series["label"] == label
    ]
    return np.array([math.nan if value is None else value for value in found])


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert {POSITION, VELOCITY, TARGET, *FilteredView.signals} <= set(SIGNALS)


def test_it_follows_its_command_at_a_distance() -> None:
    spec, run, trace = play(1e-3, 2e-3, -5e-3, speed=20e-3, dwell=0.05)
    page = moves_page(FilteredView(spec), run, trace)
    figure = next(figure for figure in page.figures if figure.events)
    assert figure.title.startswith("Move 2, ")
    assert [chart["id"] for chart in figure.charts] == ["move-speed", "move-counted", "move-deviation", "move-drive"]
    t = np.array(figure.charts[0]["x"]) * 1e-3
    # A trapezoid: 20 mm/s, reached with 1 m/s^2, for 2 mm; its mean over a window of 5 ms.
    commanded = curve_of(page, "move-speed", "commanded")
    np.testing.assert_allclose(commanded[(t > 0.025) & (t < 0.095)], 20.0, rtol=0.03)
    assert commanded[np.searchsorted(t, 0.01)] == pytest.approx(10.0, rel=0.05)
    assert [event.text for event in figure.events] == [
        "move commanded", "last command pulse", "within ±3 pulses of the target for good",
        "in position: within ±2 pulses for 50 ms",
    ]  # fmt: skip
    assert figure.events[1].t == pytest.approx(2e-3 / 20e-3 + 20e-3, abs=1e-3)
    counted, smooth = (curve_of(page, "move-counted", name) for name in ("counted × B", "after the filter"))
    assert set((counted % spec.method.scale).tolist()) == {0}
    # The error is what the command is ahead; speed times K2 = B TS of it, once it is steady.
    error, drive = curve_of(page, "move-deviation", "following error"), curve_of(page, "move-drive", "drive word")
    assert error.max() > 20e-3 / spec.pulse * 0.02
    assert abs(error[-1]) <= spec.method.in_position
    np.testing.assert_allclose(drive, np.clip(error - smooth, -128, 127), atol=0.006)
    assert dict(move_summary(run, FilteredView(spec).unit))["moves"] == "3 of 3"
    assert FilteredView(spec).unit.words == "pulses"


def test_an_axis_that_has_given_up_comes_to_no_rest() -> None:
    pushed = tuple(f"disturbance.push.{key}" for key in ("force=-1000 N", "at=20 ms", "duration=2 s"))
    spec, run, trace = play(0.1, overrides=pushed)
    page = moves_page(FilteredView(spec), run, trace)
    figure = next(figure for figure in page.figures if figure.events)
    assert [event.text for event in figure.events] == ["move commanded", "the run ends here"]
    assert math.isnan(curve_of(page, "move-speed", "commanded")[-1])
    assert not any(chart["id"].startswith("approach") for chart in page.charts)


def test_the_commanded_speed_is_the_mean_over_a_window() -> None:
    t = np.arange(0, 0.1, 1e-4)
    speed = command_speed(t, np.floor(t * 1000), np.full(len(t), 5e-3))
    middle = (t > 0.01) & (t < 0.09)
    np.testing.assert_allclose(speed[middle], 1000, rtol=0.01)
    assert np.isnan(speed[t > 0.0975]).all()
