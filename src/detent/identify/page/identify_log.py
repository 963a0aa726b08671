"""Sections of the report of an identification: what the recordings hold and what is wrong with them; what to record."""

from html import escape

from detent.identify.page.identify_data import IdentifyReportData
from detent.identify.page.identify_words import constant_name, unit_text
from detent.logs.log import Action, Finding, Log, Severity, tell_rows
from detent.page.page import ZOOM_HINT, chart_slot, figure, section
from detent.page.words import count, duration, further, table

MOST_LOGS = 30
"""Recordings listed one by one."""

MOST_FINDINGS = 60
"""Findings listed one by one."""

_COLOURS = {Severity.ERROR: "bad", Severity.WARNING: "warn", Severity.NOTE: "soft"}


def log_sections(data: IdentifyReportData) -> tuple[str, str]:
    """Sections about the recordings, and about what to record instead."""
    log = section("What was found in the log", _recorded(data), _findings(data), _logs(data), _guesses(data))
    return log, section("What to record instead", _refusals(data))


def _recorded(data: IdentifyReportData) -> str:
    run, log = data.found.runs[data.shown], data.found.logs[data.shown]
    share = 1.0 - float(run.usable.mean())
    used = f"Shaded: {share:.0%} of the samples, which are not used." if share > 0.0 else "Every sample is used."
    caption = f"{escape(log.name)}: {duration(float(run.t[-1]))} at {1.0 / run.step:.4g} Hz. {used}"
    slots = chart_slot("recorded-position", "position over time") + chart_slot("recorded-effort", "effort over time")
    return figure("What was recorded", caption, slots, ZOOM_HINT)


# ---- findings


def _findings(data: IdentifyReportData) -> str:
    several = len(data.found.logs) > 1
    told = [(log, finding) for log in data.found.logs for finding in log.findings]
    order = list(_COLOURS)
    told.sort(key=lambda pair: order.index(pair[1].severity))
    if not told:
        more = (
            "what the motion itself tells stands below"
            if data.found.refusals
            else "no gaps, jumps, wrong signs or units"
        )
        return figure("Faults", f"None found in the file: {more}.", "")
    heads = [("", False), ("rows", False), ("signal", False), ("what", False), ("what was done", False), ("do", False)]
    rows = [_finding_row(log, finding, several=several) for log, finding in told[:MOST_FINDINGS]]
    more = f"<p>{further(len(told) - MOST_FINDINGS, 'finding')} not listed.</p>" if len(told) > MOST_FINDINGS else ""
    caption = "Rows are counted from 1 below the header of the file."
    return figure("Faults", caption, table(heads, rows, tall=len(rows) > 12), more)


def _finding_row(log: Log, finding: Finding, *, several: bool) -> list[str]:
    where = tell_rows(finding.rows)
    colour = _COLOURS[finding.severity]
    return [
        f'<b style="color:var(--{colour})">{finding.severity}</b>',
        escape(f"{log.name}: {where}" if several else where),
        escape(finding.signal or "all"),
        f"<b>{escape(finding.kind)}</b>: {escape(finding.text)}",
        escape("left as it is" if finding.action is Action.LEFT else finding.action),
        escape(finding.advice or "nothing"),
    ]


# ---- recordings and guesses


def _logs(data: IdentifyReportData) -> str:
    logs = data.found.logs
    if len(logs) == 1:
        return ""
    heads = [("recording", False), ("samples", True), ("time", True), ("faults", True)]
    simulated = len(data.held) == len(logs)
    rows: list[list[str]] = []
    for log in logs[:MOST_LOGS]:
        seconds = float(log.t[-1] - log.t[0])
        rows.append([escape(log.name), count(len(log)), duration(seconds), count(len(log.findings))])
    more = f"<p>{further(len(logs) - MOST_LOGS, 'recording')} not listed.</p>" if len(logs) > MOST_LOGS else ""
    told = escape(logs[data.shown].name)
    caption = f"All are fitted together. Figures over time show {told}"
    caption += ", whose last quarter is simulated worst." if simulated else "."
    return figure("Recordings", caption, table(heads, rows, tall=len(rows) > 12), more)


def _guesses(data: IdentifyReportData) -> str:
    log = data.found.logs[data.shown]
    heads = [("signal", False), ("column", False), ("unit in the file", False), ("used as", False)]
    rows = [
        [
            escape(role),
            f"<code>{escape(source.column)}</code>",
            escape(unit_text(source.unit)),
            escape(unit_text(log.units.get(role, ""))),
        ]
        for role, source in log.columns.items()
    ]
    guessed = "".join(f"<li>{escape(text)}</li>" for text in log.guesses)
    caption = (
        "What was read, and what had to be guessed because the file does not say it. State it if a guess is wrong."
    )
    return figure("Columns", caption, table(heads, rows), f"<ul>{guessed}</ul>" if guessed else "")


# ---- refusals


def _refusals(data: IdentifyReportData) -> str:
    found = data.found
    if not found.refusals:
        return ""
    units = {e.name: e.unit for e in found.estimates}
    heads = [("what is wrong", False), ("what was found", False), ("do instead", False), ("not trusted for it", False)]
    rows = [
        [
            f"<b>{escape(r.subject)}</b>",
            escape(r.text),
            f"<b>{escape(r.record)}</b>",
            escape("; ".join(constant_name(name, units.get(name, "")) for name in r.constants) or "all constants"),
        ]
        for r in found.refusals
    ]
    caption = (
        "A constant that the recording does not tell is refused rather than guessed. Each row says what would tell it."
    )
    return figure("Refused", caption, table(heads, rows))
