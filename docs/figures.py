"""The figures of the print head, each drawn from a run of the simulation, and the helpers of the other figures_*.py.

draw.py calls the functions in FIGURES of each of these files.
"""

from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).resolve().parent / "_build" / "figures"
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#7d8996"
DRIFTED = ("disturbance.motor_constant=+10 %", "disturbance.friction_right=+20 %", "disturbance.friction_left=+20 %")
SIGNALS = (
    "plant.train.position", "plant.train.velocity", "plant.train.current", "controller.head.drive_cmd",
    "controller.head.state", "lines.transition", "controller.head.calibration_pass", "controller.head.emitter",
)  # fmt: skip
IR_COUNTS = 96
WHITE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
PASSES = ("", "fast, left", "fast, right", "slow, left", "slow, right")


@cache
def run(*overrides: str) -> Any:
    """The letter on the example axis, recorded every 80 us."""
    import detent

    axis = detent.load(detent.example("print_head.toml"), overrides)
    return axis.run(detent.example("letter.txt"), signals=SIGNALS, every=2)


@contextmanager
def picture(name: str, rows: int, height: float, *, columns: int = 1, share_x: bool = True) -> Generator[Any]:
    """Axes of a figure that is saved on leaving."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    from detent.page.plots import STYLE

    with plt.rc_context(STYLE | {"axes.titleweight": "normal", "axes.titlesize": 10}):
        figure, axes = plt.subplots(
            rows, columns, figsize=(8.5, height), sharex=share_x, layout="constrained", squeeze=False
        )
        yield axes[:, 0] if columns == 1 else axes[0]
        figure.savefig(FOLDER / name)
        plt.close(figure)


def line_of(done: Any, number: int) -> Any:
    """Record of a printed line."""
    return next(line for line in done.result.lines if line.number == number)


def speed_of(part: Any) -> Any:
    """Carriage speed [in/s]."""
    return part["plant.train.velocity"] / 0.0254


def label(area: Any, text: str, at: tuple[float, float], offset: tuple[float, float]) -> None:
    """Write beside a point, `offset` in points of the page."""
    area.annotate(text, at, offset, va="top", textcoords="offset points", fontsize=9, bbox=WHITE)


def power_up() -> None:
    """Homing and the four identification passes."""
    done = run()
    part = done.trace.between(0.0, done.result.time_ready)
    t, position, number = part.time, part["plant.train.position"] / 0.0254, part["controller.head.calibration_pass"]
    with picture("power-up.png", 2, 4.6) as (where, speed):
        where.plot(t, position, color=BLUE)
        where.set_ylabel("head position [in]")
        speed.plot(t, speed_of(part), color=BLUE)
        speed.set_ylabel("speed [in/s]")
        speed.set_xlabel("time since power-on [s]")
        homing = t[number == 0]
        spans = [(homing[0], homing[homing < t[np.flatnonzero(number)[0]]][-1], "homing")]
        spans += [(t[number == k][0], t[number == k][-1], text) for k, text in enumerate(PASSES) if k]
        for k, (begin, end, text) in enumerate(spans):
            for area in (where, speed):
                area.axvspan(begin, end, color=GREY, alpha=0.16 if k % 2 == 0 else 0.05, linewidth=0)
            where.text((begin + end) / 2, 16.6, text.replace(", ", "\n"), ha="center", va="top", fontsize=8)
        where.set_ylim(-0.5, 17)
        where.margins(x=0)


def parts_of_the_drive() -> None:
    """Drive value of a move, taken apart into friction, back-EMF and what is left: the IR part."""
    done = run()
    line = line_of(done, 3)
    part = done.trace.between(line.start, line.stop)
    found = done.result.identified["right" if line.direction > 0 else "left"]
    sign = line.direction
    t, drive, speed = (part.time - line.start) * 1e3, part["controller.head.drive_cmd"] * sign, speed_of(part) * sign
    emf = found.slope * 6 * speed / 256
    friction = np.full_like(emf, found.friction)
    with picture("parts.png", 2, 5.4) as (whole, parts):
        whole.plot(t, drive, color="black", label="drive value put out")
        whole.set_ylabel("drive along the motion [count]")
        parts.plot(t, emf, color=BLUE, label="back-EMF part: K × speed / 256")
        parts.plot(t, friction, color=GREEN, label=f"friction part: {found.friction}")
        parts.plot(t, drive - emf - friction, color=ORANGE, label="what is left: the IR part")
        for level in (IR_COUNTS, -IR_COUNTS):
            parts.axhline(level, color=ORANGE, linestyle=":", linewidth=1)
        parts.text(t[-1], IR_COUNTS + 6, "+96", color=ORANGE, ha="right")
        parts.text(t[-1], -IR_COUNTS + 6, "−96", color=ORANGE, ha="right")
        parts.set_ylabel("its parts [count]")
        parts.set_xlabel("time since the move began [ms]")
        for area in (whole, parts):
            area.axhline(0, color=GREY, linewidth=0.8)
            area.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, fontsize=9)
            area.margins(x=0)


def two_points() -> None:
    """The line through two measured points, on a machine that has drifted from its nameplate."""
    done = run(*DRIFTED)
    v = np.array([0.0, 42.0])

    def drive(slope: float, friction: float) -> Any:
        return slope * 6 * v / 256 + friction

    with picture("two-points.png", 1, 4.0, columns=2) as areas:
        for area, (side, line) in zip(areas, done.result.identified.items(), strict=True):
            default = drive(line.default_slope, line.default_friction)
            area.plot(v, default, ":", color=GREY, label="power-on default")
            true = drive(line.true_slope, line.true_friction)
            area.plot(v, true, color=ORANGE, linewidth=4, alpha=0.35, label="true")
            area.plot(v, drive(line.slope, line.friction), color=BLUE, label="identified")
            for speed, counts in ((line.speed_fast / 6, line.drive_fast), (line.speed_slow / 6, line.drive_slow)):
                area.plot(speed, counts, "o", color=BLUE, markersize=7)
                label(area, f"{counts} counts\ngave {speed:.1f} in/s", (speed, counts), (9, -2))
            area.plot(0, line.friction, "o", markerfacecolor="white", markeredgecolor=BLUE, markersize=7, clip_on=False)
            label(area, f"friction {line.friction}", (0, line.friction), (10, -8))
            area.set_title(f"moving {side}", loc="left")
            area.set_xlabel("speed [in/s]")
            area.set_xlim(0, 42)
            area.set_ylim(0, 230)
        areas[0].set_ylabel("drive value [count]")
        areas[0].legend(loc="upper left")


def transition() -> None:
    """Motor current of a stop with and without transition mode."""
    with picture("transition.png", 3, 6.4) as (drive, current, speed):
        for text, colour, overrides in (
            ("with transition mode", BLUE, ()),
            ("without: the head coasts until the drive value is 0", ORANGE, ("method.transition=false",)),
        ):
            done = run(*overrides)
            line = line_of(done, 8)
            part = done.trace.between(line.start, line.stop)
            state, sign = part["controller.head.state"], line.direction
            stop = int(np.flatnonzero((state[1:] >= 9) & (state[:-1] == 8))[0]) + 1
            t = (part.time - part.time[stop]) * 1e3
            keep = (t > -15) & (t < (line.stop - part.time[stop]) * 1e3)
            drive.plot(t[keep], part["controller.head.drive_cmd"][keep] * sign, color=colour, label=text)
            current.plot(t[keep], part["plant.train.current"][keep] * sign, color=colour)
            speed.plot(t[keep], speed_of(part)[keep] * sign, color=colour)
        for area, text in ((drive, "drive value [count]"), (current, "motor current [A]"), (speed, "speed [in/s]")):
            area.set_ylabel(text)
            area.axhline(0, color=GREY, linewidth=0.8)
            area.axvline(0, color=GREY, linestyle=":", linewidth=1)
            area.margins(x=0)
        drive.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=9)
        speed.set_xlabel("time since the stop began [ms]")


def turn_around() -> None:
    """From one line straight into the next: drive value, current and speed through zero."""
    with picture("turn-around.png", 3, 6.4) as (drive, current, speed):
        for text, colour, overrides in (
            ("with the friction jump", BLUE, ()),
            ("without it", ORANGE, ("method.friction_jump=false",)),
        ):
            done = run(*overrides)
            line = line_of(done, 4)
            part = done.trace.between(line.start - 0.08, line.start + 0.11)
            t = (part.time - line.start) * 1e3
            drive.plot(t, part["controller.head.drive_cmd"], color=colour, label=text)
            current.plot(t, part["plant.train.current"], color=colour)
            speed.plot(t, speed_of(part), color=colour)
        for area, text in ((drive, "drive value [count]"), (current, "motor current [A]"), (speed, "speed [in/s]")):
            area.set_ylabel(text)
            area.axhline(0, color=GREY, linewidth=0.8)
            area.axvline(0, color=GREY, linestyle=":", linewidth=1)
            area.margins(x=0)
        drive.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=9)
        speed.set_xlabel("time since zero speed [ms]")


def comparison() -> None:
    """Three ways of choosing the drive value on the drifted machine: what `detent compare` draws."""
    import detent
    from detent.page.draw import draw_figures

    axis = detent.load(detent.example("print_head.toml"), DRIFTED)
    (drives,) = axis.compare()
    draw_figures(drives.figures(), FOLDER / "comparison.png")


FIGURES = (power_up, parts_of_the_drive, two_points, transition, turn_around, comparison)
