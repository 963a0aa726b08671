"""The page about an identification: what can be trusted, what cannot and why, and how well unseen data is met."""

from collections.abc import Sequence

from markupsafe import Markup

from detent.identify.fit.equations import Run
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.identification import Identification, Verdict
from detent.identify.page import words
from detent.identify.page.compared import effort_figures, friction_figures, hold_out, simulated_figures, windows_of
from detent.identify.page.constants import constant_figures, correlation_figures, ladder_figures
from detent.identify.page.response import response_figures
from detent.logs.log import Action, Log, Severity, tell_rows
from detent.page.chart import Band, Chart, Panel, Timeline, spans_of, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Level, Page, Section, card
from detent.page.parts import Note
from detent.page.table import Table
from detent.page.words import GAP, count, duration, further, number, percent

LOOKS: dict[Verdict, Level] = {"trusted": "good", "partly trusted": "warn", "refused": "bad"}
# Constants in large type.
ON_CARDS = {"mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative"}
MOST_NAMES = 12  # recordings that have a line of their own in the small print
MOST_LOGS = 30  # recordings listed one by one
MOST_FINDINGS = 60  # findings listed one by one
MOST_BANDS = 200  # stretches marked in a chart; closer ones are drawn as one
TALL = 12  # rows from which on a table scrolls inside
Heads = list[tuple[str, bool]]  # of a table
_COLOURS = {Severity.ERROR: "bad", Severity.WARNING: "warn", Severity.NOTE: "soft"}


def identify_page(found: Identification, remarks: Sequence[str] = ()) -> Page:
    """Put the page together; figures over time are of the log that is simulated worst."""
    held, windows = hold_out(found), windows_of(found)
    shown = max(range(len(held)), key=lambda k: held[k].rms_restarted) if held else 0
    ways, effort_unit = words.Ways(found.runs[0].position_unit), found.runs[0].effort_unit
    first, more = found.logs[0].name, len(found.logs) - 1
    title = f"{first} and {more} more" if more else first
    # What concerns all constants stands right below the verdict.
    general = [r for r in found.refusals if not r.constants]
    return Page(
        title=f"{title}: {found.verdict}",
        headline=_headline(found, title, ways),
        cards=_cards(found, ways),
        notes=[
            *(Note("error", f"{words.sentence(r.subject)}: {r.text}. Do: {r.record}.") for r in general),
            *(Note("warning", f"{words.sentence(text)}.") for text in remarks),
        ],
        sections=[
            Section("Constants", constant_figures(found)),
            Section("Findings in the log", recording_figures(found, shown, simulated=bool(held))),
            Section("What to record instead", refused_figures(found)),
            Section("Measured and simulated", simulated_figures(found, held, shown)),
            Section(
                f"{words.sentence(found.runs[0].effort_name)}, measured and fitted",
                effort_figures(found, windows, shown),
            ),
            Section("Friction versus speed", friction_figures(found.constants, windows, effort_unit, ways)),
            Section("Model selection", ladder_figures(found)),
            Section("Correlation of the constants", correlation_figures(found.constants, found.estimates)),
            Section("Frequency response", response_figures(found, shown)),
        ],
        settings=_settings(found),
    )


def _headline(found: Identification, title: str, ways: words.Ways) -> Headline:
    kicker = f"Constants of an axis, identified from {count(len(found.logs), 'recording')}"
    verdict = words.sentence(found.verdict)
    return Headline(level=LOOKS[found.verdict], verdict=verdict, name=title, kicker=kicker, lead=_lead(found, ways))


def _lead(found: Identification, ways: words.Ways) -> str:
    if found.verdict == "refused":
        general = [r for r in found.refusals if not r.constants]
        subjects = dict.fromkeys(r.subject for r in general or found.refusals)
        return f"No constant of this log can be trusted: {'; '.join(subjects)}. What to record instead is listed below."
    good = f"{count(len(found.trusted), 'constant')} can be trusted"
    first = f"All {good}." if found.verdict == "trusted" else f"{good}; not {_listed(_missing(found))}."
    if not (h := _telling(found.horizons)):
        return first
    return (
        f"{first} Validated on the last quarter of the recording, held out from the fit: simulated for {h.name}, the "
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
        f"{words.constant_name(kind)} in both directions" if kind in both else words.constant_name(e.name, e.unit)
        for kind, e in zip(kinds, left, strict=True)
    ]
    return list(dict.fromkeys(names))


def _listed(names: list[str]) -> str:
    if len(names) > 3:
        return f"{', '.join(names[:3])} and {len(names) - 3} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _cards(found: Identification, ways: words.Ways) -> list[Card]:
    if found.verdict == "refused" or found.fit is None:
        return []
    shown = [_constant_card(e, trusted=e in found.trusted) for e in found.estimates if e.name in ON_CARDS]
    if h := _telling(found.horizons):
        below = f"simulated; {ways.error(h.naive)} without a model"
        shown.append(card(f"Off after {h.name}", ways.error(h.rms), below))
    return shown


def _constant_card(e: Estimate, *, trusted: bool) -> Card:
    text = words.written(e)
    name = words.constant_name(e.name, e.unit)
    if e.name.partition(".")[2]:
        sign = "+" if e.name.endswith("positive") else "\u2212"
        name = f"{name.partition(' in ')[0]} {sign}"
    below = f"±{GAP}{percent(words.relative_half(e))}" if words.is_known(e) else ""
    below = below if trusted else f"{below} not trusted".strip()
    return Card(words.sentence(name), text.value if words.is_known(e) else "\u2013", text.unit, below, bad=not trusted)


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


def recording_figures(found: Identification, shown: int, *, simulated: bool) -> list[Figure]:
    """What one log holds over time, the faults of all, what was read from which column."""
    run, log = found.runs[shown], found.logs[shown]
    share = 1.0 - float(run.usable.mean())
    told = f"{share:.0%}" if share >= 0.01 else f"{share:.2%}"  # a few windows that stick out are few samples
    used = f"Shaded: {told} of the samples, which are not used." if share > 0.0 else "Every sample is used."
    caption = f"{log.name}: {duration(float(run.t[-1]))} at {1.0 / run.step:.4g} Hz. {used}"
    listed = [_log_figure(found.logs, shown, simulated=simulated)] if len(found.logs) > 1 else []
    return [
        Figure(title="Recorded signals", caption=caption, charts=recorded_charts(run)),
        _fault_figure(found),
        *listed,
        _column_figure(log),
    ]


def recorded_charts(run: Run) -> list[Chart]:
    """Draw what was recorded: position with its reference, and effort; samples that are not used are marked."""
    place, scale = words.Ways(run.position_unit).place, words.effort_scale(run.effort_unit, words.peak_of(run.effort))
    curves = [words.scaled("position", "speed", run.position, place)]
    if run.reference is not None:
        curves.append(words.scaled("reference", "left", run.reference, place, dash=(5, 4)))
    effort = [words.scaled(run.effort_name, "drive", run.effort, scale)]
    unused: list[tuple[float, float]] = []
    for begin, end in spans_of(run.t, ~run.usable):
        # Stretches closer together than can be seen are one.
        near = unused and begin - unused[-1][1] < float(run.t[-1]) / MOST_BANDS
        unused.append((unused.pop()[0] if near else begin, end))
    bands = [Band(label="not used", colour="brake", spans=unused)]
    above, below = words.label_of("position", place.name), words.label_of(run.effort_name, scale.name)
    return time_charts(Timeline(name="recorded", t=run.t, label=words.SINCE, unit="s", bands=bands), [
        Panel(name="recorded-position", label=above, curves=curves, zero=True),
        Panel(name="recorded-effort", label=below, curves=effort, height=170, zero=True),
    ])  # fmt: skip


def _fault_figure(found: Identification) -> Figure:
    several = len(found.logs) > 1
    told = [(log, finding) for severity in _COLOURS for log in found.logs for finding in log.findings
            if finding.severity is severity]  # fmt: skip
    if not told:
        more = (
            "what the motion itself shows is listed below" if found.refusals else "no gaps, jumps, wrong signs or units"
        )
        return Figure(title="Faults", drawing=Markup("<p>None found in the file: {}.</p>").format(more))
    heads = [("", False), ("rows", False), ("signal", False), ("what", False), ("what was done", False), ("do", False)]
    rows: list[list[str]] = []
    for log, finding in told[:MOST_FINDINGS]:
        look = Markup('<b style="color:var(--{})">{}</b>').format(_COLOURS[finding.severity], finding.severity.value)
        what = Markup("<b>{}</b>: {}").format(finding.kind.value, finding.text)
        done = "unchanged" if finding.action is Action.LEFT else finding.action.value
        where = f"{log.name}: {tell_rows(finding.rows)}" if several else tell_rows(finding.rows)
        rows.append([look, where, finding.signal or "all", what, done, finding.advice or "nothing"])
    caption = "Rows are counted from 1 below the header of the file."
    return _listing("Faults", caption, heads, rows, (len(told), "finding"))


def _listing(title: str, caption: str, heads: Heads, rows: list[list[str]], every: tuple[int, str]) -> Figure:
    """A table that scrolls where it is long, and how many of all there are it does not list."""
    hint = f"{further(every[0] - len(rows), every[1])} not listed." if every[0] > len(rows) else ""
    return Figure(title=title, caption=caption, table=Table(heads=heads, rows=rows, tall=len(rows) > TALL), hint=hint)


def _log_figure(logs: Sequence[Log], shown: int, *, simulated: bool) -> Figure:
    heads = [("recording", False), ("samples", True), ("time", True), ("faults", True)]
    rows = [
        [log.name, count(len(log)), duration(float(log.t[-1] - log.t[0])), count(len(log.findings))]
        for log in logs[:MOST_LOGS]
    ]
    worst = ", whose last quarter has the largest simulation error" if simulated else ""
    caption = f"All are fitted together. Figures over time show {logs[shown].name}{worst}."
    return _listing("Recordings", caption, heads, rows, (len(logs), "recording"))


def _column_figure(log: Log) -> Figure:
    heads = [("signal", False), ("column", False), ("unit in the file", False), ("used as", False)]
    rows = [
        [role, Markup("<code>{}</code>").format(source.column), words.unit_text(source.unit),
         words.unit_text(log.units.get(role, ""))]
        for role, source in log.columns.items()
    ]  # fmt: skip
    guessed = Markup().join(Markup("<li>{}</li>").format(text) for text in log.guesses)
    return Figure(
        title="Columns",
        caption="What was read, and what had to be guessed because the file does not state it. Correct any wrong "
        "guess.",
        drawing=Markup("<ul>{}</ul>").format(guessed) if guessed else None,
        table=Table(heads=heads, rows=rows),
    )


def refused_figures(found: Identification) -> list[Figure]:
    """What is not trusted, why, and what would tell it."""
    if not found.refusals:
        return []
    units = {e.name: e.unit for e in found.estimates}
    heads = [("problem", False), ("what was found", False), ("what to do", False), ("constants affected", False)]
    bold = Markup("<b>{}</b>")
    rows: list[list[str]] = []
    for r in found.refusals:
        lost = "; ".join(words.constant_name(name, units.get(name, "")) for name in r.constants)
        rows.append([bold.format(r.subject), r.text, bold.format(r.record), lost or "all constants"])
    caption = (
        "A constant that the recording does not determine is refused rather than guessed. Each row says what to "
        "record to determine it."
    )
    return [Figure(title="Refused", caption=caption, table=Table(heads=heads, rows=rows))]
