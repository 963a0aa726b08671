import math
import re
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from detent.errors import DetentError
from detent.methods.filtered_servo.comparison import FeedbackCase, FeedbackComparison
from detent.methods.phase_servo.hold_comparison import HoldCase, HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page import plot_looks as comparison_figures
from detent.page.plot_looks import plot_feedback, plot_hold, plot_noise
from detent.page.plots import new_figure

PLOTS = {"noise": plot_noise, "hold": plot_hold, "feedback": plot_feedback}


@pytest.fixture
def noise() -> NoiseComparison:
    """The counted stop moves by a step per pulse, the absolute one by a hundredth; with 30 it is a pitch short."""
    pulses = (0, 8, 20, 30)
    counted = np.array(pulses, dtype=float)
    absolute = np.zeros((4, 2, 2)) + 0.01 * counted[:, None, None]
    absolute[3] = [[-64, 64], [-64, 64]]
    incremental = np.stack([np.stack([-counted] * 2, 1), np.stack([counted] * 2, 1)], 1)
    return NoiseComparison(
        pulses=pulses, absolute=absolute, incremental=incremental, step=6.6146e-6, counts=64, margin=24, pitches=6
    )


@pytest.fixture
def hold() -> HoldComparison:
    t = np.arange(0.0215, 0.2, 50e-6)
    swing = 0.4 * np.sin(2 * np.pi * 200 * t)
    arriving = np.where(t < 0.0225, -8.0, 0.0)

    def case(name: str, displacement: np.ndarray) -> HoldCase:
        whole = np.zeros(len(t), dtype=np.int64)
        return HoldCase(
            name=name, about=f"about {name}", t=t, displacement=displacement + arriving, integral=whole, word=whole
        )

    pushed = np.where(t < 0.03, 0.0, 2.0)
    return HoldComparison(
        still=(case("settling for ever", swing), case("as the file has it", 0 * t), case("no dead band", 4 * swing)),
        loaded=(case("with integrator", np.where(t < 0.05, pushed, -0.74)), case("without integrator", pushed)),
        push=3.0, push_at=0.03, stop_at=0.0415, step=6.6146e-6,
    )  # fmt: skip


@pytest.fixture
def feedback() -> FeedbackComparison:
    t = np.arange(7.8, 8.0, 1e-4)

    def case(name: str, window: float, scale: int, coefficient: float, margin: float, swing: float) -> FeedbackCase:
        return FeedbackCase(
            name=name, sample_period=window, scale=scale, coefficient=coefficient, kv=1 / (scale * window),
            std_speed=swing, std_error=swing, force_ripple=2.25 * swing, error_range=(-swing, swing),
            stop_overshoot=2.0 if margin > 1 else math.nan, stable=margin > 1, gain_limit=4000 * margin,
            gain_margin=margin, t=t, error=1 + swing * np.sign(np.sin(300 * t)), speed_word=20 + 0 * t,
        )  # fmt: skip

    return FeedbackComparison(
        cases=(
            case("conventional", 5e-3, 4, 1.0, 4.14, 1.75), case("with filter", 5e-3, 4, 0.25, 2.56, 0.58),
            case("long window", 20e-3, 1, 1.0, 0.69, 171.0), case("small multiplier", 5e-3, 1, 1.0, math.inf, 0.56),
        ),
        rate=1037.0, gain=4000.0, tau_m=math.inf,
    )  # fmt: skip


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are drawn, to look into them."""
    figures = []

    @contextmanager
    def keep(path, width, height):
        with new_figure(path, width, height) as figure:
            figures.append(figure)
            yield figure

    monkeypatch.setattr(comparison_figures, "new_figure", keep)
    return figures


def texts(path):
    found = re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return [re.sub(r"<[^>]+>", "", text).strip() for text in found]


def bands(area):
    """Lower and upper edge of what is green from side to side."""
    green = to_rgba(comparison_figures.GREEN, 0.18)
    found = [patch for patch in area.patches if patch.get_facecolor() == green]
    assert all((patch.get_x(), patch.get_width()) == (0, 1) for patch in found)
    return [(patch.get_y(), patch.get_y() + patch.get_height()) for patch in found]


# -- spurious pulses --------------------------------------------------------------------------------------------------
def test_noise_says_what_is_drawn(noise, tmp_path):
    plot_noise(noise, tmp_path / "a.svg")
    found = texts(tmp_path / "a.svg")
    assert "Where a move of 6 pitches stops after n spurious pulses" in found
    assert "n, spurious pulses in the move" in found
    assert "position − target [steps]" in found
    assert "[steps of 6.61 µm]" in found
    for stop in ("stop by counted pulses", "stop by the absolute word"):
        assert {f"{stop}, + pulses put in", f"{stop}, − pulses put in"} <= set(found)
    assert any(
        text.endswith("up to the margin the absolute stop is at most 0.2 step off (green: ±0.6)") for text in found
    )
    assert "beyond N/2 − threshold = 24 pulses:" in "\n".join(found)


def test_noise_draws_every_rest_point_and_the_band(noise, tmp_path, drawn):
    plot_noise(noise, tmp_path / "a.png")
    whole, near = drawn[0].axes
    marked = [line for line in whole.lines if line.get_marker() == "o"]
    expected = [
        rest[:, sign, side] for rest in (noise.incremental, noise.absolute) for sign in (0, 1) for side in (0, 1)
    ]
    assert [line.get_ydata().tolist() for line in marked] == [rest.tolist() for rest in expected]
    assert all(line.get_xdata().tolist() == [0, 8, 20, 30] for line in marked)
    for area in (whole, near):
        assert bands(area) == [(-0.6, 0.6)]
    assert near.get_ylim() == (-1.15, 1.15)


def test_a_line_goes_only_as_far_as_the_method_protects(noise, tmp_path, drawn):
    plot_noise(noise, tmp_path / "a.png")
    whole = drawn[0].axes[0]
    ends = {line.get_color(): line.get_xdata()[-1] for line in whole.lines if line.get_marker() == "None"}
    assert ends[comparison_figures.ORANGE] == 30
    assert ends[comparison_figures.BLUE] == 20


def test_within_the_margin_nothing_is_said_of_what_lies_beyond(noise, tmp_path):
    inside = replace(noise, margin=60, pitches=1, absolute=0.001 * noise.absolute)
    plot_noise(inside, tmp_path / "a.svg")
    found = "\n".join(texts(tmp_path / "a.svg"))
    assert "Where a move of 1 pitch stops" in found
    assert "beyond" not in found


def test_an_axis_without_any_margin_can_be_drawn(noise, tmp_path, drawn):
    plot_noise(replace(noise, margin=-1), tmp_path / "a.png")
    assert len([line for line in drawn[0].axes[0].lines if line.get_marker() == "o"]) == 8


def test_a_stop_that_is_far_off_is_in_the_title(noise, tmp_path):
    plot_noise(replace(noise, absolute=noise.absolute - 17.0, margin=4), tmp_path / "a.svg")
    assert "at most 17 steps off" in "\n".join(texts(tmp_path / "a.svg"))


# -- standing still ---------------------------------------------------------------------------------------------------
def test_hold_says_what_is_drawn(hold, tmp_path):
    plot_hold(hold, tmp_path / "a.svg")
    found = texts(tmp_path / "a.svg")
    for text in (
        "How the axis stands at its target (green: within ±1 step of 6.61 µm)", "Settling for ever: swings by 0.8 step",
        "As the file has it: stands still", "No dead band: swings by 3.2 steps", "about no dead band",
        "Pushed with 3 N it stands −0.7 steps off with integrator, +2.0 steps off without integrator",
        "with integrator", "without integrator", "push", "time since power-on [ms]",
    ):  # fmt: skip
        assert found.count(text) == 1, text
    assert found.count("stop") == 3  # the variant that settles for ever has none
    assert found.count("[steps]") == 4


def test_hold_draws_each_variant_with_its_band_and_leaves_the_arrival_out(hold, tmp_path, drawn):
    plot_hold(hold, tmp_path / "a.png")
    *still, loaded = drawn[0].axes
    for area, case in zip(still, hold.still, strict=True):
        assert area.lines[0].get_ydata().tolist() == case.displacement.tolist()
        assert area.lines[0].get_xdata() == pytest.approx(1e3 * case.t)
    assert [line.get_ydata()[-1] for line in loaded.lines if len(line.get_ydata()) > 2] == [-0.74, 2.0]
    for area in (*still, loaded):
        assert bands(area) == [(-1.0, 1.0)]
        assert area.get_ylim()[0] > -2.5
    assert still[0].get_ylim() == (-1.5, 1.5)
    assert still[2].get_ylim() == pytest.approx((-1.92, 1.92), rel=1e-3)
    assert loaded.get_ylim() == pytest.approx((-1.5, 2.4))


# -- feedback of the counted speed ------------------------------------------------------------------------------------
def test_feedback_says_what_is_drawn(feedback, tmp_path):
    plot_feedback(feedback, tmp_path / "a.svg")
    found = texts(tmp_path / "a.svg")
    assert any(text.startswith("How rough the drive is at 1037 pulses/s") and "±1 count" in text for text in found)
    for text in (
        "Conventional: window 5 ms, times 4", "With filter: window 5 ms, times 4, filter 1/4",
        "Long window: window 20 ms, times 1", "Small multiplier: window 5 ms, times 1", "ripple of E", "[count rms]",
        "force ripple", "gain", "margin", "1.75", "0.58", "171", "0.56", "3.94", "1.3", "4.1 ×", "2.6 ×", "0.69 ×",
        "does not", "settle", "none", "needed", "time [ms]",
    ):  # fmt: skip
        assert text in found, text
    assert found.count("drive E") == 4
    assert found.count("2") >= 3  # overshoot of those that settle


def test_stable_cases_share_a_scale_about_their_mean(feedback, tmp_path, drawn):
    plot_feedback(feedback, tmp_path / "a.png")
    areas = drawn[0].axes[::2]
    for area, case in zip(areas, feedback.cases, strict=True):
        assert area.lines[0].get_ydata().tolist() == case.error.tolist()
        assert area.lines[0].get_xdata()[[0, -1]] == pytest.approx([0, 1e3 * (case.t[-1] - case.t[0])])
        middle = case.error.mean()
        assert bands(area)[0] == pytest.approx((middle - 1, middle + 1))
    spans = [np.ptp(area.get_ylim()) for area in areas]
    assert spans[0] == pytest.approx(spans[1])
    assert spans[0] == pytest.approx(spans[3])
    assert spans[0] == pytest.approx(2.2 * 2, rel=0.01)
    assert spans[2] > 300


def test_a_case_that_has_failed_says_so(feedback, tmp_path):
    nothing = np.empty(0)
    failed = replace(
        feedback.cases[2], t=nothing, error=nothing, speed_word=nothing, std_error=math.nan, force_ripple=math.nan
    )
    plot_feedback(replace(feedback, cases=(*feedback.cases[:2], failed)), tmp_path / "a.svg")
    found = texts(tmp_path / "a.svg")
    assert "a fault has switched the drive off" in found
    assert found.count("–") == 2


def test_nothing_but_failures_can_be_drawn(feedback, tmp_path):
    nothing = np.empty(0)
    failed = replace(feedback.cases[2], t=nothing, error=nothing, speed_word=nothing)
    plot_feedback(replace(feedback, cases=(failed, failed)), tmp_path / "a.svg")
    assert texts(tmp_path / "a.svg").count("a fault has switched the drive off") == 2


# -- files ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("kind", "suffix", "magic"),
    [("noise", ".png", b"\x89PNG"), ("hold", ".pdf", b"%PDF"), ("feedback", ".svg", b"<?xml")],
)
def test_the_same_figure_gives_the_same_file(kind, suffix, magic, request, tmp_path):
    for name in ("one", "two"):
        PLOTS[kind](request.getfixturevalue(kind), tmp_path / f"{name}{suffix}")
    first = (tmp_path / f"one{suffix}").read_bytes()
    assert first.startswith(magic)
    assert first == (tmp_path / f"two{suffix}").read_bytes()


@pytest.mark.parametrize("kind", ["noise", "hold", "feedback"])
def test_a_target_that_cannot_take_a_figure_is_refused(kind, request, tmp_path):
    with pytest.raises(DetentError, match=r"cannot be saved as '\.gif'"):
        PLOTS[kind](request.getfixturevalue(kind), tmp_path / "a.gif")
    assert not list(tmp_path.iterdir())
