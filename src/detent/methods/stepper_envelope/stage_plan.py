"""Tiles of a job as a drawing from above: which order, how long each took, and where the stage stood."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from detent.methods.stepper_envelope.run import StageMoveRecord
from detent.methods.stepper_envelope.summary import StageFigures, stated, time_text
from detent.page.figure import Figure
from detent.page.units import Scale
from detent.page.words import GAP, count, further, number

WIDTH, HEIGHT = 1000.0, 560.0  # most room that the drawing takes, in its own units
MARGIN = 46.0  # room around the tiles, for their halves and the scales
MOST_TILES = 2000  # tiles that are drawn: more are smaller than a dot
LABELLED = 22.0  # side of a tile from which on its name is written inside
LONG = 2.0  # a tile has its full colour when its way took so many times the median
PALEST = 0.12  # share of the colour that a tile of the median has at least
SAME = 1e-7  # places that are nearer than this to one another are in one row or column [m]
LONE = 1e-3  # side of a tile that stands alone [m]
Place = tuple[float, float]  # to the right, and up in the picture [m]


@dataclass(frozen=True, slots=True)
class Tile:
    """One tile, and how the stage came there."""

    move: StageMoveRecord
    target: Place  # where the stage had to go
    place: Place  # and where its rotors stood in the end
    off: bool  # a rotor stood steps beside its place


class TilePlan:
    """The tiles as one sees them from above, in the units of the drawing: up is to larger positions."""

    def __init__(self, motors: tuple[str, str], start: Place, tiles: Sequence[Tile], unit: Scale) -> None:
        self.motors = motors  # what moves the stage to the right, and what moves it up in the picture
        self.start, self.tiles = start, tiles  # where the stage stood first; in the order of the visits, at least one
        self.unit = unit  # of places
        drawn = tiles[:MOST_TILES]
        self.usual = median(tile.move.seconds for tile in drawn) or 1.0  # time of the way to a tile [s]
        xs, ys = ([tile.target[axis] for tile in drawn] for axis in (0, 1))
        across, up = _pitch(xs), _pitch(ys)
        # Tiles of a single row or column are squares.
        pitch = (across or up or LONE, up or across or LONE)
        spans = [max(places) - min(places) + one for places, one in zip((xs, ys), pitch, strict=True)]
        # The same scale both ways.
        self.scale = min((WIDTH - 2 * MARGIN) / spans[0], (HEIGHT - 2 * MARGIN) / spans[1])
        self.width, self.height = WIDTH, spans[1] * self.scale + 2 * MARGIN
        self.sides = [max(0.86 * one * self.scale, 4.0) for one in pitch]
        self.middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        self.squares = [self._square(tile) for tile in drawn]
        self.about = f"Plan of {count(len(drawn), 'tile')} in their order"
        self.way = [self._at(place) for place in (start, *(tile.place for tile in drawn))]
        self.radius = min(max(min(self.sides) / 14, 1.5), 4.0)  # of the points at the stops
        # The bar of the scale: the largest of 1, 2 and 5 times a power of ten in a fifth of the width, in that unit.
        wanted = 0.2 * WIDTH / self.scale * unit.factor
        power = 10.0 ** math.floor(math.log10(wanted))
        length = max((step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted), default=power)
        self.bar, self.length = length / unit.factor * self.scale, f"{stated(length)} {unit.name}"
        self.swatches = {
            f"{time_text(self.usual)}, the median, or less": self._look(self.usual),
            f"{time_text(LONG * self.usual)} or more": self._look(LONG * self.usual),
        }
        if any(tile.off for tile in tiles):
            self.swatches["a rotor stood beside its place"] = "fill:var(--bad)"

    def _look(self, seconds: float) -> str:
        """Colour of a tile by its time."""
        share = min(max((seconds / self.usual - 1) / (LONG - 1), 0.0), 1.0)
        return f"fill:var(--speed);fill-opacity:{PALEST + (0.85 - PALEST) * share:.2f}"

    def _at(self, place: Place) -> Place:
        x = self.width / 2 + (place[0] - self.middle[0]) * self.scale
        return x, self.height / 2 - (place[1] - self.middle[1]) * self.scale

    def _square(self, tile: Tile) -> dict[str, Any]:
        (x, y), (width, height), move = self._at(tile.target), self.sides, tile.move
        lag = max((motor.peak_lag for motor in move.motors.values()), default=0.0)
        return {
            "title": f"tile {move.label or move.number}: {time_text(move.seconds)}, lag up to {number(lag)} steps",
            "left": x - width / 2,
            "top": y - height / 2,
            "look": "fill:var(--bad);fill-opacity:.8" if tile.off else self._look(move.seconds),
            # Above the path, which goes through the middle.
            "label": move.label[:6] if min(self.sides) >= LABELLED else "",
            "ink": "card" if tile.off or move.seconds > (1 + LONG) / 2 * self.usual else "ink",
        }

    def drawn(self, macro: str) -> Markup:
        """Its `drawing`, to scale, or the `legend` of its colours."""
        environment = Environment(loader=PackageLoader("detent.methods.stepper_envelope", ""), autoescape=True)
        module: Any = environment.get_template("stage_plan.html.j2").module
        return Markup(getattr(module, macro)(self))  # noqa: S704 - the template escapes


def _pitch(places: Sequence[float]) -> float:
    """Usual distance of one place to the next that is not the same; 0 if there is none."""
    apart = [abs(b - a) for a, b in pairwise(places) if abs(b - a) > SAME]
    return median(apart) if apart else 0.0


def plan_figure(figures: StageFigures) -> Figure | None:
    """The tiles of a list that names two motors."""
    plan = tile_plan(figures)
    if plan is None:
        return None
    caption = (
        "Every square is a tile, where it was asked for, with its name; the line goes through the places where the "
        "rotors stood, in the order of the visits, and the ring is the first. Both axes move together: a tile is done "
        "when both are settled. The squares are as large as the tiles are apart, not as the camera sees. The stage "
        f"came from {plan.motors[0]} {stated(plan.start[0] * plan.unit.factor)}, {plan.motors[1]} "
        f"{stated(plan.start[1] * plan.unit.factor)}{GAP}{plan.unit.name}."
    )
    left_out = len(plan.tiles) - MOST_TILES
    if left_out > 0:
        caption += f" {further(left_out, 'tile')} not drawn."
    return Figure(title="The tiles from above", caption=caption, drawing=plan.drawn("legend") + plan.drawn("drawing"))


def tile_plan(figures: StageFigures) -> TilePlan | None:
    """Tiles of a list that names two motors of one motion; the first of the file goes to the right, the second up."""
    spec, run = figures.spec, figures.run
    motors = [name for name in spec.stepper if name in run.job.motors]
    if run.job.kind != "tiles" or len(motors) != 2 or not run.moves:
        return None
    across, up = motors
    if figures.units(across) != figures.units(up):  # one slides, the other turns: no drawing has one scale for both
        return None
    start = {name: spec.stepper[name].mechanics.start_position for name in motors}
    target, off = dict(start), dict.fromkeys(motors, 0)
    tiles: list[Tile] = []
    for move, motions in zip(run.moves, figures.by_move, strict=True):
        for motion in motions:
            target[motion.name], off[motion.name] = motion.motor.target, motion.off
        place = {name: target[name] - off[name] * spec.stepper[name].step for name in motors}
        tiles.append(Tile(move, (target[across], target[up]), (place[across], place[up]), any(off.values())))
    return TilePlan((across, up), (start[across], start[up]), tiles, figures.units(up).place)
