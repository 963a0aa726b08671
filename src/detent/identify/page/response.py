"""Figure of the report of an identification: the frequency response, where the excitation tells one.

Plots over the logarithm of the frequency are drawn as SVG, without a script.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse, response_of
from detent.identify.fit.constants import Constants
from detent.identify.fit.identification import Identification
from detent.identify.page.words import unit_text
from detent.page.figure import Figure
from detent.page.parts import Numbers

COHERENT = 0.8  # coherence of a line that tells something
FEWEST_LINES = 10  # coherent lines without which there is no Bode plot
AGREEING = 0.9  # share of neighbouring lines whose accelerations are less than a factor of 2 apart, at least
BROADEST = 3.0  # highest over lowest coherent frequency, at least
MOST_LINES = 800  # frequencies drawn


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


def response_figures(found: Identification, shown: int) -> list[Figure]:
    """Bode plot with coherence, or a sentence why there is none."""
    response = told_response(found, shown)
    if response is not None:
        caption = Markup(
            "How far the position answers to the effort at each frequency. Where it rises above the dashed line of the "
            "identified mass and viscous friction there is a resonance; at low frequencies dry friction holds it "
            "below. <b>Coherence</b> is the share of the position that the effort explains: below {} the curves above "
            "it are noise. Method: {}."
        ).format(COHERENT, response.method)
        return [Figure(title="Bode plot", caption=caption, drawing=bode_plot(response, found.constants))]
    if found.verdict == "refused":
        return []
    missing = Markup(
        "<p>None: this recording does not excite a whole band of frequencies evenly, or a controller answers to noise "
        "there. A recording with a multisine or a chirp, repeated three times or more, would tell resonances.</p>"
    )
    return [Figure(title="Bode plot", drawing=missing)]


def told_response(found: Identification, shown: int) -> FrequencyResponse | None:
    """Response of a log, where it tells one: periods, or an open loop, and enough coherent lines.

    Windows over a closed loop show the controller where noise drives the effort; so a log with a reference must have
    periods.
    """
    run = found.runs[shown]
    try:
        response = response_of(found.logs[shown], run.effort_name)
    except DetentError:
        return None
    is_open = response.resolution == 0.0 or run.reference is None
    return response if is_open and _tells(response) else None


def _tells(response: FrequencyResponse) -> bool:
    """True for enough coherent lines whose neighbours agree.

    Lines that are hardly excited beside strong ones hold what friction makes of these; it comes back in each period, so
    that coherence does not show it.
    """
    told = response.coherence >= COHERENT
    f, size = response.frequency[told], response.magnitude[told]
    if len(f) < FEWEST_LINES or f[-1] < BROADEST * f[0]:
        return False
    apart = np.abs(np.diff(np.log(size * f**2)))
    return bool(np.mean(apart < math.log(2.0)) > AGREEING)


def bode_plot(r: FrequencyResponse, constants: Constants | None) -> Markup:
    """Magnitude, phase and coherence over the frequency, beside the rigid axis of the identified constants."""
    every = max(1, -(-len(r) // MOST_LINES))
    f, response, coherence = r.frequency[::every], r.response[::every], r.coherence[::every]
    model = respond(constants, f) if constants is not None else None
    size = [Line(label="recorded", colour="speed", x=f, y=np.abs(response))]
    angle = [Line(label="", colour="speed", x=f, y=_phase(response, model))]
    if model is not None:
        turned = np.degrees(np.unwrap(np.angle(model)))
        size.append(Line(label="mass and viscous friction", colour="left", x=f, y=np.abs(model), dash="6 4"))
        angle.append(Line(label="", colour="left", x=f, y=turned, dash="6 4"))
    explained = Line(label="", colour="good", x=f, y=coherence)
    unit = f"{unit_text(r.output_unit) or '1'}/{unit_text(r.input_unit) or '1'}"
    return frequency_plots([
        Plot(label=f"magnitude [{unit}]", lines=size, logarithmic=True, height=260),
        Plot(label="phase [deg]", lines=angle, height=180),
        Plot(label="coherence", lines=[explained], span=(0.0, 1.05), height=130, levels=[COHERENT]),
    ])  # fmt: skip


def _phase(response: Numbers, model: Numbers | None) -> Numbers:
    """Phase [deg], within half a turn of the model's; without one from -360 to 0, with gaps where it jumps."""
    if model is not None:
        return np.degrees(np.unwrap(np.angle(model)) + np.angle(response / model))
    phase = np.mod(np.degrees(np.angle(response)), 360.0) - 360.0
    jumps = np.abs(np.diff(phase, prepend=phase[:1])) > 180.0
    return np.where(jumps, np.nan, phase)


def respond(constants: Constants, frequency: Numbers) -> Numbers | None:
    """Response of position to effort by mass, viscous friction and delay alone, complex, shape (n,)."""
    mass = constants.value("mass")
    if mass <= 0.0:
        return None
    s = 2j * np.pi * frequency
    viscous = max(0.5 * (constants.value("viscous.positive") + constants.value("viscous.negative")), 0.0)
    return np.exp(-s * constants.value("delay")) / (mass * s**2 + viscous * s)
