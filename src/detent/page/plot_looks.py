"""Looks of pictures that matplotlib draws."""

from typing import Any

from detent.page.plots import COLOURS

BLUE, ORANGE, GREEN, PINK = COLOURS[:4]
GREY = "#7d8996"
INK = "#17202a"

POINTS = 6000
"""Points of one curve: more than a printed page resolves."""

ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2, "fontsize": 9}
"""Place of a legend: above the curves, never over them."""
