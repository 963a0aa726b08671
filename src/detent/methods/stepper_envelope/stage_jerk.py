"""The envelope of a stepper beside a profile of limited jerk: its charts, and what these share with its figure."""

import numpy as np

from detent.methods.stepper_envelope.comparison import JerkComparison, Profile
from detent.page.chart import Chart, Curve, Panel, line_chart
from detent.page.parts import Numbers

POINTS = 900
"""Points of one curve."""

MM = 1e3


def jerk_charts(found: JerkComparison) -> list[Chart]:
    """Draw the speed of both profiles: the whole way, and its two ends magnified."""
    last, window = max(found.envelope.seconds, found.smooth.seconds), magnified(found)
    parts = (("jerk-whole", 0.0, last), ("jerk-begin", 0.0, window), ("jerk-end", last - window, last))
    top = round(1.15 * found.speed * MM, 3)
    charts: list[Chart] = []
    for name, begin, end in parts:
        t = np.linspace(begin, end, POINTS)
        curves = [
            Curve(label="jerk limited", colour="left", width=2, dash=(6, 4), y=speed_at(found.smooth, t) * MM),
            Curve(label="envelope", colour="speed", width=2, y=speed_at(found.envelope, t, step=True) * MM),
        ]
        panel = Panel(name=name, label="speed [mm/s]", height=200, zero=True, span=(0.0, top), curves=curves)
        whole = name == "jerk-whole"
        unit, scale = ("s", 1.0) if whole else ("ms", 1e3)
        charts.append(line_chart(panel, t * scale, f"time since the start signal [{unit}]"))
    return charts


def magnified(found: JerkComparison) -> float:
    """Time at both ends of the way in which the profiles differ [s]."""
    half = 0.5 * max(found.envelope.seconds, found.smooth.seconds)
    risen = [
        float(profile.t[int(np.argmax(profile.speed >= 0.999 * profile.speed.max()))])
        for profile in (found.envelope, found.smooth)
    ]
    return min(1.3 * max(risen), half)


def speed_at(profile: Profile, t: Numbers, *, step: bool = False) -> Numbers:
    """Speed of a profile at any moments [m/s], shape (n,); NaN after its end."""
    if step:
        rows = (np.searchsorted(profile.t, t, side="right") - 1).clip(0)
        speed: Numbers = profile.speed[rows]
    else:
        speed = np.interp(t, profile.t, profile.speed)
    # One point more than the profile has: a curve that ends at rest.
    after = np.searchsorted(t, profile.seconds) + 1
    return np.where(np.arange(len(t)) < after, speed, np.nan)
