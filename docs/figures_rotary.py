"""The figures of the rotary table: each is drawn from runs of the simulation."""

from functools import cache
from typing import Any

import numpy as np
from figures import BLUE, FOLDER, GREEN, GREY, ORANGE, label, picture

PINK = "#CC79A7"
LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "fontsize": 9}
LITERAL = (
    *(f"position.{number}.direction=as commanded" for number in range(5)),
    *(f"protection.{watch}=0" for watch in ("overspeed", "jump")),
    *(f"protection.{watch}_time=0 s" for watch in ("following", "stuck", "reversed")),
)
"""The example's positions as an axis without the turn counter can take them; and nothing stops it when it fails."""
SLOW, FAST = 0.1, 60.0
"""Slowest and fastest manual feed of the specification [deg/s]."""


def table(*overrides: str) -> Any:
    """The example axis."""
    import detent

    return detent.load(detent.example("rotary_table.toml"), overrides)


def jog(axis: Any, seconds: float, speed: float, sign: int = 1, **options: Any) -> Any:
    """Hold a button for so long from power-on; speed of the dial in deg/s."""
    from detent.methods.rotary_table.sequence_job import Jog, SequenceJob

    step = Jog(direction=sign, speed=np.radians(speed), duration=seconds)
    return axis.run(SequenceJob("jog", (step,), {}), **options)


def degrees(spec: Any, words: Any) -> Any:
    """Counts with fraction bits as degrees."""
    return np.degrees(words * spec.count / (1 << spec.method.fraction_bits))


# -- detector ----------------------------------------------------------------------------------------------------------
def composition() -> None:
    """Motor turns by both words and by their difference, and the share of wrong angles over the coarse error."""
    from detent.methods.rotary_table.build import build_rotary_table
    from detent.sensing.resolver_counter import AbsoluteAngle, compose

    spec = table().spec
    p, r = build_rotary_table(spec).controller.composition, AbsoluteAngle()
    turn = 360 / spec.ratio
    places = np.arange(0, spec.period, 719)
    errors = np.arange(-2.5, 2.51, 0.1)
    with picture("composition.png", 1, 4.0, columns=2, share_x=False) as (words, wrong):
        angles = np.arange(0, 3 * p.fine, 8)
        place, fine = angles * 360 / spec.period, angles % p.fine / p.fine
        coarse = (place + 1.0) * p.coarse // 360 * p.ratio / p.coarse
        words.plot(place, fine, color=BLUE, linewidth=1.2, label="fine")
        words.plot(place, coarse, color=ORANGE, linewidth=1.2, label="coarse, 1 deg too much")
        words.plot(place, coarse - fine, color=PINK, linewidth=1.2, label="coarse − fine")
        words.step(place, np.round(coarse - fine), color=GREEN, linewidth=2.5, alpha=0.6, label="rounded")
        words.set_xlabel("table angle [deg]")
        words.set_ylabel("turns of the motor")
        words.set_xticks(np.arange(0, 3 * turn + 1, turn))
        words.set_yticks(range(4))
        words.legend(**LEGEND, ncols=2)
        for text, colour, truncating in (("rounded", BLUE, 0), ("coarse alone", ORANGE, 1)):
            p.truncating = truncating
            shares = []
            for error in errors:
                missed = 0
                for theta in places:
                    phase = theta / spec.period + float(error) / 360
                    compose(p, r, int(theta) % p.fine, int(phase % 1.0 * p.coarse))
                    missed += r.theta != theta
                shares.append(100 * missed / len(places))
            wrong.plot(errors, shares, ".-", color=colour, linewidth=1.2, markersize=5, label=text)
        for side in (-1, 1):
            wrong.axvline(side * turn / 2, color=GREY, linestyle="--", linewidth=1)
        wrong.set_xlabel("error of the coarse word [deg]")
        wrong.set_ylabel(f"angles that are {turn:g} deg off [%]")
        wrong.legend(**LEGEND, ncols=2)


# -- the method --------------------------------------------------------------------------------------------------------
WALK_SIGNALS = (
    "controller.positioner.angle.dar", "controller.positioner.angle.aar", "controller.positioner.angle.turn",
    "controller.positioner.oar", "controller.positioner.z", "controller.positioner.interpolator.irr",
    "controller.positioner.dr", "controller.positioner.rollovers",
)  # fmt: skip


def walk() -> None:
    """A jog over two rollovers and its stop: D, R, C, M, the remaining angle and the deviation."""
    axis = table("mechanics.start_angle=100 deg")
    done = jog(axis, 13.5, FAST, signals=WALK_SIGNALS, every=20)
    spec, part = axis.spec, done.trace
    t, begin = part.time - done.result.time_ready, done.result.time_ready
    scale = np.degrees(spec.count)
    d, r, m = (part[f"controller.positioner.{name}"] * scale for name in ("angle.dar", "angle.aar", "oar"))
    left = degrees(spec, part["controller.positioner.interpolator.irr"])
    c = m - part["controller.positioner.z"] * left
    jogging = m > 700
    with picture("endless-jog.png", 3, 7.6) as (angle, rest, lag):
        angle.plot(t, np.where(jogging, m, np.nan), color=GREEN, linestyle=":", linewidth=1.5, label="M target")
        angle.plot(t, np.where(jogging, np.nan, m), color=GREEN, linestyle=":", linewidth=1.5)
        for values, colour, style, text in (
            (d, GREY, "-", "D detected"), (r, BLUE, "-", "R extended"), (c, ORANGE, "--", "C interpolated target")
        ):  # fmt: skip
            cut = np.abs(np.diff(values, prepend=values[0])) > 180
            width = 3.5 if colour == GREY else 1.4
            angle.plot(t, np.where(cut, np.nan, values), style, color=colour, linewidth=width, label=text)
        angle.axhline(360, color=GREY, linewidth=0.8)
        angle.set_ylabel("angle [deg]")
        angle.set_yticks(range(0, 1081, 180))
        angle.set_ylim(-20, 980)
        angle.legend(**LEGEND, ncols=4)
        _name_points(angle, t, part, r, m)
        rest.plot(t, left, color=BLUE)
        for level, text in ((720, "2 T"), (360, "T")):
            rest.axhline(level, color=ORANGE, linestyle="--", linewidth=1)
            rest.text(1.01, level, text, va="center", fontsize=9, transform=rest.get_yaxis_transform())
        rest.set_ylabel("remaining IR [deg]")
        rest.set_yticks(range(0, 721, 180))
        lag.plot(t, degrees(spec, part["controller.positioner.dr"]), color=PINK)
        lag.set_ylabel("deviation dR [deg]")
        lag.set_xlabel("time since the button was pressed [s]")
        lag.set_xlim(0, part.time[-1] - begin)
        extended = part["controller.positioner.angle.turn"] != 0
        for area in (angle, rest, lag):
            area.fill_between(
                t, 0, 1, where=extended, transform=area.get_xaxis_transform(), color=BLUE, alpha=0.08, linewidth=0
            )


def _name_points(area: Any, t: Any, part: Any, r: Any, m: Any) -> None:
    """Names of figure 5 of the method at the points of the first two cycles."""
    area.plot(t[2], r[2], "o", color=BLUE, markersize=5, clip_on=False)
    label(area, "P0", (t[2], r[2]), (5, 18))
    crossed = np.flatnonzero(np.diff(part["controller.positioner.angle.turn"]) > 0) + 1
    rolled = np.flatnonzero(np.diff(part["controller.positioner.rollovers"]) > 0) + 1
    for k in crossed:
        area.plot(t[k], r[k], "o", color=BLUE, markersize=5)
        label(area, "P2", (t[k], r[k]), (7, -3))
    for k in rolled:
        for place, text in ((k - 1, "P3"), (k, "P5")):
            area.plot(t[place], r[place], "o", color=BLUE, markersize=5)
            label(area, text, (t[place], r[place]), (7, 4) if text == "P3" else (7, -3))
    label(area, "P4 = P6: never reached", (0.1, m.max()), (0, 16))


def conventional() -> None:
    """Over the boundary with the angle of one turn and with the endless one: what `detent compare` draws first."""
    from detent.page.draw import draw_figures

    (found,) = table().compare()
    draw_figures(found.figures()[:1], FOLDER / "conventional.png")


# -- the literal form --------------------------------------------------------------------------------------------------
def travelled(place: float, speed: float, judge: str, sign: int = 1, turns: float = 1.4) -> float:
    """Way of a jog with the literal form [deg], along its direction; judged by IR ("theoretical") or by AR."""
    start = f"mechanics.start_angle={place % 360!r} deg"
    axis = table(start, "method.form=flag", f"method.judge={judge}", *LITERAL)
    done = jog(axis, turns * 360 / speed, speed, sign, every=0)
    return sign * float(np.degrees(done.result.steps[0].travel))


def threshold(speed: float, judge: str) -> float:
    """Distance beyond the boundary up to which a start fails [deg]; by AR, before it."""
    from detent.methods.rotary_table.derive import TableFigures

    side, turns = (1, 1.4) if judge == "theoretical" else (-1, 2.4)
    low, high = 0.0, 1.1 * float(np.degrees(TableFigures(table().spec).following_error(np.radians(speed)))) + 0.05
    for _ in range(7):
        middle = 0.5 * (low + high)
        missed = abs(travelled(side * middle, speed, judge, turns=turns) - 360 * turns) > 100
        low, high = (middle, high) if missed else (low, middle)
    return low


def start_angles() -> None:
    """Where the literal form throws the table back, over time and over speed and start angle."""
    from detent.methods.rotary_table.derive import TableFigures

    with picture("start-angles.png", 1, 4.2, columns=2, share_x=False) as (ways, places):
        for place, colour in ((3.0, BLUE), (1.5, PINK), (0.5, ORANGE)):
            axis = table(f"mechanics.start_angle={place} deg", "method.form=flag", *LITERAL)
            done = jog(axis, 14, FAST, signals=("controller.positioner.angle.position",), every=20)
            t, way = done.trace.time - done.result.time_ready, done.trace["controller.positioner.angle.position"]
            shown = t < 14
            ways.plot(
                t[shown], np.degrees((way[shown] - way[0]) * axis.spec.count), color=colour, label=f"{place:g} deg"
            )
        ways.set_xlabel("time since the button was pressed [s]")
        ways.set_ylabel("way of the table [deg]")
        ways.set_yticks(range(-720, 841, 180))
        ways.legend(**LEGEND, ncols=3, title="start angle", alignment="left")
        ways.margins(x=0)
        speeds = np.arange(10, 61, 2.0)
        machine = TableFigures(table().spec)
        lag = np.array([np.degrees(machine.following_error(np.radians(speed))) for speed in speeds])
        late = speeds * machine.spec.method.task_period
        for judge, colour, marker, text in (
            ("theoretical", ORANGE, "o", "IR, beyond 0"), ("actual", BLUE, "s", "AR, before 360 deg")
        ):  # fmt: skip
            found = [threshold(float(speed), judge) for speed in speeds]
            places.plot(speeds, found, marker, color=colour, markersize=4, label=text)
        places.fill_between(speeds, np.maximum(0, lag - late), lag, color=ORANGE, alpha=0.14, linewidth=0)
        places.plot(speeds, lag, color=ORANGE, linewidth=1, label="following error")
        places.plot(speeds, late, color=BLUE, linestyle=":", linewidth=1.2, label="way in a pass of the task")
        places.set_xlabel("speed of the jog [deg/s]")
        places.set_ylabel("starts up to here fail [deg]")
        places.set_ylim(0, 2.3)
        places.legend(**LEGEND, ncols=2, title="judged by", alignment="left")


def race() -> None:
    """An interrupt between the two halves of a rollover, in both orders, and the indivisible one."""
    cases = (
        ("flag first", "flag first", ORANGE), ("remaining angle first", "remaining first", PINK),
        ("indivisible", "atomic", BLUE),
    )  # fmt: skip
    registers = tuple(f"controller.positioner.{name}" for name in ("dr", "s4", "rollovers"))
    signals = (*registers, "plant.train.motor.velocity")
    with picture("race.png", 3, 6.2) as (lag, signal, speed):
        for text, update, colour in cases:
            axis = table("mechanics.start_angle=100 deg", f"method.update={update}", "method.task_phase=0.2 ms")
            done = jog(axis, 6.3, FAST, signals=signals, every=1)
            part, spec = done.trace, axis.spec
            rolled = int(np.flatnonzero(np.diff(part["controller.positioner.rollovers"]) > 0)[0]) + 1
            keep = slice(rolled - 60, rolled + 160)
            t = (part.time[keep] - part.time[rolled]) * 1e3
            word = np.degrees(spec.speed_per_word)
            velocity = np.degrees(part["plant.train.motor.velocity"][keep]) / spec.ratio
            lag.step(t, degrees(spec, part["controller.positioner.dr"][keep]), where="post", color=colour, label=text)
            signal.step(t, part["controller.positioner.s4"][keep] * word, where="post", color=colour)
            speed.plot(t, velocity, color=colour)
        lag.set_ylabel("deviation dR [deg]")
        lag.set_yticks(range(-360, 361, 180))
        signal.set_ylabel("signal S4 [deg/s]")
        speed.set_ylabel("table speed [deg/s]")
        speed.set_xlabel("time since the rollover [ms]")
        lag.legend(**LEGEND, ncols=3)
        speed.margins(x=0)


# -- manual feed -------------------------------------------------------------------------------------------------------
FEEDS = (
    ("position loop closed", BLUE, ()),
    ("closed, whole counts only", GREEN, ("method.fraction_bits=0",)),
    ("dial speed as the signal", ORANGE, ("method.position_control=false",)),
)


@cache
def feed_axis(overrides: tuple[str, ...]) -> Any:
    """The example axis for a feed, loaded once."""
    return table(*overrides)


def mean_speed(axis: Any, speed: float) -> float:
    """Speed of a jog once it runs evenly [deg/s]: the slope of a line through 5 s of it."""
    signals = ("plant.train.motor.turns", "plant.train.motor.angle")
    part = jog(axis, 7.0, speed, signals=signals, every=20).trace
    way = (part["plant.train.motor.turns"] + part["plant.train.motor.angle"] / (2 * np.pi)) * 360 / axis.spec.ratio
    even = (part.time > 1.5) & (part.time < 6.5)
    return float(np.polyfit(part.time[even], way[even], 1)[0])


def feed() -> None:
    """Mean speed of manual feed over the dial, and the way at its slowest."""
    # Whole counts round the dial to 0.49 deg/s: below half of that there is no jog at all.
    speeds = np.geomspace(0.06, 60, 120)
    with picture("manual-feed.png", 1, 4.2, columns=2, share_x=False) as (error, way):
        for text, colour, overrides in FEEDS:
            axis = feed_axis(overrides)
            least = 0.5 * np.degrees(axis.spec.count) / axis.spec.method.strobe_period
            possible = speeds[speeds > least] if "method.fraction_bits=0" in overrides else speeds
            off = [100 * (mean_speed(axis, float(speed)) / speed - 1) for speed in possible]
            error.semilogx(possible, off, color=colour, linewidth=1.3, label=text)
        error.set_xlabel("dial [deg/s]")
        error.set_ylabel("mean speed less dial [%]")
        error.set_xticks([0.1, 1, 10, 60])
        error.xaxis.set_major_formatter("{x:g}")
        error.set_ylim(-45, 45)
        error.legend(**LEGEND)
        for _, colour, overrides in (FEEDS[0], FEEDS[2]):
            axis = feed_axis(overrides)
            done = jog(axis, 10.0, SLOW, signals=("plant.train.motor.angle",), every=20)
            t = done.trace.time - done.result.time_ready
            moved = np.unwrap(done.trace["plant.train.motor.angle"]) / axis.spec.ratio
            asked = np.radians(SLOW) * t
            way.plot(t, (moved - moved[0] - asked) / axis.spec.count, color=colour)
        zero = {"color": GREY, "linewidth": 0.8}
        way.axhline(0, **zero)
        way.set_xlim(0, 10)
        way.set_xlabel(f"time at {SLOW:g} deg/s [s]")
        way.set_ylabel("way less dial × time [count]")


def sequence() -> None:
    """The packaged sequence: angle, signals, deviation."""
    import detent

    axis = table()
    job = axis.load_job(detent.example("index_sequence.toml"))
    done = axis.run(job, signals=("controller.positioner.angle.position", "controller.positioner.dr"), every=20)
    result, part = done.result, done.trace
    begin = result.time_ready
    t = part.time - begin
    with picture("sequence.png", 3, 6.4) as (angle, lines, lag):
        angle.plot(t, np.degrees(part["controller.positioner.angle.position"] * axis.spec.count), color=BLUE)
        angle.set_ylabel("table angle [deg]")
        angle.set_yticks(range(0, 1081, 180))
        for step in result.steps:
            if step.kind in ("go", "jog"):
                colour = BLUE if step.kind == "go" else ORANGE
                angle.axvspan(step.begin - begin, step.end - begin, color=colour, alpha=0.1, linewidth=0)
        names = ("clamp", "ready", "inch", "feed")
        for place, name in enumerate(names):
            changes = [(time - begin, on) for time, which, on in result.inputs + result.outputs if which == name]
            times = [0.0, *(time for time, _ in changes), result.time_end - begin]
            levels = np.array([0.0, *(float(on) for _, on in changes)])
            drawn = 1.4 * place + np.append(levels, levels[-1])
            colour = GREEN if name == "clamp" else ORANGE
            lines.step(times, drawn, where="post", color=colour)
            lines.fill_between(times, 1.4 * place, drawn, step="post", color=colour, alpha=0.15, linewidth=0)
        lines.set_yticks([1.4 * place + 0.5 for place in range(len(names))], names)
        lines.grid(visible=False, axis="y")
        lag.plot(t, degrees(axis.spec, part["controller.positioner.dr"]), color=PINK)
        lag.set_ylabel("deviation [deg]")
        lag.set_xlabel("time since the sequence began [s]")
        lag.set_xlim(0, result.time_end - begin)


FIGURES = (composition, walk, conventional, start_angles, race, feed, sequence)
