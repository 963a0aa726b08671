"""The pictures of the first ten minutes at the panel: the story of that page, walked through in a real browser.

`make docs` calls it before it builds. A step of the story that does not go as the page tells it ends the build. A
picture is replaced where the page looks different; figures that change from one walk to the next are no difference.
Without the browser, or what drives it, the committed pictures stay.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from tests.live_browser import panelled, run_script  # noqa: E402 - from the root of the project

KEPT = DOCS / "how-to" / "panel"
CELL = 45  # pixels along a square whose mean colour is compared
TOLERANCE = 12  # by which that may differ in red, green or blue, of 255
COLOURS = 48
TIMES = 3  # that it is tried: a machine may be too busy for an axis in wall time


def squares(picture: Image.Image) -> np.ndarray:
    """Mean colour of every square of the picture, shape (rows, columns, 3)."""
    colours = np.asarray(picture.convert("RGB"), float)
    rows, columns = (size // CELL for size in colours.shape[:2])
    return colours[: rows * CELL, : columns * CELL].reshape(rows, CELL, columns, CELL, 3).mean((1, 3))


def keep(picture: Path, kept: Path) -> bool:
    """Bring a picture where it is kept, in few colours, if it looks different there; tells whether it does."""
    with Image.open(picture) as opened:
        new = opened.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    if kept.exists():
        with Image.open(kept) as old:
            if old.size == new.size and np.abs(squares(old) - squares(new)).max() <= TOLERANCE:
                return False
    new.save(kept, optimize=True)
    return True


TOLD = "the sensor did not move", "The position was lost", "What to do", "F02"


def differs(seen: dict[str, Any]) -> dict[str, Any]:
    """What came of it otherwise than the page tells."""
    right = {
        "problems": seen["problems"] == [],
        "stopped": seen["stopped"].startswith("Stopped over"),
        "job": abs(seen["job"] - 0.26) < 1e-6,
        "fault": all(told in seen["fault"] for told in TOLD),
        "reset": seen["reset"] == "switch on disabled",
        "trust": seen["trust"] == "unknown",
        "position": abs(seen["position"] - 0.06) < 1e-4,
    }
    return {name: seen[name] for name, is_right in right.items() if not is_right}


def walk(folder: Path) -> dict[str, Any]:
    """The story, with its pictures into a folder; gives what differs from it."""
    with panelled(folder, "cascade.toml", "--period", "10 ms") as live:
        return differs(run_script("tour", live.link(), str(folder)))


def main() -> int:
    """Walk, and keep what looks different."""
    wrong: object = None
    for _ in range(TIMES):
        with tempfile.TemporaryDirectory() as name:
            try:
                wrong = walk(Path(name))
            except pytest.skip.Exception as missing:
                sys.stdout.write(f"The pictures of the panel stay as they are: {missing}\n")
                return 0
            except AssertionError as error:
                wrong = error
            if not wrong:
                drawn = sorted(Path(name).glob("panel-*.png"))
                changed = [one.name for one in drawn if keep(one, KEPT / one.name)]
                for gone in {one.name for one in KEPT.glob("*.png")} - {one.name for one in drawn}:
                    (KEPT / gone).unlink()
                sys.stdout.write(f"Pictures of the panel that look different: {', '.join(changed) or 'none'}\n")
                return 0
    sys.stderr.write(f"the story of first-ten-minutes-at-the-panel.md does not go as it tells: {wrong}\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
