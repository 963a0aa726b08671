"""From a print run and its trace to what the report shows."""

from itertools import pairwise

import numpy as np

from detent.control.head_computer import (
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    IDLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
)
from detent.files.quantities import INCH
from detent.methods.print_head.comparison import DriveComparison
from detent.methods.print_head.comparison_data import Comparison, StartCurve
from detent.methods.print_head.page_data import (
    ColumnErrors,
    Constant,
    HeadPath,
    IdentifiedLine,
    LineResult,
    Marks,
    ReportData,
    SpeedProfile,
    TurnAround,
)
from detent.methods.print_head.printed_page import PrintJob
from detent.methods.print_head.run import ERROR_BIN, LineRecord, PrintRun
from detent.methods.print_head.schema import FULL_DRIVE_COUNTS, SPEED_STEP, PrintHeadSpec
from detent.page.parts import Event, Note, Numbers
from detent.record.trace import Trace

PAGE = 528
"""Eleven inches in 1/48 in: the usual page of continuous paper."""

FEWEST_ROWS = 10
"""Rows of a trace without which a line is not drawn."""

STATE_EVENTS = {
    (HIGH_ACCEL, HIGH_STEADY): "top of the ramp: IR part removed, trim on",
    (HIGH_STEADY, HIGH_TRANSITION): "stop begins: IR part subtracted, TR on",
    (HIGH_STEADY, HIGH_REVERSE): "stop begins: drive against the motion",
    (HIGH_TRANSITION, HIGH_REVERSE): "drive value passes zero: TR off, line toggled",
    (HIGH_REVERSE, HIGH_ACCEL): "zero speed: turn-around, drive jumps by both frictions",
    (HIGH_TRANSITION, HIGH_ACCEL): "zero speed: turn-around, drive jumps by both frictions",
    (HIGH_REVERSE, IDLE): "zero speed: drive off",
    (LOW_START, LOW_STEADY): "low-speed start over, trim on",
    (LOW_STEADY, LOW_STOP): "stop begins: drive reversed",
    (LOW_STOP, IDLE): "zero speed: drive off",
}

NEEDED = (
    "train.position", "train.velocity", "train.current", "head.state", "head.drive_cmd", "head.out.transition",
    "head.speed", "head.direction", "head.columns.fired",
)  # fmt: skip
"""Signals the figures are drawn from; a trace without them gives a report without those figures."""


def print_report(
    spec: PrintHeadSpec, run: PrintRun, trace: Trace | None, *, settings: dict[str, str] | None = None
) -> ReportData:
    """Everything the report of a print run shows."""
    drawable = trace is not None and len(trace) > 1 and all(name in trace for name in NEEDED)
    return ReportData(
        axis_name=spec.axis.name,
        job_name=run.job.name,
        printed=run.done,
        failure=run.failure,
        duration=run.print_time,
        line_count=len(run.job.lines),
        page_count=run.job.pages,
        character_count=run.job.characters,
        lines=[_line_result(line) for line in run.lines],
        marks=_marks(run),
        errors=ColumnErrors(
            bin_width=ERROR_BIN,
            right=run.errors_right,
            left=run.errors_left,
            worst=run.worst_error,
            rms=run.rms_error,
        ),
        path=_head_path(spec, run, trace) if trace is not None and drawable else None,
        profile=_profile(run, trace) if trace is not None and drawable else None,
        turn_around=_turn_around(run, trace) if trace is not None and drawable else None,
        identified=_identified(run),
        constants=_constants(run),
        notes=_notes(run),
        settings=settings or {},
    )


def _line_result(line: LineRecord) -> LineResult:
    return LineResult(
        number=line.number,
        direction=line.direction,
        speed=line.speed,
        turn_around=line.turn_around,
        start=line.start,
        stop=line.stop,
        characters=line.characters,
        worst_error=line.worst_error,
        rms_error=line.rms_error,
    )


def _marks(run: PrintRun) -> Marks:
    lines = {line.number: line for line in run.job.lines}
    tops = _page_tops(run.job)
    from_top = {line.number: line.baseline - tops[line.page] for line in run.job.lines}
    directions = {line.number: line.direction for line in run.lines}
    struck = [s for s in run.strikes if s.offset == s.offset]  # those that were fired
    column = np.array([s.character.column for s in struck], dtype=float) * (INCH / 120)
    return Marks(
        characters=[s.character.char for s in struck],
        page=np.array([lines[s.line].page for s in struck], dtype=int),
        line=np.array([s.line for s in struck], dtype=int),
        baseline=np.array([from_top[s.line] for s in struck], dtype=float) * (INCH / 48),
        column=column,
        landed=column + np.array([s.offset for s in struck], dtype=float),
        width=np.array([s.character.ink_columns for s in struck], dtype=float) * (INCH / 120),
        direction=np.array([directions[s.line] for s in struck], dtype=int),
        strikes=np.array([s.character.strike for s in struck], dtype=int),
    )


def _page_tops(job: PrintJob) -> dict[int, int]:
    """Top of each page [1/48 in]: eleven inches each; on shorter forms the first line of a page is its top."""
    tops: dict[int, int] = {}
    for line in job.lines:
        tops.setdefault(line.page, min(PAGE * (line.page - 1), line.baseline))
    return tops


def _head_path(spec: PrintHeadSpec, run: PrintRun, trace: Trace) -> HeadPath:
    fired = trace["head.columns.fired"]
    printing = np.zeros(len(trace), dtype=bool)
    for line in run.lines:
        first, last = np.searchsorted(trace.time, (line.start, line.stop))
        inside = np.flatnonzero(np.diff(fired[first : last + 1]))
        if inside.size:
            printing[first + inside[0] : first + inside[-1] + 2] = True
    return HeadPath(
        t=trace.time,
        position=trace["train.position"],
        printing=printing,
        travel=spec.limits.travel,
        column0=spec.printing.left_margin,
    )


def _events(trace: Trace, since: float) -> list[Event]:
    """Changes of the computer's state, each as a mark."""
    state, drive = trace["head.state"], trace["head.drive_cmd"]
    found: list[Event] = []
    for k in np.flatnonzero(np.diff(state)).tolist():
        text = STATE_EVENTS.get((int(state[k]), int(state[k + 1])))
        if text:
            found.append(Event(float(trace.time[k + 1]) - since, text, int(drive[k + 1])))
    return found


def _reference(trace: Trace) -> Numbers:
    """Commanded speed where one is demanded: from the start of the move to its stop."""
    state = trace["head.state"]
    demanded = np.isin(state, (HIGH_ACCEL, HIGH_STEADY, LOW_START, LOW_STEADY))
    return np.where(demanded, trace["head.speed"] * trace["head.direction"] * SPEED_STEP, np.nan)


def _profile(run: PrintRun, trace: Trace) -> SpeedProfile | None:
    """The line with the most columns among the fastest, of those recorded whole."""
    lines = _recorded(run, trace)
    if not lines:
        return None
    chosen = max(lines, key=lambda line: (line.speed_value, line.columns))
    # One row more: the end of the move shows in the first row after it.
    part = trace.between(chosen.start, chosen.stop + _row(trace))
    fired = np.flatnonzero(np.diff(part["head.columns.fired"]))
    t = part.time - chosen.start
    # After the stop the computer already demands the speed of the next line.
    reference = np.where(part.time <= chosen.stop, _reference(part), np.nan)
    return SpeedProfile(
        line=chosen.number,
        direction=chosen.direction,
        t=t,
        velocity=part["train.velocity"],
        velocity_ref=reference,
        drive=part["head.drive_cmd"],
        transition=part["head.out.transition"] != 0,
        print_span=(float(t[fired[0]]), float(t[fired[-1] + 1])) if fired.size else None,
        events=_events(part, chosen.start),
    )


def _row(trace: Trace) -> float:
    """Time between two rows [s]."""
    return float(trace.time[1] - trace.time[0])


def _recorded(run: PrintRun, trace: Trace) -> list[LineRecord]:
    """Lines that the trace shows from start to stop: of a very long job only the beginning is kept."""
    row = _row(trace)
    ends = float(trace.time[-1]) + row
    # Fewer rows than these show nothing of a line.
    return [line for line in run.lines if line.stop <= ends and line.stop - line.start > FEWEST_ROWS * row]


def _turn_around(run: PrintRun, trace: Trace) -> TurnAround | None:
    """The turn-around at the highest speed: from the stop of a line to the steady speed of the next."""
    pairs = [(a, b) for a, b in pairwise(_recorded(run, trace)) if b.turn_around]
    if not pairs:
        return None
    before, after = max(pairs, key=lambda pair: pair[1].speed_value)
    whole = trace.between(before.start, after.stop)
    state = whole["head.state"]
    stops = np.flatnonzero((state[:-1] == HIGH_STEADY) & (state[1:] != HIGH_STEADY) & (whole.time[1:] < before.stop))
    ramps = np.flatnonzero((state[:-1] == HIGH_ACCEL) & (state[1:] == HIGH_STEADY) & (whole.time[1:] > before.stop))
    if not stops.size or not ramps.size:
        return None
    begin, end = float(whole.time[stops[-1] + 1]), float(whole.time[ramps[0] + 1])
    part = trace.between(begin - 0.01, end + 0.02)
    return TurnAround(
        line_from=before.number,
        line_to=after.number,
        t=part.time - begin,
        current=part["train.current"],
        velocity=part["train.velocity"],
        transition=part["head.out.transition"] != 0,
        events=_events(part, begin),
    )


def _identified(run: PrintRun) -> list[IdentifiedLine]:
    found: list[IdentifiedLine] = []
    for side, direction in (("right", 1), ("left", -1)):
        line = run.identified.get(side)
        if line is None:
            continue
        measured = line.speed_fast > 0 and line.speed_slow > 0
        points = ((line.speed_fast, line.drive_fast), (line.speed_slow, line.drive_slow)) if measured else ()
        found.append(
            IdentifiedLine(
                direction=direction,
                slope=line.slope,
                friction=line.friction,
                points=points,
                true_slope=line.true_slope,
                true_friction=line.true_friction,
                default_slope=line.default_slope,
                default_friction=line.default_friction,
            )
        )
    return found


def _constants(run: PrintRun) -> list[Constant]:
    rows: list[Constant] = []
    for side, line in run.identified.items():
        rows += [
            Constant(
                f"slope K, {side}", "1/256 count per 1/6 in/s", line.slope, line.true_slope,
                "drive per speed: the motor's back-EMF in counts",
            ),
            Constant(
                f"friction Vf, {side}", "count", line.friction, line.true_friction,
                f"drive that just keeps the head moving; {FULL_DRIVE_COUNTS} counts are the whole supply",
            ),
        ]  # fmt: skip
    if run.width:
        rows.append(Constant("width between the frames", "mm", run.width * 1e3, None, "found while homing"))
    return rows


def _notes(run: PrintRun) -> list[Note]:
    notes = [Note("warning", text) for text in run.warnings]
    notes += [Note("note", f"byte {note.offset}, {note.code}: {note.text}") for note in run.job.notes[:20]]
    if len(run.job.notes) > 20:
        notes.append(Note("note", f"{len(run.job.notes) - 20} more notes about the job are in the JSON summary"))
    return notes


def comparison_figure(found: DriveComparison, spec: PrintHeadSpec) -> Comparison:
    """What the comparison figure shows: steady errors and starts of the three drives."""
    return Comparison(
        methods=found.methods,
        speeds=found.speeds,
        errors=found.errors,
        starts=[
            StartCurve(name=method, t=start.t, velocity=start.velocity)
            for method, start in zip(found.methods, found.starts, strict=True)
        ],
        target=found.target,
        machine=drift_text(spec),
    )


def drift_text(spec: PrintHeadSpec) -> str:
    """How the true machine differs from its file, in a few words."""
    d = spec.disturbance
    parts = [
        f"{name} {100 * value:+.3g} %"
        for name, value in (
            ("K", d.motor_constant),
            ("friction right", d.friction_right),
            ("friction left", d.friction_left),
        )
        if value
    ]
    if d.supply != spec.drive.supply:
        parts.append(f"supply {d.supply:.4g} V instead of {spec.drive.supply:.4g} V")
    return ", ".join(parts) or "machine as in its file"
