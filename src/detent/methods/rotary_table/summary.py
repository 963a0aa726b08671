"""The figures of a sequence on a rotary table that a person wants first, as rows of text for the terminal."""

import math
from collections.abc import Callable, Sequence

from detent.methods.rotary_table.page_data import SequenceFigures, WorstStep
from detent.methods.rotary_table.run import SequenceRun, StepRecord
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.page.words import GAP, CountUnit, count, duration, number

ARCSEC = math.pi / 180 / 3600
"""A second of arc [rad]."""

SMALL = 360 * ARCSEC
"""Angles below this are written in seconds of arc [rad]."""


def sequence_summary_rows(spec: RotaryTableSpec, run: SequenceRun) -> list[tuple[str, str]]:
    """Name and text of each figure; what a run did not come to is left out."""
    figures, unit = sequence_figures(run), CountUnit(spec.count, "count")
    kinds = kinds_text(figures)
    rows = [("steps", f"{count(figures.made)} of {count(figures.asked)}{f': {kinds}' if kinds else ''}")]
    if run.steps:
        rows.append(("time", duration(figures.seconds)))
    if figures.error:
        texts = unit.counts(figures.error.value), angle(figures.error.value)
        rows.append(("error at rest", f"worst {texts[0]}, {texts[1]} {_whose(figures.error)}"))
    if figures.deviation:
        rows.append(("travel", _travel(figures)))
        rows.append(("deviation", f"up to {angle(figures.deviation.value)} {_whose(figures.deviation)}"))
    if figures.peak_speed:
        rows.append(("peak speed", f"{degrees(figures.peak_speed.value)} deg/s {_whose(figures.peak_speed)}"))
    if run.refused:
        rows.append(("refused", count(run.refused, "start")))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def kinds_text(figures: SequenceFigures) -> str:
    """Count the steps that move the table."""
    texts = [count(n, word) for n, word in ((figures.positionings, "positioning"), (figures.jogs, "jog")) if n]
    return ", ".join(texts)


def _travel(figures: SequenceFigures) -> str:
    crossed = f"; end of the turn crossed {times(figures.crossings)}" if figures.crossings else ""
    rollovers = f", {count(figures.rollovers, 'rollover')}" if figures.rollovers else ""
    return turns(figures.travel) + crossed + rollovers


def _whose(worst: WorstStep) -> str:
    return f"(step {count(worst.step)})"


def times(n: int) -> str:
    """How often.

    >>> times(1), times(2), times(12)
    ('once', 'twice', '12 times')
    """
    return {1: "once", 2: "twice"}.get(n) or f"{count(n)} times"


def turns(value: float) -> str:
    """Write a way in turns.

    >>> turns(math.tau), turns(1.25 * math.tau)
    ('1.00 turns', '1.25 turns')
    """
    return f"{value / math.tau:.2f} turns"


def degrees(value: float, digits: int = 3) -> str:
    """Write an angle [rad] or a speed [rad/s] in degrees, without its unit.

    >>> degrees(math.pi), degrees(0.0349)
    ('180', '2.00')
    """
    # Radians of a round figure of degrees come back as one.
    return number(round(math.degrees(value), 9), digits)


def angle(value: float) -> str:
    """Write a small angle in seconds of arc, and one that is not small in degrees.

    >>> [angle(value).replace(GAP, " ") for value in (1.704e-5, 0.0017, 0.0349)]
    ['3.5 arcsec', '351 arcsec', '2.00 deg']
    """
    if abs(value) >= SMALL:
        return f"{degrees(value)}{GAP}deg"
    seconds = round(value / ARCSEC, 6)
    return f"{number(seconds, 2 if abs(seconds) < 10 else 3)}{GAP}arcsec"


def percent(share: float) -> float:
    """A relative error in percent, to a ten-thousandth: what is less is nothing.

    >>> percent(-0.05014), percent(2e-9)
    (-5.014, 0.0)
    """
    return round(100 * share, 4)


# ---- figures


def sequence_figures(run: SequenceRun) -> SequenceFigures:
    """Sums and extremes of a run."""
    ended = run.steps if run.done else run.steps[:-1]
    moved = [step for step in run.steps if step.kind in {"go", "jog"}]
    return SequenceFigures(
        asked=run.job.count,
        made=len(ended),
        positionings=sum(step.kind == "go" for step in run.steps),
        jogs=sum(step.kind == "jog" for step in run.steps),
        seconds=max(run.time_end - run.time_ready, 0.0) if run.steps else 0.0,
        travel=run.travel,
        turns=run.turns,
        crossings=run.crossings,
        rollovers=run.rollovers,
        error=_worst(
            [step for step in ended if step.kind == "go" and not math.isnan(step.error)], lambda step: abs(step.error)
        ),
        deviation=_worst(moved, lambda step: step.peak_deviation),
        peak_speed=_worst(moved, lambda step: step.peak_speed),
    )


def _worst(steps: Sequence[StepRecord], figure: Callable[[StepRecord], float]) -> WorstStep | None:
    if not steps:
        return None
    found = max(steps, key=figure)
    return WorstStep(figure(found), found.number)
