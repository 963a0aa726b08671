"""What the page of every run says in the same way: headline, first cards, notes, and stretches of its trace."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan
from typing import Any, Generic, TypeVar

import numpy as np

from detent.page.frame import Card, Headline, card
from detent.page.parts import Event, Note, Numbers
from detent.page.words import count, duration
from detent.record.run import RunRecord
from detent.record.trace import Trace

FEWEST_ROWS = 10  # rows of a trace without which nothing is drawn
LONGEST = 30.0  # time that the figure of a whole job shows [s]: more than this is a grey block on any screen
HAPPENED = 1e-6  # how much later than the end of a move an event may be noted [s]


T = TypeVar("T", bound=Any)


# ---- results


def page_title(axis_name: str, run: RunRecord[Any], *, done: str = "done") -> str:
    """Title of the window."""
    return f"{run.job.name} on {axis_name}: {done if run.done else f'not {done}'}"


def run_headline(
    axis_name: str, run: RunRecord[Any], lead: str, *, doubt: str = "", words: tuple[str, str] = ("Done", "Not done")
) -> Headline:
    """Headline of a run, with `words` for one that is done and one that is not.

    Of a run that is not done `lead` says how far it came, and the failure follows; of one with warnings what happened,
    of the first of these, stands in front. `doubt` is a verdict of fewer words for that.
    """
    done, not_done = words
    verdicts = {"good": done, "warn": doubt or f"{done}, with {count(len(run.warnings), 'warning')}", "bad": not_done}
    if run.level == "warn":
        lead = f"{run.doubt[:1].upper()}{run.doubt[1:]}. {lead}"
    return Headline(
        level=run.level,
        verdict=verdicts[run.level],
        name=run.job.name,
        kicker=f"Simulated run of the axis {axis_name}",
        lead=lead if run.done else f"{lead} {run.failure[:1].upper()}{run.failure[1:].rstrip('.')}.",
    )


def stopped_after(run: RunRecord[Any], made: int, asked: str, *, began: bool) -> str:
    """Say how far a run came that was not done: "Stopped after 3 of 10 moves, 1.2 s into the job.".

    No time of its job has passed for an axis that never `began` with it.
    """
    if began:
        return (
            f"Stopped after {count(made)} of {asked}, {duration(max(run.time_end - run.time_ready, 0.0))} into the job."
        )
    return f"Stopped {duration(run.time_end)} after power-on, before the first of {asked}."


def made_card(title: str, made: int, asked: int, below: str) -> Card:
    """How many of those asked for were done; bad if not all."""
    return Card(title, count(made), f"of {count(asked)}", below, bad=made < asked)


def time_card(seconds: float, below: str) -> Card:
    """How long the job took."""
    return card("Time", duration(seconds), below)


def warnings(texts: Iterable[str]) -> list[Note]:
    """Warnings of a run as notes."""
    return [Note("warning", text) for text in texts]


@dataclass(frozen=True, slots=True)
class Worst(Generic[T]):
    """The largest of a figure, and the record it is of."""

    value: float
    of: T


def worst(records: Iterable[T], figure: Callable[[T], float]) -> Worst[T] | None:
    """The record with the largest figure, the first of equals; None without records."""
    found = max(records, key=figure, default=None)
    return None if found is None else Worst(figure(found), found)


# ---- figures over time


def whole_or_first(shown: float, seconds: float, whole: str) -> str:
    """Title of a figure of a job of so many seconds, of which so many are shown [s]."""
    return whole if shown > 0.99 * seconds else f"The first {duration(shown)} of {duration(seconds)}"


def happened(texts: Mapping[str, float], until: float) -> list[Event]:
    """Events in order of time [s]: those of texts whose moment came; NaN never did."""
    events = [Event(t, text) for text, t in texts.items() if 0.0 <= t <= until + HAPPENED]
    return sorted(events, key=lambda event: event.t)


def has(trace: Trace | None, names: Iterable[str]) -> bool:
    """Whether a trace has rows to draw and all of these signals."""
    return trace is not None and len(trace) > 1 and all(name in trace for name in names)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows of a trace whose clock `t` starts at a moment of interest."""

    t: Numbers
    rows: slice
    trace: Trace

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, name: str) -> Numbers:
        return self.trace[name][self.rows]

    def first(self, holds: Any) -> float:
        """When a condition, one value per row, holds first [s]; NaN if it never does."""
        found = np.flatnonzero(holds)
        return float(self.t[found[0]]) if found.size else float("nan")

    def between(self, begin: float, end: float) -> "Stretch":
        """Rows from a moment to the first after another on the same clock [s]."""
        first, last = np.searchsorted(self.t, (begin, end)).tolist()
        last = min(last + 1, len(self))
        start = self.rows.start
        return Stretch(self.t[first:last], slice(start + first, start + last), self.trace)


def stretch(trace: Trace | None, names: Iterable[str], begin: float, end: float = inf) -> Stretch | None:
    """Rows from `begin` to `end` [s] on a clock that starts at `begin`.

    None if nothing was recorded, a signal is missing, or there are too few rows to draw.
    """
    if trace is None or not has(trace, names):
        return None
    rows = slice(
        int(np.searchsorted(trace.time, begin, side="left")), int(np.searchsorted(trace.time, end, side="right"))
    )
    if rows.stop - rows.start < FEWEST_ROWS:
        return None
    return Stretch(trace.time[rows] - begin, rows, trace)


def recorded_whole(trace: Trace, records: Sequence[T]) -> list[T]:
    """Records, each from its `begin` to its `end`, of which the trace has every row, and enough of them."""
    if len(trace) < 2:
        return []
    row = float(trace.time[1] - trace.time[0])
    ends = float(trace.time[-1]) + row
    return [one for one in records if one.end <= ends and one.end - one.begin > FEWEST_ROWS * row]


def median_of(records: Sequence[T], figure: Callable[[T], float]) -> float:
    """Median of a figure; NaN without records."""
    found = [value for value in map(figure, records) if not isnan(value)]
    return float(np.median(found)) if found else float("nan")
