"""Figure of the report of an identification: the frequency response, where the excitation tells one.

Plots over the logarithm of the frequency are drawn as SVG, without a script.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse, response_of
from detent.identify.fit.constants import Constants
from detent.identify.fit.identification import Identification
from detent.identify.page.words import unit_text
from detent.page.chart import Curve, Panel
from detent.page.figure import Figure
from detent.page.parts import Numbers

COHERENT = 0.8  # coherence of a line that tells something
FEWEST_LINES = 10  # coherent lines without which there is no Bode plot
AGREEING = 0.9  # share of neighbouring lines whose accelerations are less than a factor of 2 apart, at least
BROADEST = 3.0  # highest over lowest coherent frequency, at least
MOST_LINES = 800  # frequencies drawn


LEFT, RIGHT, TOP, FOOT, FULL = 74.0, 16.0, 10.0, 22.0, 1000.0


def frequency_plots(f: Numbers, panels: Sequence[Panel], *, logarithmic: int = 0) -> Markup:
    """Draw panels above one another over frequencies [Hz], the axis logarithmic, that of so many panels' values too."""
    legend = " ".join(
        f'<span class="nowrap"><svg width="26" height="10"><path d="M1 5h24" style="{_stroke(line, 2.5)}"/></svg> '
        f"{escape(line.label)}</span>"
        for line in panels[0].curves
        if line.label
    )
    last = len(panels) - 1
    drawn = "".join(_plot(panel, f, is_log=k < logarithmic, last=k == last) for k, panel in enumerate(panels))
    return Markup(f'{drawn}<p class="hint">{legend}</p>')  # noqa: S704 - texts are escaped where they are put in


def _stroke(line: Curve, width: float) -> str:
    dash = ";stroke-dasharray:{} {}".format(*line.dash) if line.dash else ""
    return f"fill:none;stroke:var(--{line.colour});stroke-width:{width}{dash}"


def _plot(plot: Panel, f: Numbers, *, is_log: bool, last: bool) -> str:
    """One panel; its values reach as far as the first curve does, with some room, unless it says how far."""
    low, high = float(f.min()), float(f.max())
    values = plot.curves[0].y[np.isfinite(plot.curves[0].y)]
    bottom, top = float(values.min()), float(values.max())
    room = max(0.1 * (top - bottom), 10.0)
    bottom, top = plot.span or ((bottom / 2.0, top * 2.0) if is_log else (bottom - room, top + room))
    inner = plot.height - TOP - FOOT

    def right(f: Any) -> Any:
        return LEFT + (FULL - LEFT - RIGHT) * np.log(f / low) / math.log(high / low)

    def down(y: Any) -> Any:
        share = np.log(y / bottom) / math.log(top / bottom) if is_log else (y - bottom) / (top - bottom)
        return TOP + inner * (1.0 - share)

    parts: list[str] = []
    for tick, text in _decades(low, high):
        at = right(tick)
        parts.append(f'<path d="M{at:.1f} {TOP}V{plot.height - FOOT}" style="stroke:var(--grid)"/>')
        if text:
            parts.append(f'<text x="{at:.1f}" y="{plot.height - 6}" text-anchor="middle">{text}</text>')
    for value, text in _powers(bottom, top) if is_log else _steps(bottom, top):
        at = down(value)
        parts.append(f'<path d="M{LEFT} {at:.1f}H{FULL - RIGHT}" style="stroke:var(--grid)"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{text}</text>')
    for level, _ in plot.levels:
        parts.append(
            f'<path d="M{LEFT} {down(level):.1f}H{FULL - RIGHT}" style="stroke:var(--soft);stroke-dasharray:3 3"/>'
        )
    wide = FULL - LEFT - RIGHT
    clip = f'<svg x="{LEFT}" y="{TOP}" width="{wide}" height="{inner}" viewBox="{LEFT} {TOP} {wide} {inner}">'
    curves = "".join(f'<path d="{_path(right(f), down(one.y))}" style="{_stroke(one, 1.8)}"/>' for one in plot.curves)
    foot = f'<text x="{FULL / 2}" y="{plot.height + 14}" text-anchor="middle">frequency [Hz]</text>' if last else ""
    height = plot.height + (18 if last else 0)
    turned = f"translate(14 {TOP + inner / 2:.0f}) rotate(-90)"
    side = f'<text transform="{turned}" text-anchor="middle">{escape(plot.label)}</text>'
    return (
        f'<svg viewBox="0 0 {FULL:.0f} {height}" role="img" aria-label="{escape(plot.label)} over the frequency" '
        f'style="display:block;width:100%;height:auto;font:12px system-ui,sans-serif;fill:var(--soft)">'
        f"{''.join(parts)}{clip}{curves}</svg>{side}{foot}</svg>"
    )


def _path(x: Numbers, y: Numbers) -> str:
    """A line through points, broken where one is missing."""
    known = np.isfinite(y)
    pens = np.where(np.r_[False, known[:-1]], "L", "M")
    return "".join(f"{pen}{a:.1f} {b:.1f}" for pen, a, b in zip(pens[known], x[known], y[known], strict=True))


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
    f, size = response.frequency[told], np.abs(response.response[told])
    if len(f) < FEWEST_LINES or f[-1] < BROADEST * f[0]:
        return False
    apart = np.abs(np.diff(np.log(size * f**2)))
    return bool(np.mean(apart < math.log(2.0)) > AGREEING)


def bode_plot(r: FrequencyResponse, constants: Constants | None) -> Markup:
    """Magnitude, phase and coherence over the frequency, beside the rigid axis of the identified constants."""
    every = max(1, -(-len(r) // MOST_LINES))
    f, response, coherence = r.frequency[::every], r.response[::every], r.coherence[::every]
    model = respond(constants, f) if constants is not None else None
    size = [Curve(label="recorded", colour="speed", y=np.abs(response))]
    angle = [Curve(label="", colour="speed", y=_phase(response, model))]
    if model is not None:
        turned = np.degrees(np.unwrap(np.angle(model)))
        size.append(Curve(label="mass and viscous friction", colour="left", y=np.abs(model), dash=(6, 4)))
        angle.append(Curve(label="", colour="left", y=turned, dash=(6, 4)))
    explained = Curve(label="", colour="good", y=coherence)
    unit = f"{unit_text(r.output_unit) or '1'}/{unit_text(r.input_unit) or '1'}"
    panels = [
        Panel(name="", label=f"magnitude [{unit}]", curves=size, height=260),
        Panel(name="", label="phase [deg]", curves=angle, height=180),
        Panel(name="", label="coherence", curves=[explained], span=(0.0, 1.05), height=130, levels=[(COHERENT, "")]),
    ]
    return frequency_plots(f, panels, logarithmic=1)


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
