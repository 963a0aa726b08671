"""Figure of the report of an identification: the frequency response, where the excitation tells one."""

import math

import numpy as np
from markupsafe import Markup

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse, response_of
from detent.identify.fit.constants import Constants
from detent.identify.fit.identification import Identification
from detent.identify.page.bode import Line, Plot, frequency_plots
from detent.identify.page.words import unit_text
from detent.page.figure import Figure
from detent.page.parts import Numbers

COHERENT = 0.8  # coherence of a line that tells something
FEWEST_LINES = 10  # coherent lines without which there is no Bode plot
AGREEING = 0.9  # share of neighbouring lines whose accelerations are less than a factor of 2 apart, at least
BROADEST = 3.0  # highest over lowest coherent frequency, at least
MOST_LINES = 800  # frequencies drawn


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
