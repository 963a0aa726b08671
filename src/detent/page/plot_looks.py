"""Figures of the comparisons of servo axes: spurious pulses, standing still, and feedback of the counted speed."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.filtered_servo.comparison import FeedbackCase, FeedbackComparison
from detent.methods.phase_servo.hold_comparison import HoldCase, HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page.parts import Numbers
from detent.page.plots import COLOURS, check_figure_path, new_figure
from detent.page.thin import thin_indices
from detent.units import format_quantity

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any

BLUE, ORANGE, GREEN, PINK = COLOURS[:4]
GREY = "#7d8996"
INK = "#17202a"

NOISE_BAND = 0.6
"""How far off an absolute stop may be, whatever the noise (phase-servo test 25) [steps]."""

HOLD_BAND = 1.0
"""How far off the axis may be once it has stopped (phase-servo tests 28 and 29) [steps]."""

RESOLUTION = 1.0
"""What one pulse of movement changes in the error E of the filtered servo, with K1 = 1 [count]."""

STILL = 0.01
"""A swing below this is rest (phase-servo test 28) [steps]."""

POINTS = 6000
"""Points of one curve: more than a printed page resolves."""

BAND: dict[str, Any] = {"color": GREEN, "alpha": 0.18, "linewidth": 0}
ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2, "fontsize": 9}
"""Place of a legend: above the curves, never over them."""


# -- spurious pulses ---------------------------------------------------------------------------------------------------
def plot_noise(found: NoiseComparison, path: str | Path) -> None:
    """Draw where the axis stops after spurious pulses, and where it would stop by counted pulses.

    Parameters
    ----------
    found : NoiseComparison
        Rest points.
    path : str or Path
        Target ending in ``.png``, ``.svg`` or ``.pdf``; replaced if it exists.

    Raises
    ------
    DetentError
        The file cannot be written.
    """
    path = check_figure_path(path)
    with new_figure(path, 9.0, 7.6) as figure:
        whole, near = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        for area in (whole, near):
            area.axhspan(-NOISE_BAND, NOISE_BAND, **BAND)
            area.axhline(0, color=INK, linewidth=0.8)
            _shade_beyond(area, found)
        counts, last = np.asarray(found.pulses), found.pulses[-1]
        # A servo that counts knows no margin; the absolute stop jumps there from one positioning point to another.
        _draw_rest(whole, counts, found.incremental, last, (ORANGE, "stop by counted pulses"))
        for area, name in ((whole, "stop by the absolute word"), (near, "")):
            _draw_rest(area, counts, found.absolute, found.margin, (BLUE, name))
        _explain(whole, found)
        length = "1 pitch" if found.pitches == 1 else f"{found.pitches} pitches"
        whole.set_title(f"Where a move of {length} stops after n spurious pulses", pad=38)
        whole.set_ylabel("position − target [steps]")
        whole.legend(**ABOVE, ncols=2)
        worst = _steps(float(np.abs(found.absolute[counts <= found.margin]).max(initial=0.0)))
        near.set_title(
            f"The same, enlarged: up to the margin the absolute stop is at most {worst} off (green: ±{NOISE_BAND:g})",
            fontsize=10,
        )
        near.set_ylim(-1.15, 1.15)
        near.set_ylabel(f"[steps of {_micro(found.step, 'm')}]")
        near.set_xlabel("n, spurious pulses in the move")
        near.set_xlim(-0.03 * last, 1.03 * last)


def _steps(value: float) -> str:
    return f"{value:.2g} {'step' if value <= 1 else 'steps'}"


def _micro(value: float, unit: str) -> str:
    """Quantity as figures write it."""
    return format_quantity(value, unit, 3).replace("um", "µm")


def _shade_beyond(area: Axes, found: NoiseComparison) -> None:
    """Grey where the method no longer protects."""
    if found.pulses[-1] > found.margin:
        area.axvspan(found.margin, 1.03 * found.pulses[-1], color=GREY, alpha=0.15, linewidth=0)


def _draw_rest(area: Axes, counts: NDArray[np.int_], rest: Numbers, until: int, look: tuple[str, str]) -> None:
    """Rest points with both signs of pulses (full and open), in both directions of travel; a line `until` so many.

    `look` is colour and name; without a name it does not appear in the legend.
    """
    colour, name = look
    lined = counts <= until
    for sign, (mark, fill) in enumerate((("+", colour), ("−", "white"))):
        for side in range(2):
            curve = rest[:, sign, side]
            area.plot(counts[lined], curve[lined], color=colour, linewidth=1.0, alpha=0.8)
            label = f"{name}, {mark} pulses put in" if name and side == 0 else None
            area.plot(counts, curve, "o", color=colour, markerfacecolor=fill, markersize=5, label=label)


def _explain(area: Axes, found: NoiseComparison) -> None:
    """Say what lies beyond the margin: the next positioning points."""
    if found.pulses[-1] <= found.margin:
        return
    text = (
        f"beyond N/2 − threshold = {found.margin} pulses:\nthe next positioning point,\n"
        f"a whole pitch ({found.counts} steps) off"
    )
    side = -1 if found.margin > found.pulses[-1] / 2 else 1  # where there is more room
    area.annotate(
        text, (found.margin, 1.0), (6 * side, -4), xycoords=area.get_xaxis_transform(), textcoords="offset points",
        va="top", ha="right" if side < 0 else "left", fontsize=9,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )  # fmt: skip
    if np.abs(found.absolute).max() > found.counts / 2:
        for line in (-found.counts, found.counts):
            area.axhline(line, color=GREY, linewidth=0.9, linestyle=":")


# -- standing still ----------------------------------------------------------------------------------------------------
def plot_hold(found: HoldComparison, path: str | Path) -> None:
    """Draw how the axis stands at its target, still and pushed, with and without dead band and integrator.

    Parameters
    ----------
    found : HoldComparison
        Records of the variants.
    path : str or Path
        Target ending in ``.png``, ``.svg`` or ``.pdf``; replaced if it exists.

    Raises
    ------
    DetentError
        The file cannot be written.
    """
    path = check_figure_path(path)
    with new_figure(path, 9.0, 8.6) as figure:
        areas = figure.subplots(len(found.still) + 1, 1, sharex=True, height_ratios=[*(1 for _ in found.still), 1.9])
        for area, case, colour in zip(areas[:-1], found.still, (ORANGE, BLUE, PINK), strict=True):
            _draw_hold(area, [(case, colour)])
            _set_hold_title(area, f"{_capital(case.name)}: {_swing_text(case)}", case.about)
        for area in areas[1:]:
            _mark(area, found.stop_at, "stop")
        loaded = areas[-1]
        _draw_hold(loaded, [(case, colour) for case, colour in zip(found.loaded, (BLUE, ORANGE), strict=True)])
        push = _micro(found.push, "N")
        _mark(loaded, found.push_at, "push", line=1)
        texts = [f"{case.rest:+.1f} steps off {case.name}".replace("-", "−") for case in found.loaded]
        _set_hold_title(loaded, f"Pushed with {push} it stands " + ", ".join(texts), "")
        loaded.legend(loc="lower right", fontsize=9)
        loaded.set_xlabel("time since power-on [ms]")
        figure.suptitle(
            f"How the axis stands at its target (green: within ±{HOLD_BAND:g} step of {_micro(found.step, 'm')})",
            x=0.01, ha="left", fontsize=11, fontweight="bold",
        )  # fmt: skip
        figure.align_ylabels(areas)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _swing_text(case: HoldCase) -> str:
    return f"swings by {_steps(case.swing)}" if case.swing > STILL else "stands still"


def _set_hold_title(area: Axes, text: str, about: str) -> None:
    area.set_title(text, fontsize=10)
    area.set_title(about, loc="right", fontsize=8.5, fontweight="normal", color=GREY)


def _draw_hold(area: Axes, cases: Sequence[tuple[HoldCase, str]]) -> None:
    """Displacement of variants over time; the arrival itself is cut off."""
    area.axhspan(-HOLD_BAND, HOLD_BAND, **BAND)
    low, high = -1.5 * HOLD_BAND, 1.5 * HOLD_BAND
    for case, colour in cases:
        kept = thin_indices(case.displacement, POINTS)
        area.plot(1e3 * case.t[kept], case.displacement[kept], color=colour, linewidth=1.2, label=case.name)
        arrived = case.displacement[len(case.t) // 20 :]
        low, high = min(low, 1.2 * float(arrived.min())), max(high, 1.2 * float(arrived.max()))
    area.set_ylim(low, high)
    area.margins(x=0)
    area.set_ylabel("position − target\n[steps]")


def _mark(area: Axes, moment: float, text: str, *, line: int = 0) -> None:
    """Mark a moment [s] by a line with its name at the foot, so many lines of text above it."""
    area.axvline(1e3 * moment, color=GREY, linewidth=1.1, linestyle="--")
    area.annotate(
        text, (1e3 * moment, 0.0), (4, 4 + 14 * line), xycoords=area.get_xaxis_transform(),
        textcoords="offset points", fontsize=9, color=GREY,
    )  # fmt: skip


# -- feedback of the counted speed -------------------------------------------------------------------------------------
COLUMNS = (
    "ripple of E\n[count rms]",
    "force ripple\n[N rms]",
    "overshoot at\na stop [pulses]",
    "gain\nmargin",
    "KV\n[1/s]",
)


def plot_feedback(found: FeedbackComparison, path: str | Path) -> None:
    """Draw the drive word of each kind of speed feedback at constant speed, and write what else it costs or brings.

    Parameters
    ----------
    found : FeedbackComparison
        Curves and figures.
    path : str or Path
        Target ending in ``.png``, ``.svg`` or ``.pdf``; replaced if it exists.

    Raises
    ------
    DetentError
        The file cannot be written.
    """
    path = check_figure_path(path)
    with new_figure(path, 11.0, 8.0) as figure:
        areas = figure.subplots(len(found.cases), 2, sharex="col", squeeze=False, width_ratios=[1, 0.95])
        span = _steady_span(found.cases)
        for (area, words), case in zip(areas, found.cases, strict=True):
            _draw_error(area, case, span)
            _write_figures(words, case)
        _write_heads(areas[0, 1])
        areas[-1, 0].set_xlabel("time [ms]")
        figure.suptitle(
            f"How rough the drive is at {found.rate:g} pulses/s with each feedback of the counted speed "
            "(green: ±1 count)\n",
            x=0.01, ha="left", fontsize=11, fontweight="bold",
        )  # fmt: skip


def _steady_span(cases: Sequence[FeedbackCase]) -> float:
    """Half the height that shows every case that is stable, about its mean."""
    spans = [float(np.abs(case.error - case.error.mean()).max()) for case in cases if case.stable and len(case.error)]
    return 1.1 * max([*spans, 2 * RESOLUTION])


def _draw_error(area: Axes, case: FeedbackCase, span: float) -> None:
    """E of one case; those that are stable to one scale."""
    area.set_title(f"{_capital(case.name)}: {_settings(case)}", fontsize=10)
    area.set_ylabel("drive E\n[count]")
    if not len(case.error):
        area.set_yticks([])
        area.text(0.5, 0.5, "a fault has switched the drive off", transform=area.transAxes, ha="center", color=ORANGE)
        return
    middle = float(np.mean(case.error))
    area.axhspan(middle - RESOLUTION, middle + RESOLUTION, **BAND)
    kept = thin_indices(case.error, POINTS)
    colour = ORANGE if not case.stable else BLUE if case.coefficient < 1 else GREY
    area.plot(1e3 * (case.t[kept] - case.t[0]), case.error[kept], color=colour, linewidth=1.0)
    if case.stable:
        area.set_ylim(middle - span, middle + span)
    area.margins(x=0)


def _settings(case: FeedbackCase) -> str:
    text = f"window {_micro(case.sample_period, 's')}, times {case.scale}"
    return text + (f", filter 1/{1 / case.coefficient:g}" if case.coefficient < 1 else "")


def _write_heads(area: Axes) -> None:
    for k, text in enumerate(COLUMNS):
        area.text((k + 0.5) / len(COLUMNS), 1.05, text, transform=area.transAxes, ha="center", va="bottom", fontsize=9)


def _write_figures(area: Axes, case: FeedbackCase) -> None:
    """One line of the table beside the curves."""
    area.axis("off")
    stop = "does not\nsettle" if math.isnan(case.stop_overshoot) else f"{case.stop_overshoot:g}"
    margin = "none\nneeded" if math.isinf(case.gain_margin) else f"{case.gain_margin:.2g} ×"
    texts = (_rounded(case.std_error), _rounded(case.force_ripple), stop, margin, f"{case.kv:.3g}")
    bad = (not case.stable, not case.stable, not case.stable, case.gain_margin <= 1, False)
    for k, (text, wrong) in enumerate(zip(texts, bad, strict=True)):
        area.text(
            (k + 0.5) / len(COLUMNS), 0.5, text, transform=area.transAxes, ha="center", va="center",
            fontsize=13 if "\n" not in text else 10, color=ORANGE if wrong else INK,
            fontweight="bold" if case.coefficient < 1 else "normal",
        )  # fmt: skip


def _rounded(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g}"
