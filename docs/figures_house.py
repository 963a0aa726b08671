"""The drawing of the house: its rooms as the import contract orders them, sized by their lines; and a step in C."""

import math
import tomllib
from pathlib import Path
from typing import Any

import figures
from figures import BLUE, GREEN, GREY, ORANGE

import detent
from detent.export.unit import unit_of
from detent.methods.cascade.build import build_cascade

PACKAGE = Path(detent.__file__).parent
ROOT = Path(__file__).resolve().parent.parent
METHODS = "detent.methods"
BLOCKS = {"control", "planning", "drive", "sensing", "plant", "analysis"}
FRAMES = {"page", "record", "files", "axisfile", "logs"}


def contract(name_of: str) -> list[list[str]]:
    """Layers of a contract of pyproject.toml, from the roof down; each may hold several rooms side by side."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(c["layers"] for c in tool["contracts"] if c.get("containers") == [name_of])
    return [[room.strip() for room in layer.split("|")] for layer in layers]


def lines_in(place: Path) -> int:
    """Lines of Python in a room, a file or a folder."""
    files = place.rglob("*.py") if place.is_dir() else [place.with_suffix(".py")]
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def colour_of(room: str) -> str:
    """Methods, blocks, frames, and what stands above and below them."""
    if room == "methods" or room in {entry for layer in contract(METHODS) for entry in layer}:
        return ORANGE
    return BLUE if room in BLOCKS else GREEN if room in FRAMES else GREY


def draw_floor(axes: Any, y: float, rooms: list[tuple[str, int]]) -> None:
    """Rooms of a floor side by side, the wider the more lines they have, but never too narrow for their name.

    Lines count in powers of two: the drawing does not change with every line.
    """
    widths = [max(2 ** (round(math.log2(lines)) / 2), 17.0) for _, lines in rooms]
    scale = 100.0 / max(sum(widths), 100.0)
    x = (100.0 - scale * sum(widths)) / 2
    for (room, _), width in zip(rooms, widths, strict=True):
        axes.barh(y, scale * width - 0.6, left=x + 0.3, height=0.84, color=colour_of(room), alpha=0.85)
        axes.text(x + scale * width / 2, y, room, ha="center", va="center", color="white", fontsize=7.5)
        x += scale * width


def house() -> None:
    """Every room on its floor; the methods' floor opened to show a package each."""
    floors: list[list[tuple[str, int]]] = []
    for layer in contract("detent"):
        if layer == ["methods"]:
            folder = PACKAGE / "methods"
            inside = contract(METHODS)
            floors.append([(room, lines_in(folder / room)) for room in inside[0]])
            floors.append([(room, lines_in(folder / room)) for entry in inside[1:] for room in entry])
        else:
            floors.append([(room, lines_in(PACKAGE / room)) for room in layer])
    with figures.picture("house.png", 1, 0.52 * len(floors) + 0.3) as (axes,):
        for number, rooms in enumerate(floors):
            draw_floor(axes, float(-number), rooms)
        axes.set_xlim(0, 100)
        axes.set_ylim(-len(floors) + 0.4, 0.6)
        axes.axis("off")


def shown_step() -> tuple[list[str], list[str]]:
    """A step of the cascade axis and the function in C that an export makes of it, signature and names as they are."""
    axis = detent.load(detent.example("cascade.toml"))
    unit = unit_of(axis, "slide")
    program = unit.translated(build_cascade(axis.spec).controller)
    (found,) = (f for f in program.order if f.py.__name__ == "limit_command")
    head, brace, body = program.texts[found.py].partition("\n{\n")
    signature = head.splitlines()[-1].replace(", double rest", ",\n        double rest")
    text = "\n".join([*head.splitlines()[:-1], signature]) + brace + body
    python = ["@step", *found.source.splitlines()[found.tree.lineno - 1 :]]
    return python, text.replace(" *\n", "").splitlines()


def firmware() -> None:
    """A step above the function in C that is made of it."""
    python, c = shown_step()
    size = 8.8 * min(1.0, 108 / max(map(len, python + c)))  # the longest line fits
    with figures.picture("firmware.png", 1, 0.19 * (len(python) + len(c)) + 0.5) as (axes,):
        y = 0.0
        for lines, colour in ((python, BLUE), (c, ORANGE)):
            axes.barh(y + 0.5 - len(lines) / 2, 0.006, left=-0.012, height=len(lines), color=colour)
            for line in lines:
                y -= 1.0
                axes.text(0.0, y + 0.5, line, family="monospace", fontsize=size, va="center", parse_math=False)
            y -= 1.0
        axes.set_xlim(-0.02, 1.0)
        axes.set_ylim(y + 0.5, 0.5)
        axes.axis("off")


FIGURES = (house, firmware)
