"""The page about an identification: what can be trusted, what cannot and why, and how well unseen data is met."""

from html import escape
from typing import Literal

from detent.identify.fit.estimate import Estimate
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.identification import Verdict
from detent.identify.page.identify_charts import all_charts, ways_of
from detent.identify.page.identify_data import IdentifyReportData
from detent.identify.page.identify_drawings import interval_bar, reach_of
from detent.identify.page.identify_figures import model_sections
from detent.identify.page.identify_log import log_sections
from detent.identify.page.identify_response import response_section
from detent.identify.page.identify_words import (
    UNKNOWN,
    constant_name,
    is_known,
    may_be_zero,
    meaning_of,
    relative_half,
    sentence,
    written,
)
from detent.methods.cascade.units import percent
from detent.page.page import Card, Page, cards, figure, headline, notes, section, small_print
from detent.page.parts import Note
from detent.page.words import GAP, count, number, table

LOOKS: dict[Verdict, Literal["good", "warn", "bad"]] = {"trusted": "good", "partly trusted": "warn", "refused": "bad"}


def identify_page(data: IdentifyReportData) -> Page:
    """Put the page together."""
    log, record = log_sections(data)
    return {
        "title": f"{data.title}: {data.found.verdict}",
        "body": [
            _headline(data), _cards(data), notes(_notes(data)), _constants(data), log, record,
            *model_sections(data), response_section(data), small_print(_settings(data)),
        ],
        "charts": all_charts(data),
    }  # fmt: skip


# ---- what came out, in one glance


def _headline(data: IdentifyReportData) -> str:
    found = data.found
    recordings = count(len(found.logs), "recording")
    level = LOOKS[found.verdict]
    kicker = f"Constants of an axis, identified from {recordings}"
    verdict = found.verdict[:1].upper() + found.verdict[1:]
    return headline(level, verdict, data.title, kicker=kicker, lead=_lead(data))


def _lead(data: IdentifyReportData) -> str:
    found = data.found
    if found.verdict == "refused":
        subjects = list(dict.fromkeys(r.subject for r in found.refusals if not r.constants)) or [
            r.subject for r in found.refusals
        ]
        return f"No constant of this log can be trusted: {'; '.join(subjects)}. Below stands what to record instead."
    good = count(len(found.trusted), "constant")
    if found.verdict == "trusted":
        first = f"All {good} can be trusted."
    else:
        first = f"{good} can be trusted; not {_listed(_missing(data))}."
    return f"{first} {_tested(data)}".strip()


def _tested(data: IdentifyReportData) -> str:
    """The simulation over a second, or what is next to it, in a sentence."""
    h = _telling(data.found.horizons)
    if h is None:
        return ""
    error = ways_of(data).error
    return (
        f"Tested on the last quarter of the recording, which the fit had not seen: simulated for {h.name}, the axis "
        f"ends {error(h.rms)} from where it was; without a model it would be {error(h.naive)}."
    )


def _telling(horizons: tuple[Horizon, ...]) -> Horizon | None:
    timed = [h for h in horizons if h.name not in {"one step", "free run"} and h.duration <= 1.01]
    return timed[-1] if timed else None


def _missing(data: IdentifyReportData) -> list[str]:
    """Names of what is not trusted, both directions in one."""
    left = [e for e in data.found.estimates if e not in data.found.trusted]
    kinds = [e.name.partition(".")[0] for e in left]
    both = {kind for kind in kinds if kind != "pendulum" and kinds.count(kind) > 1}
    names = [
        f"{constant_name(kind)} in both directions" if kind in both else constant_name(e.name, e.unit)
        for kind, e in zip(kinds, left, strict=True)
    ]
    return list(dict.fromkeys(names))


def _listed(words: list[str]) -> str:
    if len(words) > 3:
        return f"{', '.join(words[:3])} and {len(words) - 3} more"
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _cards(data: IdentifyReportData) -> str:
    found = data.found
    if found.verdict == "refused" or found.fit is None:
        return ""
    shown = [
        _constant_card(data, e)
        for e in found.estimates
        if e.name in {"mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative"}
    ]
    h = _telling(found.horizons)
    if h is not None:
        value, _, unit = ways_of(data).error(h.rms).partition(GAP)
        shown.append(
            Card(f"Off after {h.name}", value, unit, f"simulated; {ways_of(data).error(h.naive)} without a model")
        )
    return cards(shown)


def _constant_card(data: IdentifyReportData, e: Estimate) -> Card:
    text = written(e)
    trusted = e in data.found.trusted
    name = constant_name(e.name, e.unit)
    if e.name.partition(".")[2]:
        sign = "+" if e.name.endswith("positive") else "\u2212"
        name = f"{name.partition(' in ')[0]} {sign}"
    below = f"±{GAP}{percent(relative_half(e))}" if is_known(e) else ""
    below = below if trusted else f"{below} not trusted".strip()
    return Card(sentence(name), text.value if is_known(e) else "\u2013", text.unit, below, bad=not trusted)


def _notes(data: IdentifyReportData) -> list[Note]:
    """What concerns all constants, right below the verdict."""
    return [
        Note("error", f"{sentence(r.subject)}: {r.text}. Do: {r.record}.")
        for r in data.found.refusals
        if not r.constants
    ]


# ---- constants


def _constants(data: IdentifyReportData) -> str:
    found = data.found
    if not found.estimates:
        return ""
    told = [e for e in found.trusted or found.estimates if is_known(e) and not may_be_zero(e)]
    reach = reach_of(told)
    heads = [
        ("constant", False), ("value and 95 % limits", True), (f"interval, scale ±{percent(reach)}", False),
        ("", True), ("trusted", False),
    ]  # fmt: skip
    rows = [_constant_row(data, e, reach) for e in found.estimates]
    caption = (
        "With a chance of 95&#8239;% the true value lies within the limits. They allow for residuals that depend on "
        "one another, and for other models that explain the recording as well. The bar is the interval over the value: "
        "short is good, arrows mean wider than the scale."
    )
    if found.verdict == "refused":
        caption = "<b>For diagnosis only: none of these is to be used.</b> " + caption
    return section("Constants", figure(f"Model: {_model(data)}", caption, table(heads, rows)))


def _model(data: IdentifyReportData) -> str:
    rung = data.found.rung
    return rung.text if rung else "none"


def _constant_row(data: IdentifyReportData, e: Estimate, reach: float) -> list[str]:
    trusted = e in data.found.trusted
    meaning = meaning_of(e.name)
    name = f"{escape(constant_name(e.name, e.unit))} <code>{escape(e.name)}</code>"
    if meaning:
        name += f'<br><small style="color:var(--soft)">{escape(meaning)}</small>'
    value = escape(str(written(e))) if is_known(e) else "not known"
    share = f"±{GAP}{percent(relative_half(e))}" if is_known(e) and relative_half(e) < UNKNOWN else "\u2013"
    return [name, value, interval_bar(e, reach, trusted=trusted), share, _why(data, e, trusted=trusted)]


def _why(data: IdentifyReportData, e: Estimate, *, trusted: bool) -> str:
    if trusted:
        word = '<span style="color:var(--good)" class="nowrap">✔ yes</span>'
        zero = ", but may be 0" if may_be_zero(e) else ""
        return word + zero
    reasons = [r for r in data.found.refusals if e.name in r.constants]
    general = [r for r in data.found.refusals if not r.constants]
    texts = list(dict.fromkeys(r.subject for r in (reasons or general)))
    return f'<span style="color:var(--bad)" class="nowrap">✘ no</span>: {escape(", ".join(texts))}'


def _settings(data: IdentifyReportData) -> dict[str, str]:
    found = data.found
    told = {f"recording {k + 1}" if len(found.logs) > 1 else "recording": log.name for k, log in enumerate(found.logs)}
    if len(told) > 12:
        told = {"recordings": ", ".join(log.name for log in found.logs)}
    if found.fit is not None:
        told["method"] = "; ".join(found.notes)
        degrees = found.fit.degrees.tolist()
        told["degrees of freedom"] = f"{min(degrees):.0f} to {max(degrees):.0f} behind an interval"
        told["condition number"] = number(found.fit.condition)
    return told
