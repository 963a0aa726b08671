"""The page about an identification: what can be trusted, what cannot and why, and how well unseen data is met."""

from collections.abc import Sequence

from detent.identify.fit.estimate import Estimate
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.identification import Identification, Verdict
from detent.identify.page.constants import constant_figures, correlation_figures, ladder_figures
from detent.identify.page.effort import effort_figures, friction_figures, windows_of
from detent.identify.page.recordings import recording_figures, refused_figures
from detent.identify.page.response import response_figures
from detent.identify.page.simulated import hold_out, simulated_figures
from detent.identify.page.words import Ways, constant_name, is_known, relative_half, sentence, written
from detent.methods.cascade.units import percent
from detent.page.frame import Card, Headline, Level, Page, Section, card
from detent.page.parts import Note
from detent.page.words import GAP, count, number

LOOKS: dict[Verdict, Level] = {"trusted": "good", "partly trusted": "warn", "refused": "bad"}

ON_CARDS = {"mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative"}
"""Constants in large type."""

MOST_NAMES = 12  # recordings that have a line of their own in the small print


def identify_page(found: Identification) -> Page:
    """Put the page together; figures over time are of the log that is simulated worst."""
    held, windows = hold_out(found), windows_of(found)
    shown = max(range(len(held)), key=lambda k: held[k].rms_restarted) if held else 0
    ways, effort_unit = Ways(found.runs[0].position_unit), found.runs[0].effort_unit
    first, more = found.logs[0].name, len(found.logs) - 1
    title = f"{first} and {more} more" if more else first
    # What concerns all constants stands right below the verdict.
    general = [r for r in found.refusals if not r.constants]
    return Page(
        title=f"{title}: {found.verdict}",
        headline=_headline(found, title, ways),
        cards=_cards(found, ways),
        notes=[Note("error", f"{sentence(r.subject)}: {r.text}. Do: {r.record}.") for r in general],
        sections=[
            Section("Constants", constant_figures(found)),
            Section("What was found in the log", recording_figures(found, shown, simulated=bool(held))),
            Section("What to record instead", refused_figures(found)),
            Section("Measured and simulated", simulated_figures(found, held, shown)),
            Section(
                f"{sentence(found.runs[0].effort_name)}, measured and fitted", effort_figures(found, windows, shown)
            ),
            Section("Friction over the speed", friction_figures(found.constants, windows, effort_unit, ways)),
            Section("Which model", ladder_figures(found)),
            Section("What the recording separates", correlation_figures(found.constants, found.estimates)),
            Section("Frequency response", response_figures(found, shown)),
        ],
        settings=_settings(found),
    )


# ---- what came out, in one glance


def _headline(found: Identification, title: str, ways: Ways) -> Headline:
    kicker = f"Constants of an axis, identified from {count(len(found.logs), 'recording')}"
    verdict = sentence(found.verdict)
    return Headline(level=LOOKS[found.verdict], verdict=verdict, name=title, kicker=kicker, lead=_lead(found, ways))


def _lead(found: Identification, ways: Ways) -> str:
    if found.verdict == "refused":
        general = [r for r in found.refusals if not r.constants]
        subjects = dict.fromkeys(r.subject for r in general or found.refusals)
        return f"No constant of this log can be trusted: {'; '.join(subjects)}. Below stands what to record instead."
    good = count(len(found.trusted), "constant")
    if found.verdict == "trusted":
        first = f"All {good} can be trusted."
    else:
        first = f"{good} can be trusted; not {_listed(_missing(found))}."
    if not (h := _telling(found.horizons)):
        return first
    return (
        f"{first} Tested on the last quarter of the recording, which the fit had not seen: simulated for {h.name}, the "
        f"axis ends {ways.error(h.rms)} from where it was; without a model it would be {ways.error(h.naive)}."
    )


def _telling(horizons: Sequence[Horizon]) -> Horizon | None:
    """The simulation over a second, or what is next to it."""
    timed = [h for h in horizons if h.name not in {"one step", "free run"} and h.duration <= 1.01]
    return timed[-1] if timed else None


def _missing(found: Identification) -> list[str]:
    """Names of what is not trusted, both directions in one."""
    left = [e for e in found.estimates if e not in found.trusted]
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


def _cards(found: Identification, ways: Ways) -> list[Card]:
    if found.verdict == "refused" or found.fit is None:
        return []
    shown = [_constant_card(e, trusted=e in found.trusted) for e in found.estimates if e.name in ON_CARDS]
    if h := _telling(found.horizons):
        below = f"simulated; {ways.error(h.naive)} without a model"
        shown.append(card(f"Off after {h.name}", ways.error(h.rms), below))
    return shown


def _constant_card(e: Estimate, *, trusted: bool) -> Card:
    text = written(e)
    name = constant_name(e.name, e.unit)
    if e.name.partition(".")[2]:
        sign = "+" if e.name.endswith("positive") else "\u2212"
        name = f"{name.partition(' in ')[0]} {sign}"
    below = f"±{GAP}{percent(relative_half(e))}" if is_known(e) else ""
    below = below if trusted else f"{below} not trusted".strip()
    return Card(sentence(name), text.value if is_known(e) else "\u2013", text.unit, below, bad=not trusted)


def _settings(found: Identification) -> dict[str, str]:
    told = {f"recording {k}" if len(found.logs) > 1 else "recording": log.name for k, log in enumerate(found.logs, 1)}
    if len(told) > MOST_NAMES:
        told = {"recordings": ", ".join(log.name for log in found.logs)}
    if found.fit is not None:
        told["method"] = "; ".join(found.notes)
        degrees = found.fit.degrees.tolist()
        told["degrees of freedom"] = f"{min(degrees):.0f} to {max(degrees):.0f} behind an interval"
        told["condition number"] = number(found.fit.condition)
    return told
