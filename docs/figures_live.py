"""The figures of a live axis, from what `python -m tests.live_figures` has kept, and from the page of faults."""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import figures
import numpy as np
from figures import BLUE, GREEN, GREY, ORANGE

DOCS = Path(__file__).resolve().parent
LINES = {
    "idle": ("nothing added", BLUE, "-"),
    "load": ("a busy process for each processor", ORANGE, "-"),
    "thread": ("a thread of Python that never yields", GREEN, "-"),
    "page": ("a page and a drive on CANopen", "black", ":"),
    "python": ("a loop in plain Python, and that thread", GREY, "--"),
}
CELL = re.compile(r"F(\d\d) (\d+) ms")


@cache
def kept() -> dict[str, Any]:
    """What was measured."""
    return json.loads((DOCS / "live_figures.json").read_text(encoding="utf-8"))


def plain(axis: Any) -> None:
    """Decades as numbers: 0.01, 0.1, 1."""
    axis.set_major_formatter("{x:g}")


def lateness() -> None:
    """Share of periods later than each edge of the histogram."""
    with figures.picture("lateness.png", 1, 4.2) as (axes,):
        for name, (text, colour, style) in LINES.items():
            late = np.array(kept()["lateness"][name]["late"])
            later = 1.0 - np.cumsum(late) / late.sum()
            last = int(np.flatnonzero(late)[-1])
            edges = 2.0 ** np.arange(last)
            axes.loglog(edges * 1e-3, later[:last], style, color=colour, label=text, marker=".", markersize=4)
        axes.axvline(1.0, color=GREY, linewidth=1)
        axes.text(1.06, 0.7, "one period", color=GREY, fontsize=9, va="top")
        axes.set_xlabel("lateness [ms]")
        axes.set_ylabel("share of periods that came later")
        axes.set_xlim(1e-3, 200)
        plain(axes.xaxis)
        plain(axes.yaxis)
        axes.set_ylim(2e-5, 1.2)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=9)


def stops() -> None:
    """Stops taken by the loop, and commands that stand still, within a time."""
    with figures.picture("stops.png", 1, 3.6) as (axes,):
        for name, colour in (("idle", BLUE), ("load", ORANGE)):
            for key, style in (("taken", "-"), ("zero", "--")):
                times = np.array(kept()["stops"][name][key])
                text = "the loop has it" if key == "taken" else "the command stands still"
                share = np.arange(1, len(times) + 1) / len(times)
                axes.semilogx(np.maximum(times, 0.1), share, style, color=colour, label=f"{LINES[name][0]}: {text}")
        axes.axhline(0.99, color=GREY, linestyle=":", linewidth=1)
        axes.set_xlabel("time since the page sent its stop [ms]")
        axes.set_ylabel("share of stops")
        axes.set_ylim(0, 1.02)
        plain(axes.xaxis)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=9)


def detection() -> None:
    """A point for each cell of the page of faults in which one was found."""
    text = (DOCS / "explanation" / "fault-matrix.md").read_text(encoding="utf-8")
    found: dict[str, list[int]] = {}
    for code, after in CELL.findall(text):
        found.setdefault(f"F{code}", []).append(int(after))
    names = sorted(found, reverse=True)
    with figures.picture("detection.png", 1, 0.28 * len(names) + 0.9) as (axes,):
        for row, name in enumerate(names):
            times = sorted(found[name])
            axes.plot((times[0], times[-1]), (row, row), color=GREY, linewidth=1, zorder=1)
            axes.scatter(times, [row] * len(times), s=18, color=BLUE, alpha=0.35, linewidths=0, zorder=2)
        axes.set_xscale("log")
        plain(axes.xaxis)
        axes.set_yticks(range(len(names)), [f"{name}  ({len(found[name])})" for name in names])
        axes.set_xlabel("time from the injection until the fault was reported [ms]")


FIGURES = (lateness, stops, detection)
