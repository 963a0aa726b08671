"""Figure of the report of an identification: the frequency response, where the excitation tells one."""

import math
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from detent.identify.analyse.measure_response import COHERENT, FrequencyResponse, told_response
from detent.identify.fit.constants import Constants
from detent.identify.fit.identification import Identification
from detent.identify.page.words import unit_text
from detent.page.chart import Chart, Curve, Panel, line_chart
from detent.page.figure import Figure
from detent.page.parts import Numbers

MOST_LINES = 800  # frequencies drawn


def response_figures(found: Identification, shown: int) -> list[Figure]:
    """Bode plot with coherence, or a sentence why there is none."""
    run = found.runs[shown]
    response = told_response(found.logs[shown], run.effort_name, is_open=run.reference is None)
    if response is not None:
        caption = Markup(
            "Response of the position to the effort versus frequency. Where it rises above the dashed line of the "
            "identified mass and viscous friction there is a resonance; at low frequencies dry friction keeps it "
            "below. <b>Coherence</b> is the share of the position that the effort explains: below {} the curves above "
            "it are noise. Method: {}."
        ).format(COHERENT, response.method)
        return [Figure(title="Bode plot", caption=caption, charts=bode_charts(response, found.constants))]
    if found.verdict == "refused":
        return []
    missing = Markup(
        "<p>None: this recording does not excite a continuous frequency band, or a controller responds to noise there. "
        "A multisine or chirp, repeated three times or more, would show resonances.</p>"
    )
    return [Figure(title="Bode plot", drawing=missing)]


def bode_charts(r: FrequencyResponse, constants: Constants | None) -> list[Chart]:
    """Magnitude, phase and coherence over the frequency, beside the rigid axis of the identified constants."""
    every = max(1, -(-len(r) // MOST_LINES))
    f, response, coherence = r.frequency[::every], r.response[::every], r.coherence[::every]
    model = respond(constants, f) if constants is not None else None
    size, phase = np.abs(response), _phase(response, model)
    low, high = float(np.nanmin(phase)), float(np.nanmax(phase))
    room = max(0.1 * (high - low), 10.0)
    digits = 4 - math.floor(math.log10(float(size.min())))
    sizes = [Curve(label="recorded", colour="speed", y=size, digits=digits)]
    phases = [Curve(label="recorded", colour="speed", y=phase)]
    if model is not None:
        look = Curve(label="mass and viscous friction", colour="left", y=np.abs(model), digits=digits, dash=(6, 4))
        sizes.append(look)
        phases.append(replace(look, y=np.degrees(np.unwrap(np.angle(model)))))
    explained = Curve(label="coherence", colour="good", y=coherence)
    unit = f"{unit_text(r.output_unit) or '1'}/{unit_text(r.input_unit) or '1'}"
    # As far as the recorded curve reaches, with some room.
    panels = [
        Panel(
            name="magnitude", label=f"magnitude [{unit}]", curves=sizes, height=260,
            span=(float(size.min()) / 2.0, 2.0 * float(size.max())),
        ),
        Panel(name="phase", label="phase [deg]", curves=phases, height=180, span=(low - room, high + room)),
        Panel(
            name="coherence", label="coherence", curves=[explained], span=(0.0, 1.05), height=150,
            levels=[(COHERENT, "")],
        ),
    ]  # fmt: skip
    charts = [line_chart(panel, f, "frequency [Hz]", log="x" if k else "xy") for k, panel in enumerate(panels)]
    return [chart | {"sync": "bode"} for chart in charts]


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
