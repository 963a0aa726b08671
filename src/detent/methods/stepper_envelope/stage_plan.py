"""Tiles of a job as a drawing from above: which order, how long each took, and where the stage stood."""

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from statistics import median

from detent.methods.stepper_envelope.page_data import Tile, TilePlan
from detent.methods.stepper_envelope.summary import stated
from detent.page.words import GAP, count, duration, number

WIDTH, HEIGHT = 1000.0, 560.0
"""Most room that the drawing takes, in its own units."""

MARGIN = 46.0
"""Room around the tiles, for their halves and the scales."""

MOST_TILES = 2000
"""Tiles that are drawn: more are smaller than a dot."""

LABELLED = 22.0
"""Side of a tile from which on its name is written inside."""

LOOK = "display:block;width:100%;min-width:560px;height:auto;max-height:600px;font:12px system-ui,sans-serif"
"""Style of the whole drawing."""

LONG = 2.0
"""A tile has its full colour when its way took so many times the median."""

PALEST = 0.12
"""Share of the colour that a tile of the median has at least."""

NICE = (1.0, 2.0, 5.0)

SAME = 1e-7
"""Places that are nearer than this to one another are in one row or column [m]."""

LONE = 1e-3
"""Side of a tile that stands alone [m]."""


def plan_drawing(plan: TilePlan) -> str:
    """Draw the tiles and the path of the stage, to scale."""
    tiles = plan.tiles[:MOST_TILES]
    view = _View(tiles)
    usual = median(tile.seconds for tile in tiles) or 1.0
    squares = "".join(_square(tile, view, usual) for tile in tiles)
    title = f"Plan of {count(len(tiles), 'tile')} in their order"
    return (
        f'<div class="scroll" tabindex="0"><svg viewBox="0 0 {view.width:.0f} {view.height:.0f}" role="img" '
        f'aria-label="{title}" style="{LOOK}">{_scales(plan, view)}{squares}{_path(plan, tiles, view)}</svg></div>'
    )


def plan_legend(plan: TilePlan) -> str:
    """Say what the colours of the drawing mean."""
    usual = median(tile.seconds for tile in plan.tiles[:MOST_TILES]) or 1.0
    swatches = (
        (_look(usual, usual), f"{_short(usual)}, the median, or less"),
        (_look(LONG * usual, usual), f"{_short(LONG * usual)} or more"),
    )
    items = "".join(f'<span class="nowrap">{_swatch(look)} {text}</span>' for look, text in swatches)
    if any(tile.off for tile in plan.tiles):
        items += f'<span class="nowrap">{_swatch("fill:var(--bad)")} a rotor stood beside its place</span>'
    return f'<div class="controls">Time of the way to a tile: {items}</div>'


def _swatch(look: str) -> str:
    return (
        '<svg width="14" height="14" style="vertical-align:-2px"><rect x="1" y="1" width="12" height="12" '
        f'style="{look};stroke:var(--speed)"/></svg>'
    )


def _short(seconds: float) -> str:
    return f"{number(seconds * 1e3)}{GAP}ms" if seconds < 1 else duration(seconds)


class _View:
    """From metres to places in the drawing, the same scale both ways."""

    def __init__(self, tiles: Sequence[Tile]) -> None:
        xs, ys = ([tile.target[axis] for tile in tiles] for axis in (0, 1))
        across, up = _pitch(xs), _pitch(ys)
        # Tiles of a single row or column are squares.
        pitch = (across or up or LONE, up or across or LONE)
        spans = [max(places) - min(places) + one for places, one in zip((xs, ys), pitch, strict=True)]
        self.scale = min((WIDTH - 2 * MARGIN) / spans[0], (HEIGHT - 2 * MARGIN) / spans[1])
        self.width, self.height = WIDTH, spans[1] * self.scale + 2 * MARGIN
        self.sides = [max(0.86 * one * self.scale, 4.0) for one in pitch]
        self.middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)

    def at(self, place: tuple[float, float]) -> tuple[float, float]:
        """Place in the drawing; up is to larger positions."""
        x = self.width / 2 + (place[0] - self.middle[0]) * self.scale
        return x, self.height / 2 - (place[1] - self.middle[1]) * self.scale


def _pitch(places: Sequence[float]) -> float:
    """Usual distance of one place to the next that is not the same; 0 if there is none."""
    apart = [abs(b - a) for a, b in pairwise(places) if abs(b - a) > SAME]
    return median(apart) if apart else 0.0


def _look(seconds: float, usual: float) -> str:
    """Colour of a tile by its time."""
    share = min(max((seconds / usual - 1) / (LONG - 1), 0.0), 1.0)
    return f"fill:var(--speed);fill-opacity:{PALEST + (0.85 - PALEST) * share:.2f}"


def _square(tile: Tile, view: _View, usual: float) -> str:
    x, y = view.at(tile.target)
    width, height = view.sides
    left, top = x - width / 2, y - height / 2
    look = "fill:var(--bad);fill-opacity:.8" if tile.off else _look(tile.seconds, usual)
    told = f"tile {tile.label or tile.move}: {_short(tile.seconds)}, lag up to {number(tile.lag)} steps"
    text = ""
    if min(view.sides) >= LABELLED and tile.label:
        # Above the path, which goes through the middle.
        ink = "card" if tile.off or tile.seconds > (1 + LONG) / 2 * usual else "ink"
        text = f'<text x="{left + 4:.1f}" y="{top + 13:.1f}" style="fill:var(--{ink})">{escape(tile.label[:6])}</text>'
    return (
        f'<g><title>{escape(told)}</title><rect x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" '
        f'height="{height:.1f}" style="{look};stroke:var(--speed);stroke-width:.7"/>{text}</g>'
    )


def _path(plan: TilePlan, tiles: Sequence[Tile], view: _View) -> str:
    """The way of the stage, with a ring where the first tile is taken and a point at every stop."""
    stops = [view.at(tile.place) for tile in tiles]
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in (view.at(plan.start), *stops))
    radius = min(max(min(view.sides) / 14, 1.5), 4.0)
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"/>' for x, y in stops)
    (x, y), ring = stops[0], 2.2 * radius
    return (
        f'<polyline points="{places}" style="fill:none;stroke:var(--left);stroke-width:{max(radius / 2, 1):.1f};'
        f'stroke-linejoin:round"/><g style="fill:var(--left)">{dots}</g>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{ring:.1f}" style="fill:none;stroke:var(--left);stroke-width:2"/>'
    )


def _scales(plan: TilePlan, view: _View) -> str:
    """A bar for the scale, and the names of the motors along the edges."""
    length = _nice(0.2 * view.width / view.scale)
    x, y, bar = view.width - 12.0, view.height - 12.0, length * view.scale
    across, up = (escape(name) for name in plan.motors)
    return (
        f'<g style="stroke:var(--soft);stroke-width:2"><path d="M{x - bar:.1f} {y:.1f}H{x:.1f}"/></g>'
        f'<g style="fill:var(--soft)"><text x="{x - bar / 2:.1f}" y="{y - 6:.1f}" text-anchor="middle">'
        f"{stated(length * 1e3)} mm</text>"
        f'<text x="12" y="{y:.1f}">{across} \u2192</text><text x="12" y="16">\u2191 {up}</text></g>'
    )


def _nice(wanted: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not larger than what is wanted."""
    power = 1e-9
    best = power
    while power <= wanted:
        best = max([best, *(step * power for step in NICE if step * power <= wanted)])
        power *= 10
    return best
