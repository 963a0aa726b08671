"""Sections of the report of an identification: the model beside unseen data, and which model the data tell."""

import math
from html import escape

import numpy as np

from detent.identify.page.identify_charts import ways_of
from detent.identify.page.identify_data import IdentifyReportData
from detent.identify.page.identify_drawings import heat_map, long_bar, signed
from detent.identify.page.identify_words import constant_name, is_known, sentence
from detent.methods.cascade.units import percent
from detent.page.page import ZOOM_HINT, chart_slot, figure, section, side_by_side
from detent.page.parts import Numbers
from detent.page.words import GAP, count, duration, further, number, table

ALIKE = 0.9
"""Correlation of two constants from which on the data hardly separate them."""

MOST_PAIRS = 4
"""Pairs told in words."""


def model_sections(data: IdentifyReportData) -> list[str]:
    """Sections about the model: its tests, what it makes of the effort, which one it is, what it cannot tell apart."""
    return [_held(data), _horizons(data), _effort(data), _friction(data), _ladder(data), _correlation(data)]


# ---- tests on unseen data


def _held(data: IdentifyReportData) -> str:
    if not data.held:
        return ""
    held, error = data.held[data.shown], ways_of(data).error
    name = data.found.logs[data.shown].name
    worst = (
        f"Of {count(len(data.held), 'recording')} the one with the largest errors, {escape(name)}. "
        if len(data.held) > 1
        else ""
    )
    caption = (
        f"{worst}A simulated axis with constants from the first three quarters of the recording, along its last "
        "quarter. It gets the recorded effort and nothing else; no controller holds it, so every error adds up. "
        f"<b>Restarted every {held.restart:.3g}{GAP}s it is {error(held.rms_restarted)} off on average (rms), "
        f"in one piece {error(held.rms_free)}.</b> Where the curves lie on one another the model does what the axis "
        "did."
    )
    slots = "".join(
        chart_slot(slot, label)
        for slot, label in (
            ("held-position", "position, recorded and simulated"),
            ("held-restarted", "difference with restarts"),
            ("held-free", "difference in one piece"),
        )
    )
    return section("Measured and simulated", figure("On the part that the fit did not see", caption, slots, ZOOM_HINT))


def _horizons(data: IdentifyReportData) -> str:
    found = data.found
    if not found.horizons:
        return ""
    error = ways_of(data).error
    heads = [
        ("simulated for", False), ("starts", True), ("simulated, rms", True), ("largest", True),
        ("without a model, rms", True), ("simulated over without a model", False), ("way of the axis, rms", True),
    ]  # fmt: skip
    rows: list[list[str]] = []
    for h in found.horizons:
        share = h.rms / h.naive if h.naive > 0.0 else math.nan
        name = f"free run, {duration(float(h.duration))}" if h.name == "free run" else h.name
        bar = long_bar(share / 1.5, percent(share), chosen=share < 1.0)
        rows.append(
            [escape(name), count(h.starts), error(h.rms), error(h.largest), error(h.naive), bar, error(h.moved)]
        )
    caption = (
        "How far off the axis is at the end of a simulated stretch that starts where the recording says it was. "
        "<b>Without a model</b> it would go on with the velocity it started with: a model that is worth something is "
        "far below 100&#8239;%. One step shows little but the noise of the encoder; the free run is one stretch, and "
        "its errors are over all of it."
    )
    return figure("How far it can be foretold", caption, table(heads, rows))


# ---- effort, friction


def _effort(data: IdentifyReportData) -> str:
    fit = data.found.fit
    if fit is None or not data.windows or not len(data.windows[data.shown].t):
        return ""
    left = float(np.sqrt(np.mean(fit.residual**2) / np.mean(fit.effort**2)))
    width = data.windows[data.shown].width * 1e3
    caption = (
        f"The model's effort beside the recorded one, both averaged over windows of {number(width)}{GAP}ms; windows "
        "with standstill, a reversal or missing samples are left out. "
        f"<b>{percent(left)} of the effort (rms) stays unexplained.</b> What repeats in the residual is what the "
        "model lacks: a force that depends on the position, cogging, another friction."
    )
    slots = chart_slot("effort-both", "effort, recorded and by the model") + chart_slot("effort-left", "residual")
    beside = side_by_side({
        "How large residuals are": chart_slot("residual-sizes", "histogram of residuals"),
        "How much they resemble earlier ones": chart_slot("residual-memory", "autocorrelation of residuals"),
    })  # fmt: skip
    told = (
        "Left: one hump around 0 is as it should be; the outermost bars hold all that is larger. Right: beyond the "
        "overlap of the windows bars within the dashed lines are noise; bars that stay outside tell of something that "
        "the model lacks. The limits of the constants count with that."
    )
    return section(
        f"{sentence(data.found.runs[0].effort_name)}, measured and fitted",
        figure("Over time", caption, slots, ZOOM_HINT),
        figure("Residuals", told, beside),
    )


def _friction(data: IdentifyReportData) -> str:
    if not data.windows or data.found.constants is None:
        return ""
    weight = " and lifts its weight" if "pendulum" in data.found.constants.names else ""
    caption = (
        f"Each ring is a window of the recording: its effort less what accelerates the axis{weight}. The line is the "
        "friction of the model, with its 95&#8239;% interval. Rings that leave the line together, at low speeds above "
        "all, tell of a friction that the model lacks."
    )
    slot = chart_slot("friction-map", "friction over the velocity")
    return section("Friction over the speed", figure("Measured and by the model", caption, slot))


# ---- which model, and what cannot be separated


def _ladder(data: IdentifyReportData) -> str:
    found = data.found
    if not found.climbs:
        return ""
    longest = max(c.error for c in found.climbs)
    chosen = found.rung
    heads = [("model", False), ("error on stretches it did not see, over the effort", False), ("", False)]
    rows: list[list[str]] = []
    for c in found.climbs:
        bar = long_bar(c.error / longest, percent(c.error), chosen=c.rung is chosen)
        rows.append(
            [escape(sentence(c.rung.text)), bar, _step_text(c.gain, possible=c.possible, chosen=c.rung is chosen)]
        )
    caption = (
        "Each model is fitted to all of the recording but one stretch and foretells that one, stretch by stretch. A "
        "larger model is taken only if it foretells better; a better fit alone would not do."
    )
    return section("Which model", figure("Models from the simplest up", caption, table(heads, rows)))


def _step_text(gain: float, *, possible: bool, chosen: bool) -> str:
    if chosen:
        return '<span style="color:var(--good)"><b>✔ chosen</b></span>'
    if not possible:
        return "its friction would fall towards standstill: not physical"
    if math.isnan(gain):
        return "the simplest"
    if gain > 0.0:
        return f"better than the one before by {number(gain, 2)} standard errors"
    return "no better"


def _correlation(data: IdentifyReportData) -> str:
    constants = data.found.constants
    if constants is None:
        return ""
    known = {e.name for e in data.found.estimates if is_known(e)}
    kept = [k for k, name in enumerate(constants.names) if name in known]
    if len(kept) < 2:
        return ""
    units = {e.name: e.unit for e in data.found.estimates}
    names = [constant_name(constants.names[k], units[constants.names[k]]) for k in kept]
    r = constants.correlation[np.ix_(kept, kept)]
    caption = (
        "Errors of two constants with a correlation near 1 or \u22121 go together: the recording tells their sum or "
        "difference better than each of them. Their limits allow for that."
    )
    content = _pairs_told(names, r) + heat_map(names, r, limit=ALIKE)
    return section("What the recording separates", figure("Correlation of the constants", caption, content))


def _pairs_told(names: list[str], r: Numbers) -> str:
    """Which constants the recording hardly separates, the closest first."""
    pairs = [(i, j) for i in range(len(r)) for j in range(i + 1, len(r)) if abs(r[i, j]) > ALIKE]
    if not pairs:
        return f"<p><b>None above {ALIKE}: the recording tells all constants apart.</b></p>"
    pairs.sort(key=lambda pair: -abs(float(r[pair])))
    items = "".join(f"<li>{_pair_text(names[i], names[j], float(r[i, j]))}</li>" for i, j in pairs[:MOST_PAIRS])
    more = f"<li>{further(len(pairs) - MOST_PAIRS, 'pair')} framed below.</li>" if len(pairs) > MOST_PAIRS else ""
    advice = (
        "More different speeds, slow ones too, separate the parts of friction; short ramps separate mass and delay."
    )
    return f"<p><b>Hardly separated, above {ALIKE}:</b></p><ul>{items}{more}</ul><p>{advice}</p>"


def _pair_text(one: str, other: str, r: float) -> str:
    so = "if one is too large, so is the other" if r > 0 else "if one is too large, the other is too small"
    return f"{escape(one)} and {escape(other)} ({signed(r)}): {so}"
