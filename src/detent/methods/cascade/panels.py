"""Plot areas on the pages of a cascade axis: what was asked beside what was done, an error, the command."""

import numpy as np

from detent.methods.cascade.units import Scale, Units
from detent.page.chart import Curve, Panel
from detent.page.parts import Numbers

POINTS = 1500  # rows that are chosen for one curve's sake: plot areas stand above one another
WINDOW_SHARE = 0.02  # windows and limits narrower than this share of the curves would only blacken the line at zero

Named = tuple[str, Numbers]
"""Name of a curve, and its values in SI units."""


def pair_panel(name: str, label: str, scale: Scale, asked: Named, did: Named) -> Panel:
    """What was asked or measured, dashed over what the axis did."""
    curves = [
        Curve(label=did[0], colour="speed", width=2.5, y=did[1] * scale.factor, thin=POINTS),
        Curve(label=asked[0], colour="left", width=1.5, dash=(5, 4), y=asked[1] * scale.factor, thin=POINTS),
    ]
    return Panel(name=name, label=f"{label} [{scale.name}]", zero=True, curves=curves)


def error_panel(name: str, label: str, error: Named, units: Units, levels: tuple[tuple[float, str], ...] = ()) -> Panel:
    """An error [m or rad] in a unit that suits it, with levels on both sides that are of its size."""
    text, values = error
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    scale = units.small(peak)
    shown = [(value, word) for value, word in levels if WINDOW_SHARE * peak < value < 2 * peak]
    marks = [mark for value, word in shown for mark in both_sides(value * scale.factor, word)]
    curve = Curve(label=text, colour="current", y=values * scale.factor, width=1.5, thin=POINTS)
    return Panel(name=name, label=f"{label} [{scale.name}]", height=170, zero=True, curves=[curve], levels=marks)


def command_panel(name: str, command: Numbers, limit: float) -> Panel:
    """The command [V] with its limit, where it comes near it."""
    near = float(np.abs(command).max(initial=0.0)) > 0.5 * limit
    levels, span = (both_sides(limit, "limit"), (-1.5 * limit, 1.5 * limit)) if near else ([], None)
    curve = Curve(label="command", colour="drive", step=True, y=command, thin=POINTS)
    return Panel(name=name, label="command [V]", height=150, zero=True, curves=[curve], levels=levels, span=span)


def both_sides(value: float, word: str) -> list[tuple[float, str]]:
    """Levels at a magnitude, the upper one named."""
    return [(value, word), (-value, "")]
