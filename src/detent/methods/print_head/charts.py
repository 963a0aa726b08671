"""The charts of a print head's page, as data for the script that draws them."""

import numpy as np

from detent.methods.print_head.page_data import (
    SPEED_STEP,
    ColumnErrors,
    HeadPath,
    IdentifiedLine,
    SpeedProfile,
    TurnAround,
)
from detent.page.chart import (
    POINTS,
    Band,
    Chart,
    Curve,
    Heap,
    Panel,
    Timeline,
    histogram_chart,
    line_chart,
    spans_of,
    time_charts,
)
from detent.page.parts import INCH, Numbers
from detent.page.thin import thin_indices

PATH_SECONDS = 30.0
"""Time that the figure of the head's path shows: more than this is a grey block on any screen."""


def _transition(t: Numbers, on: Numbers) -> Band:
    return Band(label="transition (TR)", colour="brake", spans=spans_of(t, on))


def profile_charts(profile: SpeedProfile) -> list[Chart]:
    """Draw one line: speed above, drive below, over the same time."""
    bands = [_transition(profile.t, profile.transition)]
    if profile.print_span:
        bands.insert(0, Band(label="printing", colour="good", spans=[profile.print_span]))
    timeline = Timeline(
        name="profile", t=profile.t, label="time since the move began", bands=bands, events=profile.events
    )
    demanded = Curve(label="demanded", colour="muted", dash=(6, 4), y=profile.velocity_ref / INCH, thin=0)
    true = Curve(label="true speed", colour="speed", width=2, y=profile.velocity / INCH)
    drive = Curve(label="drive value", colour="drive", width=2, step=True, y=profile.drive, digits=1)
    return time_charts(timeline, [
        Panel(name="profile-speed", label="speed [in/s]", zero=True, curves=[demanded, true]),
        Panel(name="profile-drive", label="drive [count]", zero=True, curves=[drive]),
    ])  # fmt: skip


def turn_charts(turn: TurnAround) -> list[Chart]:
    """Draw a turn-around: motor current above, speed below, over the same time."""
    bands = [_transition(turn.t, turn.transition)]
    timeline = Timeline(name="turn", t=turn.t, label="time since the stop began", bands=bands, events=turn.events)
    current = Curve(label="motor current", colour="current", y=turn.current, digits=4)
    speed = Curve(label="true speed", colour="speed", width=2, y=turn.velocity / INCH, thin=POINTS // 4)
    return time_charts(timeline, [
        Panel(name="turn-current", label="current [A]", zero=True, curves=[current]),
        Panel(name="turn-speed", label="speed [in/s]", zero=True, curves=[speed], height=160),
    ])  # fmt: skip


def path_chart(path: HeadPath) -> Chart:
    """Draw the head's position over the first half minute of the job, with the stretches in which it prints."""
    end = int(np.searchsorted(path.t, float(path.t[0]) + PATH_SECONDS, side="right"))
    changes = np.flatnonzero(np.diff(np.asarray(path.printing[:end], dtype=np.int8)))
    # Both sides of each change, so that a line's first and last character stand where they belong.
    kept = np.union1d(thin_indices(path.position[:end], POINTS), np.concatenate((changes, changes + 1)))
    position = path.position[kept] / INCH
    printing = np.asarray(path.printing, dtype=bool)[kept]
    right = np.gradient(position) > 0 if len(position) > 1 else np.zeros(len(position), dtype=bool)
    to_right = np.where(printing & right, position, np.nan)
    to_left = np.where(printing & ~right, position, np.nan)
    panel = Panel(
        name="path",
        label="head position [in]",
        height=260,
        span=(0.0, round(path.travel / INCH, 3)),
        levels=[(round(path.column0 / INCH, 3), "column 0")],
        curves=[
            Curve(label="moving", colour="muted", width=1, y=position),
            Curve(label="printing to the right", colour="right", width=3, y=to_right),
            Curve(label="printing to the left", colour="left", width=3, y=to_left),
        ],
    )
    return line_chart(panel, path.t[kept], "time [s]")


def column_chart(errors: ColumnErrors, limit: float) -> Chart:
    """Count how far from their place the columns landed, per direction of printing."""
    heaps = [
        Heap(label=f"printed to the {name}", colour=name, at=errors.offsets * 1e6, counts=counts)
        for name, counts in (("right", errors.right), ("left", errors.left))
    ]
    labels = ("\u2190 left of its place   [µm]   right of it \u2192", "columns")
    return histogram_chart("histogram", heaps, labels, finest=errors.bin_width * 1e6, limit=limit * 1e6)


def identified_chart(line: IdentifiedLine) -> Chart:
    """Draw the drive value against speed in one direction: measured points, the line through them, the truth."""
    speeds = np.unique(np.concatenate(([0.0, 240.0], [point[0] for point in line.points])))
    curves: list[Curve] = []
    if line.default_slope is not None and line.default_friction is not None:
        drive = line.default_slope / 256 * speeds + line.default_friction
        curves.append(Curve(label="power-on default", colour="muted", dash=(2, 4), y=drive, digits=2))
    colour = "right" if line.direction > 0 else "left"
    drive = line.slope / 256 * speeds + line.friction
    curves.append(Curve(label="identified", colour=colour, width=3, y=drive, digits=2))
    if line.true_slope is not None and line.true_friction is not None:
        drive = line.true_slope / 256 * speeds + line.true_friction
        curves.append(Curve(label="true machine", colour="ink", dash=(8, 6), y=drive, digits=2))
    if line.points:
        measured = dict(line.points)
        drive = np.array([measured.get(speed, np.nan) for speed in speeds.tolist()])
        curves.append(Curve(label="measured", colour="ink", rings=9, y=drive, digits=2))
    panel = Panel(
        name=f"identified-{colour}",
        label="drive [count]",
        height=260,
        span=(0, 220),
        levels=[(round(line.friction, 2), f"friction {line.friction:g}")],
        curves=curves,
    )
    return line_chart(panel, speeds * SPEED_STEP / INCH, "speed [in/s]")
