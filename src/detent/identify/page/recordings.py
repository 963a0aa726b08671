"""Figures of the report of an identification: what the recordings hold, what is wrong with them, what to record."""

from collections.abc import Sequence

from markupsafe import Markup

from detent.identify.fit.identification import Identification
from detent.identify.fit.prepare import Run
from detent.identify.page.words import SINCE, Ways, constant_name, effort_scale, label_of, peak_of, scaled, unit_text
from detent.logs.log import Action, Log, Severity, tell_rows
from detent.page.chart import Band, Chart, Panel, Timeline, spans_of, time_charts
from detent.page.figure import Figure
from detent.page.table import Table
from detent.page.words import count, duration, further

MOST_LOGS = 30  # recordings listed one by one
MOST_FINDINGS = 60  # findings listed one by one
MOST_BANDS = 200  # stretches marked in a chart; closer ones are drawn as one
TALL = 12  # rows from which on a table scrolls inside
_COLOURS = {Severity.ERROR: "bad", Severity.WARNING: "warn", Severity.NOTE: "soft"}


def recording_figures(found: Identification, shown: int, *, simulated: bool) -> list[Figure]:
    """What one log holds over time, the faults of all, what was read from which column."""
    run, log = found.runs[shown], found.logs[shown]
    share = 1.0 - float(run.usable.mean())
    used = f"Shaded: {share:.0%} of the samples, which are not used." if share > 0.0 else "Every sample is used."
    caption = f"{log.name}: {duration(float(run.t[-1]))} at {1.0 / run.step:.4g} Hz. {used}"
    listed = [_log_figure(found.logs, shown, simulated=simulated)] if len(found.logs) > 1 else []
    return [
        Figure(title="What was recorded", caption=caption, charts=recorded_charts(run)),
        _fault_figure(found),
        *listed,
        _column_figure(log),
    ]


# ---- over time


def recorded_charts(run: Run) -> list[Chart]:
    """Draw what was recorded: position with its reference, and effort; samples that are not used are marked."""
    place, scale = Ways(run.position_unit).place, effort_scale(run.effort_unit, peak_of(run.effort))
    curves = [scaled("position", "speed", run.position, place)]
    if run.reference is not None:
        curves.append(scaled("reference", "left", run.reference, place, dash=(5, 4)))
    effort = [scaled(run.effort_name, "drive", run.effort, scale)]
    unused: list[tuple[float, float]] = []
    for begin, end in spans_of(run.t, ~run.usable):
        # Stretches closer together than can be seen are one.
        near = unused and begin - unused[-1][1] < float(run.t[-1]) / MOST_BANDS
        unused.append((unused.pop()[0] if near else begin, end))
    bands = [Band(label="not used", colour="brake", spans=unused)]
    above, below = label_of("position", place.name), label_of(run.effort_name, scale.name)
    return time_charts(Timeline(name="recorded", t=run.t, label=SINCE, unit="s", bands=bands), [
        Panel(name="recorded-position", label=above, curves=curves, zero=True),
        Panel(name="recorded-effort", label=below, curves=effort, height=170, zero=True),
    ])  # fmt: skip


# ---- faults


def _fault_figure(found: Identification) -> Figure:
    several = len(found.logs) > 1
    told = [(log, finding) for severity in _COLOURS for log in found.logs for finding in log.findings
            if finding.severity is severity]  # fmt: skip
    if not told:
        more = "what the motion itself tells stands below" if found.refusals else "no gaps, jumps, wrong signs or units"
        return Figure(title="Faults", drawing=Markup("<p>None found in the file: {}.</p>").format(more))
    heads = [("", False), ("rows", False), ("signal", False), ("what", False), ("what was done", False), ("do", False)]
    rows: list[list[str]] = []
    for log, finding in told[:MOST_FINDINGS]:
        look = Markup('<b style="color:var(--{})">{}</b>').format(_COLOURS[finding.severity], finding.severity.value)
        what = Markup("<b>{}</b>: {}").format(finding.kind.value, finding.text)
        done = "left as it is" if finding.action is Action.LEFT else finding.action.value
        where = f"{log.name}: {tell_rows(finding.rows)}" if several else tell_rows(finding.rows)
        rows.append([look, where, finding.signal or "all", what, done, finding.advice or "nothing"])
    return Figure(
        title="Faults",
        caption="Rows are counted from 1 below the header of the file.",
        table=Table(heads=heads, rows=rows, tall=len(rows) > TALL),
        hint=_not_listed(len(told) - MOST_FINDINGS, "finding"),
    )


def _not_listed(left: int, word: str) -> str:
    return f"{further(left, word)} not listed." if left > 0 else ""


# ---- recordings and columns


def _log_figure(logs: Sequence[Log], shown: int, *, simulated: bool) -> Figure:
    heads = [("recording", False), ("samples", True), ("time", True), ("faults", True)]
    rows = [
        [log.name, count(len(log)), duration(float(log.t[-1] - log.t[0])), count(len(log.findings))]
        for log in logs[:MOST_LOGS]
    ]
    worst = ", whose last quarter is simulated worst" if simulated else ""
    return Figure(
        title="Recordings",
        caption=f"All are fitted together. Figures over time show {logs[shown].name}{worst}.",
        table=Table(heads=heads, rows=rows, tall=len(rows) > TALL),
        hint=_not_listed(len(logs) - MOST_LOGS, "recording"),
    )


def _column_figure(log: Log) -> Figure:
    heads = [("signal", False), ("column", False), ("unit in the file", False), ("used as", False)]
    rows = [
        [role, Markup("<code>{}</code>").format(source.column), unit_text(source.unit),
         unit_text(log.units.get(role, ""))]
        for role, source in log.columns.items()
    ]  # fmt: skip
    guessed = Markup().join(Markup("<li>{}</li>").format(text) for text in log.guesses)
    return Figure(
        title="Columns",
        caption="What was read, and what had to be guessed because the file does not say it. State it if a guess is "
        "wrong.",
        drawing=Markup("<ul>{}</ul>").format(guessed) if guessed else None,
        table=Table(heads=heads, rows=rows),
    )


# ---- what to record


def refused_figures(found: Identification) -> list[Figure]:
    """What is not trusted, why, and what would tell it."""
    if not found.refusals:
        return []
    units = {e.name: e.unit for e in found.estimates}
    heads = [("what is wrong", False), ("what was found", False), ("do instead", False), ("not trusted for it", False)]
    bold = Markup("<b>{}</b>")
    rows: list[list[str]] = []
    for r in found.refusals:
        lost = "; ".join(constant_name(name, units.get(name, "")) for name in r.constants)
        rows.append([bold.format(r.subject), r.text, bold.format(r.record), lost or "all constants"])
    caption = (
        "A constant that the recording does not tell is refused rather than guessed. Each row says what would tell it."
    )
    return [Figure(title="Refused", caption=caption, table=Table(heads=heads, rows=rows))]
