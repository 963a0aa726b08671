"""Draw every figure of the explanation anew, and replace those in docs/_static/figures that look different now.

`make figures` calls it. The figures are committed, so that the pages can be read where they lie, without building them.
Two machines need not draw the same bytes: a figure is replaced where what is seen has changed, and only there.
"""

import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import figures
import figures_cascade
import figures_course
import figures_house
import figures_live
import figures_rotary
import figures_servos
import figures_steppers
import numpy as np
from PIL import Image

MODULES = (
    figures, figures_servos, figures_rotary, figures_steppers, figures_cascade, figures_course, figures_house,
    figures_live,
)  # fmt: skip
DOCS = Path(__file__).resolve().parent
KEPT = DOCS / "_static" / "figures"
WIDTH = 1100  # of a kept figure [pixel]: a page shows it at two thirds of that
COLOURS = 32
CELL = 8  # pixels along a square whose mean brightness is compared: the edge of a letter may move within it
TOLERANCE = 12  # brightness by which a square may differ, of 255


def reduced(picture: Path) -> Image.Image:
    """The picture as wide as the pages need it, in few colours."""
    with Image.open(picture) as opened:
        full = opened.convert("RGB")
    small = full.resize((WIDTH, round(full.height * WIDTH / full.width)), Image.Resampling.LANCZOS)
    return small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


def squares(picture: Image.Image) -> np.ndarray:
    """Mean brightness of every square of the picture."""
    grey = np.asarray(picture.convert("L"), float)
    rows, columns = (size // CELL for size in grey.shape)
    return grey[: rows * CELL, : columns * CELL].reshape(rows, CELL, columns, CELL).mean((1, 3))


def look_alike(one: Image.Image, other: Image.Image) -> bool:
    """True for pictures of one size whose squares are as bright."""
    return one.size == other.size and bool(np.abs(squares(one) - squares(other)).max() <= TOLERANCE)


def keep(drawn: Iterable[Path], folder: Path) -> list[Path]:
    """Bring what was drawn into the folder where it looks different, remove what is drawn no more; what has changed."""
    pictures = {folder / picture.name: reduced(picture) for picture in drawn}
    changed = [kept for kept, picture in pictures.items() if not _is_kept(kept, picture)]
    for kept in changed:
        pictures[kept].save(kept, optimize=True)
    gone = sorted({*folder.glob("*.png")} - pictures.keys())
    for kept in gone:
        kept.unlink()
    return changed + gone


def _is_kept(kept: Path, picture: Image.Image) -> bool:
    """True where the kept figure looks like this one."""
    if not kept.exists():
        return False
    with Image.open(kept) as former:
        return look_alike(former, picture)


def draw_all() -> list[Path]:
    """Draw, and keep what looks different; a table that takes the place of a picture lies beside its page."""
    drawn = figures.FOLDER
    changed: list[Path] = []
    shutil.rmtree(drawn, ignore_errors=True)
    drawn.mkdir(parents=True)
    KEPT.mkdir(exist_ok=True)
    for module in MODULES:
        for draw in module.FIGURES:
            draw()
        for made in vars(module).values():
            if hasattr(made, "cache_clear"):
                made.cache_clear()
    for table in sorted(drawn.glob("*.md")):
        page, text = DOCS / "explanation" / table.name, table.read_text(encoding="utf-8")
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
            changed.append(page)
    return changed + keep(sorted(drawn.glob("*.png")), KEPT)


if __name__ == "__main__":
    sys.stdout.writelines(f"{path.relative_to(DOCS)}\n" for path in draw_all())
