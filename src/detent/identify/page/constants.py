"""Figures of the report of an identification: constants with their limits, the model they are of, what they share."""

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import Identification
from detent.identify.fit.ladder import Climb
from detent.identify.page import words
from detent.page.figure import Figure
from detent.page.parts import Numbers
from detent.page.table import Table
from detent.page.words import GAP, further, number, percent

WIDTH, HEIGHT = 170.0, 18.0  # of the drawing of an interval [px]
REACHES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # ends of the scale of intervals, over the value
UNSCALED = ("delay", "stribeck", "loss")  # near 0 or hardly ever known well: these do not set the scale
ALIKE = 0.9  # correlation of two constants from which on the data hardly separate them
MOST_PAIRS = 4  # pairs told in words


def constant_figures(found: Identification) -> list[Figure]:
    """Every constant with its limits, and whether it is trusted."""
    if not found.estimates:
        return []
    reach = reach_of([e for e in found.trusted or found.estimates if words.is_known(e) and not e.holds(0.0)])
    heads = [
        ("constant", False), ("value and 95 % limits", True), (f"interval, scale ±{percent(reach)}", False),
        ("", True), ("trusted", False),
    ]  # fmt: skip
    warning = "<b>For diagnosis only: do not use any of these.</b> " if found.verdict == "refused" else ""
    caption = Markup(warning) + (  # noqa: S704 - our own
        "The limits are 95\u202f% confidence limits. They account for correlated residuals, and for other models that "
        "explain the recording equally well. The bar shows the interval relative to the value: short is good, "
        "arrows mean wider than the scale."
    )
    rows = [_constant_row(found, e, reach) for e in found.estimates]
    model = found.rung.text if found.rung else "none"
    return [Figure(title=f"Model: {model}", caption=caption, table=Table(heads=heads, rows=rows))]


def _constant_row(found: Identification, e: Estimate, reach: float) -> list[str]:
    trusted = e in found.trusted
    name = Markup("{} <code>{}</code>").format(words.constant_name(e.name, e.unit), e.name)
    if meaning := words.meaning_of(e.name):
        name += Markup('<br><small style="color:var(--soft)">{}</small>').format(meaning)
    value = str(words.written(e)) if words.is_known(e) else "not known"
    if e.name in found.bounded:
        value = f"an end of the search, {words.written(e).value}{GAP}{words.written(e).unit}"
    share = (
        f"±{GAP}{percent(words.relative_half(e))}"
        if words.is_known(e) and words.relative_half(e) < words.UNKNOWN
        else "\u2013"
    )
    if trusted:
        said = '<span style="color:var(--good)" class="nowrap">✔ yes</span>{}'
        why = ", but may be 0" if e.holds(0.0) else ""
    else:
        said = '<span style="color:var(--bad)" class="nowrap">✘ no</span>: {}'
        reasons = [r for r in found.refusals if e.name in r.constants] or [r for r in found.refusals if not r.constants]
        why = ", ".join(dict.fromkeys(r.subject for r in reasons))
    return [name, value, interval_bar(e, reach, trusted=trusted), share, Markup(said).format(why)]  # noqa: S704


def reach_of(estimates: Sequence[Estimate]) -> float:
    """End of the scale on which all intervals are drawn: as wide as the widest needs, delays and the like left out."""
    halves = [words.relative_half(one) for one in estimates if one.name not in UNSCALED]
    widest = max(halves, default=REACHES[-1])
    return next((reach for reach in REACHES if reach >= widest), REACHES[-1])


def interval_bar(found: Estimate, reach: float, *, trusted: bool) -> Markup:
    """Draw an interval about its value, on a scale that all constants of a table share."""
    if not words.is_known(found):
        return Markup('<span style="color:var(--bad)">undetermined</span>')
    half = words.relative_half(found) / reach
    colour = "good" if trusted else "bad"
    middle, room = WIDTH / 2, WIDTH / 2 - 8
    x = min(half, 1.0) * room
    arrow = Markup('<path d="M{:.0f} 9l{} -6v12z" style="fill:var(--{})"/>')
    arrows = [arrow.format(middle + side * (room + 7), -8 * side, colour) for side in (-1, 1)] if half > 1.0 else []
    return Markup(
        '<svg width="{:.0f}" height="{:.0f}" role="img" aria-label="plus or minus {} percent" style="display:block">'
        '<line x1="4" x2="{:.0f}" y1="9" y2="9" style="stroke:var(--rule);stroke-width:2"/>'
        '<rect x="{:.1f}" width="{:.1f}" y="4" height="10" rx="2" style="fill:var(--{});opacity:.55"/>'
        '<line x1="{:.0f}" x2="{:.0f}" y1="1" y2="17" style="stroke:var(--ink);stroke-width:2"/>{}</svg>'
    ).format(
        WIDTH, HEIGHT, number(100 * words.relative_half(found), 2), WIDTH - 4, middle - x, max(2 * x, 1.5), colour,
        middle, middle, Markup().join(arrows),
    )  # fmt: skip


def ladder_figures(found: Identification) -> list[Figure]:
    """Models, simplest first, and which was chosen."""
    if not found.climbs:
        return []
    longest = max(c.error for c in found.climbs)
    rows: list[list[str]] = []
    for climb in found.climbs:
        chosen = climb.rung is found.rung
        bar = words.long_bar(climb.error / longest, percent(climb.error), chosen=chosen)
        rows.append([words.sentence(climb.rung.text), bar, _step_text(climb, chosen=chosen)])
    caption = (
        "Cross-validation: each model is fitted to all of the recording except one segment and predicts that segment, "
        "in turn. A larger model is chosen only if it predicts better; a better fit alone is not enough."
    )
    heads = [("model", False), ("error on held-out segments, relative to the effort", False), ("", False)]
    return [Figure(title="Models, simplest first", caption=caption, table=Table(heads=heads, rows=rows))]


def _step_text(climb: Climb, *, chosen: bool) -> str:
    if chosen:
        return Markup('<span style="color:var(--good)"><b>✔ chosen</b></span>')
    if not climb.possible:
        return "its friction would decrease towards standstill: not physical"
    better = f"better than the one before by {number(climb.gain, 2)} standard errors"
    return "the simplest" if math.isnan(climb.gain) else better if climb.gain > 0.0 else "no better"


def correlation_figures(constants: Constants | None, estimates: Sequence[Estimate]) -> list[Figure]:
    """Which constants the recording hardly tells apart; nothing of fewer than two known ones."""
    if constants is None:
        return []
    units = {e.name: e.unit for e in estimates if words.is_known(e)}
    kept = [k for k, name in enumerate(constants.names) if name in units]
    if len(kept) < 2:
        return []
    names = [words.constant_name(constants.names[k], units[constants.names[k]]) for k in kept]
    r = constants.correlation[np.ix_(kept, kept)]
    caption = (
        "With a correlation near 1 or \u22121 the errors of two constants are coupled: the recording determines their "
        "sum or difference better than each of them. Their limits account for that."
    )
    told, table = _pairs_told(names, r), heat_map(names, r, limit=ALIKE)
    return [Figure(title="Correlation of the constants", caption=caption, drawing=told, table=table)]


def _pairs_told(names: Sequence[str], r: Numbers) -> Markup:
    """Which constants the recording hardly separates, the closest first."""
    pairs = [(i, j) for i in range(len(r)) for j in range(i + 1, len(r)) if abs(r[i, j]) > ALIKE]
    if not pairs:
        return Markup("<p><b>None above {}: the recording separates all constants.</b></p>").format(ALIKE)
    pairs.sort(key=lambda pair: -abs(float(r[pair])))
    texts: list[str] = []
    for i, j in pairs[:MOST_PAIRS]:
        other = "so is the other" if r[i, j] > 0 else "the other is too small"
        texts.append(f"{names[i]} and {names[j]} ({signed(float(r[i, j]))}): if one is too large, {other}")
    if len(pairs) > MOST_PAIRS:
        texts.append(f"{further(len(pairs) - MOST_PAIRS, 'pair')} framed below.")
    items = Markup().join(Markup("<li>{}</li>").format(text) for text in texts)
    return Markup(
        "<p><b>Poorly separated, above {}:</b></p><ul>{}</ul><p>More different speeds, slow ones too, separate the "
        "parts of friction; short ramps separate mass and delay.</p>"
    ).format(ALIKE, items)


def heat_map(names: Sequence[str], correlation: Numbers, *, limit: float) -> Table:
    """A correlation table whose cells are the darker the closer they come to 1 or -1."""
    heads = [("", False), *((str(k), True) for k in range(1, len(names) + 1))]
    rows = [
        [f"{k + 1} {name}", *(_heat_cell(float(r), limit, own=k == j) for j, r in enumerate(correlation[k]))]
        for k, name in enumerate(names)
    ]
    return Table(heads=heads, rows=rows)


def _heat_cell(value: float, limit: float, *, own: bool) -> Markup:
    if own:
        return Markup('<span style="color:var(--muted)">1</span>')
    frame = ";font-weight:700;outline:2px solid var(--bad)" if abs(value) > limit else ""
    shade = f"color-mix(in srgb, var(--{'right' if value > 0 else 'left'}) {round(70 * abs(value))}%, transparent)"
    look = f"display:block;padding:0 .3em;background:{shade}{frame}"
    return Markup('<span style="{}">{}</span>').format(look, signed(value))


def signed(value: float) -> str:
    """Write a correlation with its sign.

    >>> signed(0.917), signed(-0.001)
    ('+0.92', '0.00')
    """
    text = f"{value:+.2f}"
    return "0.00" if text in {"+0.00", "-0.00"} else text.replace("-", "\u2212")
