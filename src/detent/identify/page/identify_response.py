"""Section of the report of an identification: the frequency response, where the excitation tells one."""

from html import escape

import numpy as np

from detent.identify.analyse.frequency_response import FrequencyResponse
from detent.identify.page.identify_bode import Line, Plot, frequency_plots
from detent.identify.page.identify_data import COHERENT, IdentifyReportData
from detent.identify.page.identify_model import respond
from detent.identify.page.identify_words import unit_text, written
from detent.page.page import figure, section
from detent.page.parts import Numbers
from detent.page.words import number, table

MOST_LINES = 800
"""Frequencies drawn."""

_NAMES = {
    "resonance": "resonance",
    "antiresonance": "anti-resonance",
    "resonance.damping": "damping of the resonance",
    "antiresonance.damping": "damping of the anti-resonance",
    "gain": "acceleration per effort",
    "viscous": "viscous friction over mass",
    "mass_ratio": "mass of the load over that of the motor",
    "mass.motor": "mass of the motor",
    "mass.load": "mass of the load",
    "mass.total": "mass of both",
}


def response_section(data: IdentifyReportData) -> str:
    """Bode plot with coherence, or a sentence why there is none."""
    title = "Frequency response"
    if data.response is None:
        if data.found.verdict == "refused":
            return ""
        caption = (
            "None: this recording does not excite a whole band of frequencies evenly, or a controller answers to noise "
            "there. "
            "A recording with a multisine or a chirp, repeated three times or more, would tell resonances."
        )
        return section(title, figure("Bode plot", caption, ""))
    return section(title, figure("Bode plot", _caption(data.response), _plots(data, data.response), _resonances(data)))


def _caption(r: FrequencyResponse) -> str:
    return (
        "How far the position answers to the effort at each frequency. Where it rises above the dashed line of the "
        "identified mass and viscous friction there is a resonance; at low frequencies dry friction holds it below. "
        f"<b>Coherence</b> is the share of the position that the effort explains: below {COHERENT} the curves above it "
        f"are noise. Method: {escape(r.method)}."
    )


def _plots(data: IdentifyReportData, r: FrequencyResponse) -> str:
    every = max(1, -(-len(r) // MOST_LINES))
    f, response, coherence = r.frequency[::every], r.response[::every], r.coherence[::every]
    model = respond(data.found.constants, f) if data.found.constants is not None else None
    fitted = _fitted(data, f)
    unit = f"{unit_text(r.output_unit) or '1'}/{unit_text(r.input_unit) or '1'}"
    size = [Line(label="recorded", colour="speed", x=f, y=np.abs(response))]
    angle = [Line(label="", colour="speed", x=f, y=_phase(response, model if fitted is None else fitted))]
    for other, label, colour, dash in (
        (model, "mass and viscous friction", "left", "6 4"),
        (fitted, "two masses", "drive", ""),
    ):
        if other is not None:
            size.append(Line(label=label, colour=colour, x=f, y=np.abs(other), dash=dash))
            angle.append(Line(label="", colour=colour, x=f, y=np.degrees(np.unwrap(np.angle(other))), dash=dash))
    explained = Line(label="", colour="good", x=f, y=coherence)
    return frequency_plots([
        Plot(label=f"magnitude [{unit}]", lines=size, logarithmic=True, height=260),
        Plot(label="phase [deg]", lines=angle, height=180),
        Plot(label="coherence", lines=[explained], span=(0.0, 1.05), height=130, levels=[COHERENT]),
    ])  # fmt: skip


def _fitted(data: IdentifyReportData, f: Numbers) -> Numbers | None:
    """The fitted model at these frequencies, of the first output."""
    found = data.resonances
    if found is None or not len(found.frequency):
        return None
    real: Numbers = np.real(found.fitted[0])
    imaginary: Numbers = np.imag(found.fitted[0])
    return np.interp(f, found.frequency, real) + 1j * np.interp(f, found.frequency, imaginary)


def _phase(response: Numbers, model: Numbers | None) -> Numbers:
    """Phase [deg], within half a turn of the model's; without one from -360 to 0, with gaps where it jumps."""
    if model is not None:
        return np.degrees(np.unwrap(np.angle(model)) + np.angle(response / model))
    phase = np.mod(np.degrees(np.angle(response)), 360.0) - 360.0
    jumps = np.abs(np.diff(phase, prepend=phase[:1])) > 180.0
    return np.where(jumps, np.nan, phase)


def _resonances(data: IdentifyReportData) -> str:
    found = data.resonances
    if found is None:
        return ""
    rows = [
        [escape(_NAMES.get(name, name.replace(".", ", "))), escape(str(written(e)))]
        for name, e in found.estimates.items()
    ]
    told = table([("constant", False), ("value and 95 % limits", True)], rows)
    doubts = f'<p class="note warning"><b>Not trusted</b>{escape(found.reason)}</p>' if found.reason else ""
    return doubts + told + f"<p>Beyond noise, {number(100 * found.scatter, 2)} % of the response is not explained.</p>"
