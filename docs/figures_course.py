"""The figure of the course of a live axis: one jog, let go at different moments."""

from typing import Any

import numpy as np
from figures import BLUE, GREEN, GREY, ORANGE, picture

LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "fontsize": 9}
PERIOD, HIGHEST = 1e-3, 0.2
RELEASES = ((0.075, ORANGE, "let go while speeding up"), (0.25, GREEN, "let go at speed"), (9.0, BLUE, "never let go"))


def jog_until(release: float) -> Any:
    """Time, position, velocity and acceleration of a jog at 0.5 m/s that is let go at a moment; shape (samples, 4)."""
    from detent.planning.course import Course, CourseLimits, advance, begin_at, come_to_rest, is_at_rest, run_at

    p, c = CourseLimits(), Course()
    p.speed, p.acceleration, p.jerk, p.lowest, p.highest = 0.5, 5.0, 100.0, 0.0, HIGHEST
    begin_at(c, 0.0)
    run_at(p, c, 0.5)
    found = [(0.0, 0.0, 0.0, 0.0)]
    while not is_at_rest(c):
        advance(p, c, PERIOD)
        found.append((len(found) * PERIOD, c.position, c.velocity, c.acceleration))
        if len(found) - 1 == round(release / PERIOD):
            come_to_rest(p, c)
    return np.array(found)


def let_go() -> None:
    """The three ends of a jog."""
    with picture("course.png", 3, 6.2) as (where, speed, acceleration):
        for release, colour, text in RELEASES:
            t, x, v, a = jog_until(release).T
            begin = int(np.searchsorted(t, release))
            for area, y, factor in ((where, x, 1e3), (speed, v, 1.0), (acceleration, a, 1.0)):
                area.plot(t * 1e3, y * factor, color=colour, label=text if area is where else None)
                if begin < len(t):
                    area.plot(t[begin] * 1e3, y[begin] * factor, "o", color=colour, markersize=5)
        where.axhline(HIGHEST * 1e3, color=GREY, linestyle=":", linewidth=1)
        where.text(2, HIGHEST * 1e3 - 4, "soft limit", color=GREY, va="top", fontsize=9)
        where.set_ylabel("position [mm]")
        where.legend(**LEGEND, ncols=3)
        speed.set_ylabel("velocity [m/s]")
        acceleration.set_ylabel("acceleration [m/s²]")
        acceleration.set_xlabel("time since the jog began [ms]")
        for area in (where, speed, acceleration):
            area.margins(x=0.01)


FIGURES = (let_go,)
