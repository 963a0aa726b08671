"""The charts of a servo axis's page, as data for the script that draws them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from detent.methods.filtered_servo.comparison import FeedbackComparison
from detent.methods.moves.page_data import CountUnit, FilteredMove, JobPath, MovePath, MoveResult, PhaseMove
from detent.methods.phase_servo.hold_comparison import HoldCase, HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page.chart import (
    Band,
    Chart,
    Curve,
    Heap,
    Panel,
    Timeline,
    histogram_chart,
    line_chart,
    time_charts,
)
from detent.page.parts import Event, Numbers
from detent.page.words import GAP, number

PATH_SECONDS = 30.0
"""Time that the figure of the whole job shows: more than this is a grey block on any screen."""

FINEST_BAR = 0.1
"""Narrowest bar of the histogram [µm]."""

MM = 1e3
UM = 1e6


def job_chart(path: JobPath) -> Chart:
    """Draw position and target over the first half minute of the job.

    Parameters
    ----------
    path : JobPath
        The whole job, of which no more than `PATH_SECONDS` are drawn.

    Returns
    -------
    dict
        One chart: position [mm from the left end] over time [s].
    """
    end = int(np.searchsorted(path.t, float(path.t[0]) + PATH_SECONDS, side="right"))
    curves = [
        Curve(label="target", colour="muted", dash=(6, 4), step=True, y=path.target[:end] * MM, digits=4),
        Curve(label="true position", colour="speed", width=2, y=path.position[:end] * MM, digits=4),
    ]
    timeline = Timeline(name="job", t=path.t[:end], label="time since the axis was ready", unit="s")
    return time_charts(timeline, [Panel(name="job", label="position [mm]", height=260, curves=curves)])[0]


def rest_chart(moves: Sequence[MoveResult], tolerance: float) -> Chart:
    """Count how far from the target the axis stood at the end of each dwell, per direction of the move.

    Parameters
    ----------
    moves : sequence of MoveResult
        At least one.
    tolerance : float
        Distance that counts as arrived [m].

    Returns
    -------
    dict
        One chart: moves per bin over micrometres to the right of the target.
    """
    heaps: list[Heap] = []
    for name, right in (("right", True), ("left", False)):
        offsets = np.array([move.offset for move in moves if (move.way > 0) == right], dtype=float)
        heaps.append(Heap(label=f"moved to the {name}", colour=name, at=offsets * UM, counts=np.ones(len(offsets))))
    labels = ("← left of the target   [µm]   right of it →", "moves")
    return histogram_chart("rest", heaps, labels, finest=FINEST_BAR, limit=tolerance * UM)


# ---- one move


def move_charts(detail: PhaseMove | FilteredMove) -> list[Chart]:
    """Draw one move from its command to the end of its dwell.

    Parameters
    ----------
    detail : PhaseMove or FilteredMove
        The move.

    Returns
    -------
    list of dict
        Charts above one another; time in ms.
    """
    return _phase_charts(detail) if isinstance(detail, PhaseMove) else _filtered_charts(detail)


def _phase_charts(detail: PhaseMove) -> list[Chart]:
    path = detail.path
    bands = [Band(label="position mode", colour="good", spans=detail.position_mode)]
    counted = Curve(label="speed word", colour="muted", width=1, step=True, y=detail.counted_speed * MM)
    demanded = Curve(
        label="demanded by the table", colour="left", dash=(6, 4), step=True, y=path.velocity_ref * MM, thin=0
    )
    to_go = Curve(label="way to go", colour="speed", width=2, y=(path.target - path.position) * MM, digits=4)
    return time_charts(_timeline(path, bands), [
        Panel(name="move-speed", label="speed [mm/s]", zero=True, curves=[counted, demanded, _true_speed(path)]),
        Panel(name="move-to-go", label="way to go [mm]", height=140, zero=True, curves=[to_go]),
        Panel(name="move-drive", label="drive [count]", height=160, zero=True, curves=[_drive(path)]),
    ])  # fmt: skip


def _filtered_charts(detail: FilteredMove) -> list[Chart]:
    path = detail.path
    demanded = Curve(label="commanded", colour="left", dash=(6, 4), y=path.velocity_ref * MM, thin=0)
    deviation = Curve(label="following error", colour="speed", width=2, step=True, y=detail.deviation, digits=0)
    return time_charts(_timeline(path), [
        Panel(name="move-speed", label="speed [mm/s]", zero=True, curves=[_true_speed(path), demanded]),
        Panel(name="move-counted", label="speed word [pulse]", height=180, zero=True, curves=_speed_words(detail)),
        Panel(name="move-deviation", label="error [pulse]", height=160, zero=True, curves=[deviation]),
        Panel(name="move-drive", label="drive [count]", height=160, zero=True, curves=[_drive(path)]),
    ])  # fmt: skip


def _speed_words(detail: FilteredMove) -> list[Curve]:
    return [
        Curve(label="counted × B", colour="muted", step=True, y=detail.counted_speed, digits=1),
        Curve(label="after the filter", colour="speed", width=2, step=True, y=detail.filtered_speed),
    ]


def _timeline(path: MovePath, bands: list[Band] | None = None) -> Timeline:
    # The command itself comes shortly before the first row.
    events = [replace(event, t=max(event.t, float(path.t[0]))) for event in path.events]
    return Timeline(name="move", t=path.t, label="time since the command", bands=bands or [], events=events)


def _true_speed(path: MovePath) -> Curve:
    return Curve(label="true speed", colour="speed", width=2, y=path.velocity * MM)


def _drive(path: MovePath) -> Curve:
    return Curve(label="drive word", colour="drive", width=2, step=True, y=path.drive, digits=2)


def approach_charts(detail: PhaseMove | FilteredMove, unit: CountUnit, tolerance: float) -> list[Chart]:
    """Draw how the axis comes to rest at the target.

    Parameters
    ----------
    detail : PhaseMove or FilteredMove
        The move.
    unit : CountUnit
        The smallest way that the axis knows.
    tolerance : float
        Distance from the target that counts as arrived [m].

    Returns
    -------
    list of dict
        Two charts: position less target in counts, and the words that bring it there; time in ms. None if the axis
        never said that it was there.
    """
    path = detail.path
    if path.approach is None:
        return []
    first, last = np.searchsorted(path.t, path.approach).tolist()
    part = slice(first, last + 1)
    offset = (path.position[part] - path.target) / unit.size
    limit = tolerance / unit.size
    place = Panel(
        name="approach-place",
        label=f"off the target [{unit.word}]",
        height=260,
        zero=True,
        span=_span_around(offset, limit),
        levels=[(limit, f"+{number(limit)} {unit.words}"), (-limit, f"−{number(limit)} {unit.words}")],
        curves=[Curve(label="true position", colour="speed", width=2, y=offset)],
    )
    words = Panel(name="approach-words", label="words [count]", height=180, zero=True, curves=_words(detail, part))
    settled = [(path.settled, float(path.t[-1]))] if path.settled < path.t[-1] else []
    timeline = Timeline(
        name="approach",
        t=path.t[part],
        label="time since the command",
        bands=[Band(label="within the tolerance", colour="good", spans=settled)],
        events=path.events,  # all of them: those in sight have the numbers of the figure above
    )
    return time_charts(timeline, [place, words])


def _span_around(offset: Numbers, limit: float) -> tuple[float, float]:
    """Ends of an axis that shows the whole curve, and both limits with their names."""
    low, high = min(float(offset.min()), -limit), max(float(offset.max()), limit)
    room = high - low
    # More above: the numbers of the events stand there.
    return round(low - 0.1 * room, 3), round(high + 0.25 * room, 3)


def _words(detail: PhaseMove | FilteredMove, part: slice) -> list[Curve]:
    drive = Curve(label="drive word", colour="drive", width=2, step=True, y=detail.path.drive[part], digits=2)
    if isinstance(detail, FilteredMove):
        return [
            Curve(label="following error", colour="left", step=True, y=detail.deviation[part], digits=0),
            Curve(label="filtered speed", colour="muted", step=True, y=detail.filtered_speed[part]),
            drive,
        ]
    return [
        Curve(label="absolute error word", colour="left", step=True, y=detail.error_word[part], digits=0),
        Curve(label="integral", colour="ink", step=True, y=detail.integral[part], digits=0),
        drive,
    ]


# ---- the method beside its alternatives


def noise_chart(found: NoiseComparison) -> Chart:
    """Draw the rest point against the pulses that noise has put in, of both servos and both directions of travel.

    Parameters
    ----------
    found : NoiseComparison
        The comparison.

    Returns
    -------
    dict
        One chart: rest point less target [step] over pulses put in, - to the left.
    """
    pulses = np.array(found.pulses)
    # From the most - pulses over none, which both signs share, to the most + pulses; a ring needs room at either end.
    x = np.concatenate((-pulses[:0:-1], pulses))
    x = np.concatenate(([1.05 * x[0]], x, [1.05 * x[-1]]))

    def against(rest: Numbers, direction: int) -> Numbers:
        return np.concatenate(([np.nan], rest[:0:-1, 1, direction], rest[:, 0, direction], [np.nan]))

    # The lines are straight by their nature; what lies between two points of this servo nobody has tried.
    curves = [
        Curve(label="only incremental, moving right", colour="muted", width=2, y=against(found.incremental, 0)),
        Curve(
            label="only incremental, moving left", colour="muted", width=2, dash=(8, 4), y=against(found.incremental, 1)
        ),
        Curve(label="this servo, moving right", colour="right", rings=11, y=against(found.absolute, 0)),
        Curve(label="this servo, moving left", colour="left", rings=6, y=against(found.absolute, 1)),
    ]
    panel = Panel(name="noise", label="rest point, off the target [step]", height=300, zero=True, curves=curves)
    chart = line_chart(panel, x, "− pulses put in   [pulse]   + pulses put in")
    return chart | {"marks": [{"x": side * found.margin, "label": "limit"} for side in (-1, 1)]}


def hold_charts(found: HoldComparison) -> list[Chart]:
    """Draw the carriage at rest in each case: first unloaded and hunting, then pushed.

    Parameters
    ----------
    found : HoldComparison
        The comparison.

    Returns
    -------
    list of dict
        One chart per case of `found.still`, on one scale; then two charts of all cases of `found.loaded`.
    """
    return [*_still_charts(found), *_loaded_charts(found)]


def _still_charts(found: HoldComparison) -> list[Chart]:
    """What comes before the second half of the settling is left out: on its scale nothing else could be seen."""
    shown = [_since(case, found.stop_at) for case in found.still]
    reach = max((float(np.abs(case.displacement[part]).max()) for case, part in zip(found.still, shown, strict=True)))
    drawn: list[Chart] = []
    for index, (case, part) in enumerate(zip(found.still, shown, strict=True)):
        curve = Curve(label="true position", colour="speed", y=case.displacement[part])
        span = (round(-1.1 * reach, 3), round(1.1 * reach, 3))
        panel = Panel(name=f"still-{index}", label="off [step]", height=140, zero=True, span=span, curves=[curve])
        drawn += time_charts(Timeline(name="still", t=case.t[part]), [panel])
    return drawn


def _loaded_charts(found: HoldComparison) -> list[Chart]:
    part = _since(found.loaded[0], found.push_at)
    t = found.loaded[0].t[part]
    places: list[Curve] = []
    integrals: list[Curve] = []
    for case, colour, dash in zip(found.loaded, ("speed", "left"), (None, (6, 4)), strict=True):
        place, integral = np.interp(t, case.t, case.displacement), np.interp(t, case.t, case.integral)
        places.append(Curve(label=case.name, colour=colour, width=2, dash=dash, y=place))
        integrals.append(Curve(label=case.name, colour=colour, width=2, dash=dash, step=True, y=integral))
    timeline = Timeline(name="loaded", t=t, events=hold_events(found))
    return time_charts(timeline, [
        Panel(name="loaded-place", label="off the target [step]", height=220, zero=True, curves=places),
        Panel(name="loaded-integral", label="integral [count]", height=160, zero=True, curves=integrals),
    ])  # fmt: skip


def _since(case: HoldCase, moment: float) -> slice:
    """Rows from halfway between the arrival and a moment [s] on."""
    return slice(int(np.searchsorted(case.t, (float(case.t[0]) + moment) / 2)), None)


def hold_events(found: HoldComparison) -> list[Event]:
    """Moments of the charts under load.

    Parameters
    ----------
    found : HoldComparison
        The comparison.

    Returns
    -------
    list of Event
        In order of time.
    """
    events = [
        Event(found.push_at, f"a force of {number(found.push)}{GAP}N pushes from now on"),
        Event(found.stop_at, "stop: dead band and integrator take over"),
    ]
    return sorted(events, key=lambda event: event.t)


def feedback_charts(found: FeedbackComparison) -> list[Chart]:
    """Draw speed word and drive word at constant speed, without the filter and with it.

    Parameters
    ----------
    found : FeedbackComparison
        The comparison; its first case is without the filter, its second with it.

    Returns
    -------
    list of dict
        Two charts above one another, time in ms; none if one of the two did not come as far as constant speed.
    """
    without, with_filter = found.cases[:2]
    if not len(without.t) or not len(with_filter.t):
        return []
    t: Numbers = without.t - without.t[0]
    rows = np.searchsorted(with_filter.t - with_filter.t[0], t).clip(max=len(with_filter.t) - 1)

    def pair(before: Numbers, after: Numbers) -> list[Curve]:
        """The same quantity without and with the filter."""
        return [
            Curve(label="without the filter", colour="left", width=1, step=True, y=before),
            Curve(label="with the filter", colour="speed", width=2, step=True, y=after[rows]),
        ]

    speeds, drives = pair(without.speed_word, with_filter.speed_word), pair(without.error, with_filter.error)
    return time_charts(Timeline(name="feedback", t=t), [
        Panel(name="feedback-speed", label="speed word [pulse]", height=180, curves=speeds),
        Panel(name="feedback-drive", label="drive word [count]", zero=True, curves=drives),
    ])  # fmt: skip
