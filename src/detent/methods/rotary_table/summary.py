"""The figures of a sequence on a rotary table that a person wants first, and the same as rows for the terminal."""

import math

from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.page.run_page import worst
from detent.page.words import GAP, CountUnit, angle, count, degrees, duration


class SequenceFigures:
    """Sums and extremes of a run beside those that it has itself; None where no step has the figure."""

    def __init__(self, run: SequenceRun) -> None:
        self.run = run
        self.made = run.steps if run.done else run.steps[:-1]  # steps that came to their end
        # Steps that move the table; one that is held dithers, but that is not what was asked.
        moved = [step for step in run.steps if step.kind in {"go", "jog"}]
        kinds = [step.kind for step in moved]
        counted = (kinds.count("go"), "positioning"), (kinds.count("jog"), "jog")
        self.kinds = ", ".join(count(n, word) for n, word in counted if n)  # "8 positionings, 3 jogs"
        # From the start of the sequence to the end of its last step [s].
        self.seconds = max(run.time_end - run.time_ready, 0.0) if run.steps else 0.0
        # Largest magnitudes: target less angle at the end of a positioning [rad], deviation dR [rad], speed [rad/s].
        ended = [step for step in self.made if step.kind == "go" and not math.isnan(step.error)]
        self.error = worst(ended, lambda step: abs(step.error))
        self.deviation = worst(moved, lambda step: step.peak_deviation)
        self.peak_speed = worst(moved, lambda step: step.peak_speed)


def sequence_summary_rows(spec: RotaryTableSpec, run: SequenceRun) -> list[tuple[str, str]]:
    """Name and text of each figure; what a run did not come to is left out."""
    figures, unit = SequenceFigures(run), CountUnit(spec.count, "count")
    kinds = f": {figures.kinds}" if figures.kinds else ""
    rows = [("steps", f"{count(len(figures.made))} of {count(run.job.count)}{kinds}")]
    if run.steps:
        rows.append(("time", duration(figures.seconds)))
    if error := figures.error:
        rows.append(("error at rest", f"worst {unit.counts(error.value)}, {angle(error.value)} ({whose(error.of)})"))
    if deviation := figures.deviation:
        crossed = f"; end of the turn crossed {times(run.crossings)}" if run.crossings else ""
        rows.append(("travel", turns(run.travel) + crossed + rollovers(run)))
        rows.append(("deviation", f"up to {angle(deviation.value)} ({whose(deviation.of)})"))
    if fastest := figures.peak_speed:
        rows.append(("peak speed", f"{degrees(fastest.value)} deg/s ({whose(fastest.of)})"))
    if run.refused:
        rows.append(("refused", count(run.refused, "start")))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def whose(step: StepRecord) -> str:
    """Name a step by its number."""
    return f"step {count(step.number)}"


def rollovers(run: SequenceRun) -> str:
    """How often the positioner went back by a turn, to go on a sentence; empty if it never did."""
    return f", {count(run.rollovers, 'rollover')}" if run.rollovers else ""


def times(n: int) -> str:
    """How often.

    >>> times(1), times(2), times(12)
    ('once', 'twice', '12 times')
    """
    return {1: "once", 2: "twice"}.get(n) or f"{count(n)} times"


def turns(value: float) -> str:
    """Write a way [rad] in turns.

    >>> turns(math.tau), turns(1.25 * math.tau)
    ('1.00 turns', '1.25 turns')
    """
    return f"{value / math.tau:.2f} turns"
