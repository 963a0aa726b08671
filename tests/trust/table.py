"""The figures of the trust test, and the page that shows them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.identify_rig import binomial_bounds
from tests.trust.judge import Judged
from tests.trust.plants import BAD

CONSTANTS = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative", "delay")
"""Constants whose truth every case knows."""

VERDICTS = ("trusted", "partly trusted", "refused", "unreadable")

REFUSING = ("refused", "unreadable")
"""Verdicts under which no constant is given."""


@dataclass(frozen=True)
class Coverage:
    """How often the interval of a constant held the truth.

    Attributes
    ----------
    name : str
    accepted, inside : int
        Good logs in which it was trusted, and those of them whose interval held the truth.
    width : float
        Median of half the interval over the value; of the delay, in samples.
    """

    name: str
    accepted: int
    inside: int
    width: float

    @property
    def share(self) -> float:
        """Share of the trusted that held the truth."""
        return self.inside / max(self.accepted, 1)


@dataclass(frozen=True)
class Figures:
    """What a set of judged cases amounts to.

    Attributes
    ----------
    good, bad : tuple of Judged
    """

    good: tuple[Judged, ...]
    bad: tuple[Judged, ...]

    @property
    def coverage(self) -> tuple[Coverage, ...]:
        """One per constant."""
        found: list[Coverage] = []
        for name in CONSTANTS:
            held = [j.inside[name] for j in self.good if name in j.inside]
            widths = [j.width[name] for j in self.good if name in j.width]
            found.append(Coverage(name, len(held), sum(held), float(np.median(widths)) if widths else np.nan))
        return tuple(found)

    @property
    def refused_good(self) -> tuple[Judged, ...]:
        """Good logs of which nothing is trusted."""
        return tuple(j for j in self.good if j.verdict in REFUSING)

    @property
    def accepted_bad(self) -> tuple[Judged, ...]:
        """Bad logs of which anything is trusted."""
        return tuple(j for j in self.bad if j.verdict not in REFUSING)


def figures_of(judged: Sequence[Judged]) -> Figures:
    """Sort judged cases."""
    return Figures(tuple(j for j in judged if not j.bad), tuple(j for j in judged if j.bad))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown table, its columns aligned as text."""
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def coverage_table(figures: Figures) -> str:
    """One row per constant."""
    rows = [
        [f"`{c.name}`", str(c.accepted), str(c.inside), f"{100 * c.share:.1f} %", _width(c)]
        if c.accepted
        else [f"`{c.name}`", "0", "", "", ""]
        for c in figures.coverage
    ]
    return table(("constant", "trusted in", "truth inside", "share", "median half-width"), rows)


def _width(c: Coverage) -> str:
    return f"{c.width:.2g} samples" if c.name == "delay" else f"{100 * c.width:.2g} %"


def bad_table(figures: Figures) -> str:
    """One row per kind of bad log."""
    rows = [
        [kind, str(sum(j.bad == kind for j in figures.bad)), str(sum(j.bad == kind for j in figures.accepted_bad))]
        for kind in BAD
    ]
    rows.append(["all", str(len(figures.bad)), str(len(figures.accepted_bad))])
    return table(("what is wrong", "logs", "accepted"), rows)


def verdict_table(figures: Figures) -> str:
    """Verdicts on good and bad logs."""
    good, bad = (Counter(j.verdict for j in part) for part in (figures.good, figures.bad))
    rows = [[verdict, str(good[verdict]), str(bad[verdict])] for verdict in VERDICTS]
    return table(("verdict", "good logs", "bad logs"), rows)


def reason_table(figures: Figures) -> str:
    """Why good logs were refused or only partly trusted: a row per subject, a log may have several."""
    reasons: dict[str, Counter[str]] = {}
    for j in figures.good:
        for subject in {s.partition(" (")[0] for s in j.subjects}:
            reasons.setdefault(subject, Counter())[j.verdict] += 1
    rows = [[s, str(c["partly trusted"]), str(c["refused"] + c["unreadable"])] for s, c in sorted(reasons.items())]
    return table(("what is said", "partly trusted", "refused"), rows)


HEAD = """# Trust test: how often the limits hold

This page is written by `python -m tests.trust`, run from the root of the project; do not edit it. It holds figures
of {good} good and {bad} bad logs, numbers {first} on; the same numbers are the same logs everywhere.

A tool that identifies must not answer confidently on bad data. Whether this one does is measured here: on simulated
logs whose true constants are known. Each log is one number, from which everything follows (`tests/trust/plants.py`):

- **The axis.** 0.1 to 200 kg, top speeds from 0.05 to 1 m/s; Coulomb and viscous friction of each direction, the same
  in half of the logs and up to a quarter apart in the others; a constant force; in a third of them static friction
  above Coulomb friction; a force that acts 0, 1 or 2 samples late.
- **The controller.** A cascade with 8 to 25 Hz in its velocity loop, with and without integral and feedforward. Logs
  of a closed loop are the difficult ones: the force answers to the noise of the encoder.
- **The excitation.** Moves of random length, speed and ramps, some with a dwell; or six sines. 8 to 25 s at 500, 1000
  or 2000 Hz.
- **What is recorded.** The position in counts, 2 to 60 of them per sample at top speed, half of them with jitter; the
  force with noise of 0.3 to 3 % of the acceleration force, white or with a memory of up to 20 samples.

The bad ones are such logs too, but spoilt:
{kinds}.

Each is written to a CSV file and goes the way of a user's log: `read_log`, then `identify` with nothing stated. An
interval counts where the constant is trusted. 95 % intervals should hold the truth in 95 % of the cases; of {count}
such intervals, chance leaves {low:.1f} to {high:.1f} % (19 times out of 20). Rules and windows were chosen with numbers
below 5350 at hand; what came of numbers from 6000 on, which nothing was chosen with, stands in
[decision 14](decisions/0014-identification-by-windows-and-instruments.md).
"""

MIDDLE = """
## Logs with the reference

With the reference recorded, and followed, the constants come from instrumental variables.
`tests/trust/test_trust.py` holds these figures to limits: 93 to 97.5 % of the intervals of each constant hold the
truth, at most 2 % of the bad logs are accepted, at most 5 % of the good ones refused. `make test` runs a reduced set,
`make test-long` the full one.

"""

LATER = """
## The same logs without the reference

Without a reference the motion seen through wider windows takes its place; it shares a little noise with the narrower
ones, so that a small bias is left, and intervals hold the truth a little less often. The delay is not given at all. A
position in a wrong unit is accepted: no other signal of such a log knows the way, and an axis of that mass may exist.
So record the reference. No test asserts the figures of this section.

"""


def page(with_reference: Figures, without: Figures, first: int) -> str:
    """The page of the documentation."""
    count = len(with_reference.good)
    low, high = binomial_bounds(count, doubt=0.05)
    head = HEAD.format(
        good=count,
        bad=len(with_reference.bad),
        first=first,
        kinds=", ".join(BAD),
        count=count,
        low=100 * low,
        high=100 * high,
    )
    return head + MIDDLE + sections(with_reference) + LATER + sections(without)


def sections(figures: Figures) -> str:
    """All tables of one set."""
    parts = (
        coverage_table(figures),
        verdict_table(figures),
        "Why good logs were not trusted, or not all of their constants:\n\n" + reason_table(figures),
        "Bad logs of which anything was trusted:\n\n" + bad_table(figures),
    )
    return "\n".join(parts)
