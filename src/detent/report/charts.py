"""The figures of the page as data for the script in it: what to draw, in the units people read.

A chart is one plot area. It is described here, completely, so that the script knows nothing about print heads.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, cast

import numpy as np

from detent.report.data import (
    INCH,
    SPEED_STEP,
    ColumnErrors,
    Event,
    HeadPath,
    IdentifiedLine,
    Marks,
    Numbers,
    SpeedProfile,
    TurnAround,
)
from detent.report.thin import thin_indices

Chart = dict[str, Any]

PATH_SECONDS = 30.0
"""Time that the figure of the head's path shows: more than this is a grey block on any screen."""

MARKS = 100_000
"""Characters that a report draws: a megabyte of it. Beyond them whole pages are left out, and the report says so."""

POINTS = 3000
"""Points of one curve: three per pixel of a wide screen."""


def _list(values: Numbers, digits: int) -> list[float | None]:
    """Round for the page; NaN becomes a gap."""
    rounded: list[float] = np.round(np.asarray(values, dtype=np.float64), digits).tolist()
    return [value if isfinite(value) else None for value in rounded]


def _spans(t: Numbers, on: Numbers) -> list[list[float]]:
    """Give the stretches of time in which `on` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(on, dtype=np.int8), [0]))))
    last = len(t) - 1
    return [[round(float(t[a]), 4), round(float(t[min(b, last)]), 4)] for a, b in edges.reshape(-1, 2).tolist()]


def _events(events: Sequence[Event]) -> list[float]:
    return [round(event.t * 1e3, 4) for event in events]


def profile_charts(profile: SpeedProfile) -> list[Chart]:
    """Draw one line: speed above, drive below, over the same time.

    Parameters
    ----------
    profile : SpeedProfile
        One line from start to stop.

    Returns
    -------
    list of dict
        Two charts: speed [in/s], drive [count]; time in ms.
    """
    kept = np.union1d(thin_indices(profile.velocity, POINTS), thin_indices(profile.drive, POINTS))
    t = profile.t[kept] * 1e3
    bands = [{"spans": _spans(t, profile.transition[kept]), "colour": "brake", "label": "transition (TR)"}]
    if profile.print_span:
        spans = [[round(moment * 1e3, 3) for moment in profile.print_span]]
        bands.insert(0, {"spans": spans, "colour": "good", "label": "printing"})
    common = {"x": _list(t, 3), "xLabel": "time since the move began [ms]", "bands": bands, "sync": "profile",
              "events": _events(profile.events)}  # fmt: skip
    speed = common | {
        "id": "profile-speed",
        "yLabel": "speed [in/s]",
        "height": 220,
        "zero": True,
        "numbered": True,
        "foot": False,
        "series": [
            {"label": "demanded", "colour": "muted", "dash": [6, 4], "y": _list(profile.velocity_ref[kept] / INCH, 3)},
            {"label": "true speed", "colour": "speed", "width": 2, "y": _list(profile.velocity[kept] / INCH, 3)},
        ],
    }
    drive = common | {
        "id": "profile-drive",
        "yLabel": "drive [count]",
        "height": 220,
        "zero": True,
        "series": [
            {"label": "drive value", "colour": "drive", "width": 2, "step": True, "y": _list(profile.drive[kept], 1)},
        ],
    }
    return [speed, drive]


def turn_charts(turn: TurnAround) -> list[Chart]:
    """Draw a turn-around: motor current above, speed below, over the same time.

    Parameters
    ----------
    turn : TurnAround
        From the stop of one line to the steady speed of the next.

    Returns
    -------
    list of dict
        Two charts: current [A], speed [in/s]; time in ms.
    """
    kept = np.union1d(thin_indices(turn.current, POINTS), thin_indices(turn.velocity, POINTS // 4))
    t = turn.t[kept] * 1e3
    bands = [{"spans": _spans(t, turn.transition[kept]), "colour": "brake", "label": "transition (TR)"}]
    common = {"x": _list(t, 3), "xLabel": "time since the stop began [ms]", "bands": bands, "sync": "turn",
              "events": _events(turn.events), "zero": True}  # fmt: skip
    current = common | {
        "id": "turn-current",
        "yLabel": "current [A]",
        "height": 220,
        "numbered": True,
        "foot": False,
        "series": [{"label": "motor current", "colour": "current", "width": 1.5, "y": _list(turn.current[kept], 4)}],
    }
    speed = common | {
        "id": "turn-speed",
        "yLabel": "speed [in/s]",
        "height": 160,
        "series": [{"label": "true speed", "colour": "speed", "width": 2, "y": _list(turn.velocity[kept] / INCH, 3)}],
    }
    return [current, speed]


def path_chart(path: HeadPath) -> Chart:
    """Draw the head's position over the first half minute of the job, with the stretches in which it prints.

    Parameters
    ----------
    path : HeadPath
        The whole job, of which no more than `PATH_SECONDS` are drawn.

    Returns
    -------
    dict
        One chart: position [in from the left frame] over time [s].
    """
    end = int(np.searchsorted(path.t, float(path.t[0]) + PATH_SECONDS, side="right"))
    changes = np.flatnonzero(np.diff(np.asarray(path.printing[:end], dtype=np.int8)))
    # Both sides of each change, so that a line's first and last character stand where they belong.
    kept = np.union1d(thin_indices(path.position[:end], POINTS), np.concatenate((changes, changes + 1)))
    position = path.position[kept] / INCH
    printing = np.asarray(path.printing, dtype=bool)[kept]
    right = np.gradient(position) > 0 if len(position) > 1 else np.zeros(len(position), dtype=bool)
    nowhere = np.full(len(position), np.nan)
    return {
        "id": "path",
        "x": _list(path.t[kept], 4),
        "xLabel": "time [s]",
        "yLabel": "head position [in]",
        "height": 260,
        "yRange": [0.0, round(path.travel / INCH, 3)],
        "levels": [{"y": round(path.column0 / INCH, 3), "label": "column 0"}],
        "series": [
            {"label": "moving", "colour": "muted", "width": 1, "y": _list(position, 3)},
            {"label": "printing to the right", "colour": "right", "width": 3,
             "y": _list(np.where(printing & right, position, nowhere), 3)},
            {"label": "printing to the left", "colour": "left", "width": 3,
             "y": _list(np.where(printing & ~right, position, nowhere), 3)},
        ],
    }  # fmt: skip


def _nice_step(wanted: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= wanted * 0.999))


def histogram_chart(errors: ColumnErrors, limit: float) -> Chart:
    """Count how far from their place the columns landed, per direction of printing.

    Parameters
    ----------
    errors : ColumnErrors
        At least one column.
    limit : float
        Largest good column error [m].

    Returns
    -------
    dict
        One chart: columns per bin over micrometres to the right of the place.
    """
    offset = errors.offsets * 1e6
    seen = np.abs(offset[(errors.right + errors.left) > 0])
    largest = max(float(seen.max(initial=0.0)), 0.05)
    step = max(_nice_step(largest / 15), errors.bin_width * 1e6)
    half = int(np.ceil(largest / step + 0.5))
    edges = (np.arange(-half, half + 2) - 0.5) * step
    series = [
        {"label": f"printed to the {name}", "colour": name, "bars": side,
         "y": np.histogram(offset, edges, weights=counts)[0].astype(int).tolist()}
        for name, counts, side in (("right", errors.right, 1), ("left", errors.left, -1))
    ]  # fmt: skip
    limits = [sign * limit * 1e6 for sign in (-1, 1) if limit * 1e6 <= edges[-1]]
    return {
        "id": "histogram",
        "x": _list((edges[:-1] + edges[1:]) / 2, 4),
        "xLabel": "\u2190 left of its place   [µm]   right of it \u2192",
        "yLabel": "columns",
        "height": 260,
        "zero": True,
        "marks": [{"x": round(value, 3), "label": "limit"} for value in limits],
        "series": series,
    }


def identified_chart(line: IdentifiedLine) -> Chart:
    """Draw the drive value against speed in one direction: measured points, the line through them, the truth.

    Parameters
    ----------
    line : IdentifiedLine
        One direction.

    Returns
    -------
    dict
        One chart: drive [count] over speed [in/s].
    """
    speeds = np.unique(np.concatenate(([0.0, 240.0], [point[0] for point in line.points])))

    def drive_at(slope: float, friction: float) -> list[float | None]:
        return _list(slope / 256 * speeds + friction, 2)

    series: list[dict[str, Any]] = []
    if line.default_slope is not None and line.default_friction is not None:
        values = drive_at(line.default_slope, line.default_friction)
        series.append({"label": "power-on default", "colour": "muted", "dash": [2, 4], "width": 1.5, "y": values})
    colour = "right" if line.direction > 0 else "left"
    series.append({"label": "identified", "colour": colour, "width": 3, "y": drive_at(line.slope, line.friction)})
    if line.true_slope is not None and line.true_friction is not None:
        values = drive_at(line.true_slope, line.true_friction)
        series.append({"label": "true machine", "colour": "ink", "dash": [8, 6], "width": 1.5, "y": values})
    if line.points:
        measured = dict(line.points)
        values = [measured.get(float(speed)) for speed in speeds]
        series.append({"label": "measured", "colour": "ink", "points": 9, "y": values})
    return {
        "id": f"identified-{colour}",
        "title": f"To the {colour}",
        "x": _list(speeds * SPEED_STEP / INCH, 4),
        "xLabel": "speed [in/s]",
        "yLabel": "drive [count]",
        "height": 260,
        "yRange": [0, 220],
        "levels": [{"y": round(line.friction, 2), "label": f"friction {line.friction:g}"}],
        "series": series,
    }


def page_data(marks: Marks, limit: float) -> dict[str, Any]:
    """Give the printed pages, line by line, for drawing characters where they landed; at most `MARKS` of them.

    Parameters
    ----------
    marks : Marks
        Everything struck.
    limit : float
        Largest good column error [m].

    Returns
    -------
    dict
        Pages with their lines; columns and widths in 1/120 in, heights in 1/48 in, offsets in micrometres; the factor
        that makes the errors visible; how many pages were left out.
    """
    numbers, sizes = np.unique(marks.page, return_counts=True)
    kept = numbers[: max(1, int(np.searchsorted(np.cumsum(sizes), MARKS, side="right")))]
    worst = float(np.abs(marks.offset).max()) if len(marks) else 0.0
    column = np.round(marks.column / INCH * 120, 2)
    extent = float((column + marks.width / INCH * 120).max()) if len(marks) else 0.0
    return {
        "pages": [_one_page(marks, int(number)) for number in kept],
        "leftOut": len(numbers) - len(kept),
        "limit": round(limit * 1e6, 2),
        "columns": round(extent, 1),
        "magnify": _magnification(worst),
    }


def _magnification(worst: float) -> int:
    """Choose the factor that draws the worst error [m] a character wide or a little less."""
    if worst <= 0:
        return 1
    wanted = 0.1 * INCH / worst
    return max((n for k in range(7) for n in (10**k, 2 * 10**k, 5 * 10**k) if n <= wanted), default=1)


def _one_page(marks: Marks, number: int) -> dict[str, Any]:
    rows = np.flatnonzero(np.asarray(marks.page) == number)
    starts = np.flatnonzero(np.diff(marks.line[rows], prepend=marks.line[rows[0]] - 1))
    lines: list[dict[str, Any]] = []
    for row in np.split(rows, starts[1:]):
        order = row[np.argsort(marks.column[row], kind="stable")]
        lines.append({
            "n": int(marks.line[order[0]]),
            "d": int(marks.direction[order[0]]),
            "y": round(float(marks.baseline[order[0]]) / INCH * 48, 2),
            "text": "".join([marks.characters[index] for index in cast("list[int]", order.tolist())]),
            "x": _list(marks.column[order] / INCH * 120, 2),
            "off": _list(marks.offset[order] * 1e6, 2),
            "w": round(float(np.median(marks.width[order])) / INCH * 120, 2),
            "bold": np.flatnonzero(marks.strikes[order] > 1).tolist(),
        })  # fmt: skip
    return {"number": number, "lines": lines}
