"""Axes at standstill: the cascade example with its gains by hand, and what the tune specification calls rigid."""

import random
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


def drawn(number: int) -> Axis:
    """One of the axes that are drawn at random: rigid, coupled or with a gap, with any friction, gains and encoder."""
    chance = random.Random(number)
    shape = ("rigid", "coupled", "gap")[number % 3]
    coulomb, load, ratio = chance.uniform(0, 40), chance.uniform(0, 40), chance.uniform(1, 2)
    speed = chance.choice([0.0, chance.uniform(0, 5)])
    loop, count = chance.uniform(15, 70), chance.choice([0.0, 10 ** chance.uniform(-1.3, 0.7)])
    integral = chance.choice([0.0, 10 ** chance.uniform(-0.3, 1.48), 10 ** chance.uniform(-0.3, 1.48)])
    on_load = shape != "rigid" and chance.random() < 0.5
    values = [
        *both(coulomb=f"{coulomb:.4g} N", static=f"{ratio * coulomb:.4g} N", stribeck=f"{speed:.4g} mm/s"),
        f"encoder.resolution={count:.4g} um", f"drive.delay={chance.randrange(3)}", "drive.command_step=0 V",
        f"method.velocity_integral={integral:.4g} kV/m", f"method.position_gain={10 ** chance.uniform(1, 2):.4g}",
        f"method.velocity_gain={100 * loop / 45:.4g} V*s/m",
    ]  # fmt: skip
    if shape == "rigid":
        return axis(RIGID, values)
    values += both(
        "load_friction", coulomb=f"{load:.4g} N", static=f"{ratio * load:.4g} N", stribeck=f"{speed:.4g} mm/s"
    )
    if shape == "gap":
        values.append(f"mechanics.coupling.backlash={10 ** chance.uniform(0.7, 2):.4g} um")
    if on_load:
        values += ["method.feedback.position=load", f"load_encoder.resolution={count:.4g} um"]
    return axis(TEXT, values)
