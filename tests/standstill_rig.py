"""Axes at standstill: the packaged cascade example with gains by hand, and the rigid one of the tune specification."""

from collections.abc import Sequence
from typing import Any

from detent.axis import Axis
from detent.files.source import parse_source
from detent.methods.load import axis_of
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.cascade_rig import by_hand

TEXT = by_hand((EXAMPLES / "cascade.toml").read_text(encoding="utf-8"))
COUPLING = TEXT.index("[mechanics.coupling]"), TEXT.index("[mechanics.friction.positive]")
RIGID = (TEXT[: COUPLING[0]] + TEXT[COUPLING[1] :]).replace('coulomb = "8 N"', 'coulomb = "0 N"')


def both(table: str = "friction", **values: str) -> list[str]:
    """Overrides of friction in both directions."""
    return [
        f"mechanics.{table}.{way}.{key}={value}" for way in ("positive", "negative") for key, value in values.items()
    ]


def axis(text: str, overrides: Sequence[str]) -> Axis:
    return Axis(axis_of(parse_source("axis.toml", text), overrides))


def rigid(static: float, count: float, *more: str, stribeck: float = 0.0, integral: float = 5.0) -> Axis:
    """The example as one mass with 20 N of Coulomb friction: forces [N], count [um], speed [mm/s], integral [kV/m]."""
    friction = both(coulomb="20 N", static=f"{static} N", stribeck=f"{stribeck} mm/s")
    usual = ["drive.command_step=0 V", f"encoder.resolution={count} um", f"method.velocity_integral={integral} kV/m"]
    return axis(RIGID, [*friction, *usual, *more])


def example(*overrides: str) -> Axis:
    """The packaged example with changes."""
    return axis(TEXT, overrides)


def told(found: Any) -> str:
    """A line to be read where a test fails."""
    kinds = [(one.name, len(one.found), one.swing("motor"), one.swing("load"), one.period) for one in found.kinds]
    return f"{dict(found.shares)} {kinds}"
