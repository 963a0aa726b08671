"""The page of what a live axis did in wall time, from what `tests.live_figures` has kept; nothing is measured here."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.places import ROOT

KEPT = ROOT / "docs" / "live_figures.json"
PAGE = ROOT / "docs" / "explanation" / "live-figures.md"
CONDITIONS = {
    "idle": "nothing added",
    "load": "a process that computes for each processor",
    "thread": "a thread of Python in the same process that never yields",
    "python": "a loop in plain Python beside that thread, for comparison",
    "page": "a page with eight channels at 1 kHz, and a drive on CANopen",
}
METHODS = {
    "cascade": "cascade", "filtered_servo": "filtered servo", "phase_servo": "phase servo",
    "rotary_table": "rotary table", "print_head": "print head", "zoom": "stepper envelope",
}  # fmt: skip
TITLES = {
    "lateness": "Lateness", "stops": "Stops", "kills": "Kills", "long kills": "Kills, long form", "cuts": "Power cuts",
    "soak": "Soak", "long soak": "Soak, long form",
    **{f"hour {name}": f"Hour of the {title}" for name, title in METHODS.items()},
}  # fmt: skip
Kept = dict[str, Any]


def missed(one: Kept) -> float:
    """Share of periods that were skipped."""
    return one["skipped"] / (sum(one["late"]) + one["skipped"])


def quantile(times: list[float], share: float) -> float:
    """Time within which such a share of stops was [ms]: one of those measured, the next longer one."""
    return times[min(int(np.ceil(share * len(times))), len(times)) - 1]


def verdict(*, met: bool) -> str:
    """In a word."""
    return "reached" if met else "**not reached**"


def hours_of(kept: Kept) -> Kept:
    """The hours that were simulated, by method."""
    return {name: kept[part] for name in METHODS if (part := f"hour {name}") in kept}


def soak_of(kept: Kept) -> Kept:
    """The longest soak."""
    return kept["long soak"] if "long soak" in kept else kept["soak"]


def kills_of(kept: Kept) -> Kept:
    """The run with the most kills."""
    return max((kept[part] for part in ("kills", "long kills") if part in kept), key=lambda part: part["kills"])


def verdicts(kept: Kept) -> Iterator[str]:
    """What was set as an aim, what was found, and whether that is enough."""
    late, stops = kept["lateness"], kept["stops"]
    aims = {"thread": 0.002, "page": 0.005}
    for name, more in aims.items():
        share, most = missed(late[name]), 1.5 * missed(late["idle"]) + more
        yield (
            f"| periods missed: {CONDITIONS[name]} | {100 * most:.2f} %: 1.5 times idle, and {100 * more:g} % | "
            f"{100 * share:.2f} % | {verdict(met=share <= most)} |"
        )
    share = missed(late["python"])
    yield f"| what a loop in plain Python misses there | over 20 % | {100 * share:.0f} % | {verdict(met=share > 0.2)} |"
    for name in ("idle", "load"):
        found = quantile(stops[name]["taken"], 0.99)
        yield (
            f"| stop from a page until the loop has it, 99 of 100: {CONDITIONS[name]} | 50 ms | {found:.1f} ms | "
            f"{verdict(met=found < 50.0)} |"
        )
    killed = kills_of(kept)["kills"]
    yield f"| kills survived | 50,000 | {killed:,} | {verdict(met=killed >= 50_000)} |"
    soak = soak_of(kept)
    done = soak["seconds"] >= 1800 and soak["grown"] < 0.01 and not soak["fault"]
    yield (
        f"| memory grown in half an hour | 1 % | {100 * soak['grown']:.2f} % in {soak['seconds'] / 60:g} min | "
        f"{verdict(met=done)} |"
    )
    hours = hours_of(kept)
    quiet = sum(one["faults"] == 0 for one in hours.values())
    yield f"| methods without a false alarm in a simulated hour | 6 | {quiet} | {verdict(met=quiet == len(METHODS))} |"


def lateness_rows(kept: Kept) -> Iterator[str]:
    """Of each condition: periods, shares that were late, and what was skipped."""
    for name, what in CONDITIONS.items():
        late = np.array(kept["lateness"][name]["late"])
        total = late.sum()
        shares = (100 * late[k + 1 :].sum() / total for k in (6, 8, 10))  # bin k ends at 2^k us
        text = " | ".join(f"{share:.2f} %" for share in shares)
        one = kept["lateness"][name]
        yield f"| {what} | {total} | {text} | {one['worst']:.4g} ms | {one['skipped']} |"


def stop_rows(kept: Kept) -> Iterator[str]:
    """Of each condition: until the loop has the stop, until the page knows, until the command stands still."""
    for name in ("idle", "load"):
        for key, what in (
            ("taken", "the loop has it"), ("answered", "the page is told"), ("zero", "the command stands still"),
        ):  # fmt: skip
            times = kept["stops"][name][key]
            found = " | ".join(f"{quantile(times, share):.1f} ms" for share in (0.5, 0.99, 1.0))
            yield f"| {CONDITIONS[name]} | {what} | {found} |"


def where_rows(kept: Kept) -> Iterator[str]:
    """On which machine each part was measured, and what else it did."""
    for part, title in TITLES.items():
        if part in kept:
            at = kept[part]["where"]
            machine = f"{at['processors']} of {at['processor']}"
            yield f"| {title} | {at['day']} | {machine} | {at['system']} | {at['load']} |"


def survived(kept: Kept) -> str:
    """Kills and cuts, in words."""
    one = kills_of(kept)
    restored = one["READ"] + one["UNIQUE"] + one["PARKED"]
    return KILLED.format(
        kills=one["kills"], minutes=one["seconds"] / 60, begun=one["in motion or ready"], changes=one["changes"],
        restored=restored, **{name: kept["cuts"][name] for name in ("cuts", "disks", "old", "new")},
    )  # fmt: skip


def soak_text(kept: Kept) -> str:
    """The longest soak, in words."""
    one = soak_of(kept)
    fault = "no fault" if one["fault"] is None else f"fault {one['fault']['code']}"
    return SOAKED.format(**one | {"minutes": one["seconds"] / 60, "percent": 100 * one["grown"], "fault": fault})


def stops_text(kept: Kept) -> str:
    """How stops were measured, and what kept the axis from being stopped."""
    overruns = kept["idle"]["overruns"] + kept["load"]["overruns"]
    return STOPS.format(number=len(kept["idle"]["zero"]), ramp=kept["ramp"], overruns=overruns)


def hours_text(kept: Kept) -> list[str]:
    """Fault-free hours, as far as they were simulated."""
    hours = hours_of(kept)
    if not hours:
        return []
    rows = [f"| {METHODS[name]} | {one['motions']} | {one['faults']} |" for name, one in hours.items()]
    return ["| method | motions in an hour | faults |", "| --- | --: | --: |", *rows, ""]


def page(kept: Kept) -> str:
    """All figures, as Markdown."""
    missing = kept["lateness"]["missing"]
    permitted = f"Not permitted there: {', '.join(missing)}." if missing else "It had real-time priority."
    return "\n".join([
        HEADING, "| | asked | found | |", "| --- | --- | --- | --- |", *verdicts(kept), "",
        LATENESS.format(permitted=permitted),
        "| with | periods | over 64 us | over 256 us | over 1024 us | the latest within | skipped |",
        "| --- | --: | --: | --: | --: | --: | --: |", *lateness_rows(kept), "",
        BUS.format(**kept["lateness"]["page"]),
        stops_text(kept["stops"]),
        "| with | until | half of them | 99 of 100 | all |",
        "| --- | --- | --: | --: | --: |",
        *stop_rows(kept), "",
        "## Killed, and cut off", "", survived(kept), "", FAULTS, "## For long", "", soak_text(kept), "",
        *hours_text(kept), WHERE,
        "| | measured | processors | Linux | load before |", "| --- | --- | --- | --- | --: |",
        *where_rows(kept), "",
    ])  # fmt: skip


HEADING = """# Live: figures

This page is written by `python -m tests.live_figures`, run from the root of the project in about seven minutes; do not
edit it. What takes long is run by name: `python -m tests.live_figures "long kills" "long soak" "hour cascade"`. The
figures are those of [one machine](#where-it-was-measured) and of what else it did, not of the one where you read this.

## Asked and found

What was asked for, and what this machine did. What is not reached stands here as such.
"""
LATENESS = """## How late a period begins

The loop of the cascade example sleeps to the beginning of each period of 1 ms, and counts how late it wakes up.
{permitted}

```{{figure}} ../_static/figures/lateness.png
:alt: Share of periods that begin later than a time, from 1 us to 100 ms, in five conditions on logarithmic axes.

Share of periods that came later than a time. Where a line has crossed 1 ms, periods are skipped; it ends where none
came later.
```
"""
KILLED = """A live host moves its axis and writes its store, and is killed at any moment
([how](what-survives.md#what-was-measured)): {kills:,} kills in {minutes:.0f} min, {begun:,} of them once motion had
begun, with {changes:,} changes of its position table. No wrong position was accepted, and no change was lost that was
told to be made. After {restored:,} of the kills the position was restored, and right; after the others it counted as
unknown.

The power was cut at {cuts:,} moments, which left {disks:,} different disks: {old:,} with what was there before a
change, {new:,} with what was there after it, none with a mixture."""
SOAKED = """In {minutes:g} min of jogs and moves, {rounds} rounds, with a page of eight channels and clients that come
and go, memory grew by {percent:.2f} % after the first minute; {fault}; {skipped:,} of {periods} periods of 10 ms were
skipped."""
BUS = """The page drew {screens:g} screens and got {rows} rows a second. Meanwhile the drive, in another process on a
serial line with the CAN frames of `slcan`, answered {answers} times.
"""
STOPS = """## From Stop on the page to rest of the command

A jog at 100 mm/s of the same axis is stopped {number} times from a page's socket, first with the machine left alone,
then with a process that computes for each processor. The ramp itself lasts {ramp:.0f} ms of it. Times are those of the
loop's own clock, rounded up where it has skipped a period. {overruns} more jogs had ended before, by fault 50: the loop
had come late four times in a second, and led the axis to rest by itself.

```{{figure}} ../_static/figures/stops.png
:alt: Share of stops that were taken by the loop, and whose command stood still, within a time.

Share of stops within a time. Between both lines of a colour lies the ramp. Where a command stands still before the loop
has the stop, the lease of its jog has ended it: it had not been kept for 200 ms.
```
"""
FAULTS = """## How soon a fault is found

Of [every fault that was injected](fault-matrix.md) and reported, the time until it was, in simulated time. What takes
longer than a second begins at power-up, before anything moves, or is found only as it ends.

```{figure} ../_static/figures/detection.png
:alt: Times until each kind of fault was found, one point per case, from 1 ms to 4 s on a logarithmic axis.

A point is a cell of that page; the line through them spans the soonest and the latest. In brackets: how many.
```
"""
WHERE = """## Where it was measured

The load is the number of processes that wanted a processor in the minute before. Where it is more than there are
processors, others used the machine, too: "nothing added" then means that nothing was added.
"""
