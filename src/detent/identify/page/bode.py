"""Plots over the logarithm of the frequency, drawn as SVG without a script."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from detent.page.parts import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One curve of a plot over the frequency."""

    label: str  # as in the legend; empty for none
    colour: str  # name of a colour of template/report.css
    x: Numbers  # and y: frequency [Hz] and value, NaN for a gap, shape (n,)
    y: Numbers
    dash: str = ""  # of the line, as SVG writes it; empty for a solid one


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A plot over the logarithm of the frequency."""

    label: str  # of the vertical axis
    lines: Sequence[Line]  # the first is drawn first
    logarithmic: bool = False  # the values are, too
    span: tuple[float, float] | None = None  # of the values; by the first line unless given
    height: int = 200  # [px]
    levels: Sequence[float] = ()  # marked values


LEFT, RIGHT, TOP, FOOT, FULL = 74.0, 16.0, 10.0, 22.0, 1000.0


def frequency_plots(plots: Sequence[Plot]) -> Markup:
    """Draw plots above one another over the same frequencies, the axis logarithmic."""
    low, high = (float(f(plots[0].lines[0].x)) for f in (np.min, np.max))
    legend = " ".join(
        f'<span class="nowrap"><svg width="26" height="10"><path d="M1 5h24" style="{_stroke(line, 2.5)}"/></svg> '
        f"{escape(line.label)}</span>"
        for line in plots[0].lines
        if line.label
    )
    drawn = "".join(_plot(plot, low, high, last=plot is plots[-1]) for plot in plots)
    return Markup(f'{drawn}<p class="hint">{legend}</p>')  # noqa: S704 - texts are escaped where they are put in


def _stroke(line: Line, width: float) -> str:
    dash = f";stroke-dasharray:{line.dash}" if line.dash else ""
    return f"fill:none;stroke:var(--{line.colour});stroke-width:{width}{dash}"


def _plot(plot: Plot, low: float, high: float, *, last: bool) -> str:
    bottom, top = plot.span or _span(plot)
    inner = plot.height - TOP - FOOT

    def right(f: Numbers) -> Numbers:
        return LEFT + (FULL - LEFT - RIGHT) * np.log(f / low) / math.log(high / low)

    def down(y: Numbers) -> Numbers:
        share = np.log(y / bottom) / math.log(top / bottom) if plot.logarithmic else (y - bottom) / (top - bottom)
        return TOP + inner * (1.0 - share)

    parts: list[str] = []
    for f, text in _decades(low, high):
        at = float(right(np.array([f]))[0])
        parts.append(f'<path d="M{at:.1f} {TOP}V{plot.height - FOOT}" style="stroke:var(--grid)"/>')
        if text:
            parts.append(f'<text x="{at:.1f}" y="{plot.height - 6}" text-anchor="middle">{text}</text>')
    for value, text in _powers(bottom, top) if plot.logarithmic else _steps(bottom, top):
        at = float(down(np.array([value]))[0])
        parts.append(f'<path d="M{LEFT} {at:.1f}H{FULL - RIGHT}" style="stroke:var(--grid)"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{text}</text>')
    for level in plot.levels:
        at = float(down(np.array([level]))[0])
        parts.append(f'<path d="M{LEFT} {at:.1f}H{FULL - RIGHT}" style="stroke:var(--soft);stroke-dasharray:3 3"/>')
    wide = FULL - LEFT - RIGHT
    clip = f'<svg x="{LEFT}" y="{TOP}" width="{wide}" height="{inner}" viewBox="{LEFT} {TOP} {wide} {inner}">'
    curves = "".join(
        f'<path d="{_path(right(one.x), down(one.y))}" style="{_stroke(one, 1.8)}"/>' for one in plot.lines
    )
    foot = f'<text x="{FULL / 2}" y="{plot.height + 14}" text-anchor="middle">frequency [Hz]</text>' if last else ""
    height = plot.height + (18 if last else 0)
    turned = f"translate(14 {TOP + inner / 2:.0f}) rotate(-90)"
    side = f'<text transform="{turned}" text-anchor="middle">{escape(plot.label)}</text>'
    return (
        f'<svg viewBox="0 0 {FULL:.0f} {height}" role="img" aria-label="{escape(plot.label)} over the frequency" '
        f'style="display:block;width:100%;height:auto;font:12px system-ui,sans-serif;fill:var(--soft)">'
        f"{''.join(parts)}{clip}{curves}</svg>{side}{foot}</svg>"
    )


def _span(plot: Plot) -> tuple[float, float]:
    """By the first line, with some room."""
    values = plot.lines[0].y[np.isfinite(plot.lines[0].y)]
    low, high = float(values.min()), float(values.max())
    if plot.logarithmic:
        return low / 2.0, high * 2.0
    room = max(0.1 * (high - low), 10.0)
    return low - room, high + room


def _path(x: Numbers, y: Numbers) -> str:
    """A line through points, broken where one is missing."""
    text: list[str] = []
    pen = "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if not math.isfinite(b):
            pen = "M"
            continue
        text.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L"
    return "".join(text)


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    """Lines at 1 to 9 of each decade, figures at 1, 2 and 5, or at 1 alone of many decades."""
    figures = (1, 2, 5) if high / low < 2e3 else (1,)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [(digit * 10.0**decade, digit) for decade in decades for digit in range(1, 10)]
    return [(f, f"{f:g}" if digit in figures else "") for f, digit in ticks if low <= f <= high]


def _powers(bottom: float, top: float) -> list[tuple[float, str]]:
    """Powers of ten, every second or third of many."""
    powers = range(math.ceil(math.log10(bottom)), math.floor(math.log10(top)) + 1)
    every = max(1, math.ceil(len(powers) / 6))
    raised = '10<tspan dy="-5" font-size="9">{}</tspan>'
    return [(10.0**k, raised.format(str(k).replace("-", "\u2212"))) for k in powers if k % every == 0]


def _steps(bottom: float, top: float) -> list[tuple[float, str]]:
    """Round steps; of angles those of a quarter turn."""
    wide = top - bottom
    steps = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 45.0, 90.0, 180.0, 360.0, 720.0)
    step = next((one for one in steps if wide / one <= 6.0), wide / 5.0)
    first, last = math.ceil(bottom / step - 1e-9), math.floor(top / step + 1e-9)
    return [(k * step, f"{k * step:g}".replace("-", "\u2212")) for k in range(first, last + 1)]
