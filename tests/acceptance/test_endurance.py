"""Long runs: clocks and counts across the bounds of 32 bits and of doubles, rest, energy over ten million ticks.

Whatever an axis does, it does bit for bit the same when all clocks and counts begin elsewhere.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests import energy
from tests.cascade_rig import TICK as CASCADE_TICK
from tests.cascade_rig import Rig as CascadeRig
from tests.cascade_rig import make_params
from tests.endurance import (
    CLOCKS,
    COUNTS,
    DAY,
    PAGE,
    Clocks,
    before,
    boundaries,
    first_difference,
    move,
    page,
    stood,
)
from tests.rotary_table_rig import RATIO, T
from tests.rotary_table_rig import Rig as TableRig

from detent.methods.cascade.system import set_count
from detent.planning.profile import MotionLimits, plan_move

pytestmark = pytest.mark.compiled

wide = pytest.mark.wide
QUICK = ("print head", "filtered servo", "rotary table", "cascade")
"""Methods of which a day is simulated within minutes; the others have ticks of 250 ns and 2 us."""


# ---- clocks and counts


@wide
@pytest.mark.parametrize("name", CLOCKS)
def test_across_every_boundary_of_time_not_a_bit_is_other(name: str) -> None:
    for boundary, tick in boundaries(CLOCKS[name]).items():
        assert first_difference(CLOCKS[name], ticks=before(tick)) == {}, boundary


@wide
@pytest.mark.parametrize("name", CLOCKS)
def test_across_every_boundary_of_counts_not_a_bit_is_other(name: str) -> None:
    for boundary, counts in COUNTS.items():
        assert first_difference(CLOCKS[name], counts=counts) == {}, boundary
        assert first_difference(CLOCKS[name], counts=-counts) == {}, f"-{boundary}"


@wide
@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("print head", "controller.head.now_us"),
        ("phase servo", "controller.clocks.divider"),
        ("filtered servo", "plant.interference.next_random"),
        ("rotary table", "controller.tick"),
        ("stepper envelope", "controller.timer.expires"),
    ],
)
def test_a_clock_that_is_left_behind_is_seen(name: str, left: str) -> None:
    clocks = CLOCKS[name]
    others = replace(clocks, times={path: units for path, units in clocks.times.items() if path != left})
    assert first_difference(others, ticks=before(2**31)) != {}


TURNED = {
    "controller.positioner.angle.turn": 1, "controller.positioner.angle.aar": T, "controller.positioner.oar": T,
    "controller.positioner.angle.position": T, "controller.watched": T, "plant.train.motor.turns": RATIO,
}  # fmt: skip


@cache
def jogged(turns: int) -> tuple[list[int], float]:
    """Extended angle at each of 30 looks, position of record at 10 more, and the speed at the end.

    A jog that has so many turns behind it; once it has come to rest the extended angle is one within a turn again.
    """
    rig = TableRig()
    rig.press(1, 120.0).run_until(1.0)
    move({"": rig.r}, TURNED, turns)
    seen: list[int] = []
    for look in range(40):
        if look == 30:
            rig.release()
        rig.run_until(1.0 + 0.2 * (look + 1))
        seen.append(rig.angle.aar if look < 30 else rig.angle.position)
    return seen, rig.speed


@wide
@pytest.mark.parametrize("bits", [31, 32, 48])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_angle_of_a_table_beyond_32_bits(bits: int, sign: int) -> None:
    turns = sign * ((1 << bits) // T + (sign < 0))
    near, far = jogged(0), jogged(turns)
    assert [one - turns * T for one in far[0]] == near[0]
    assert far[1] == near[1]
    assert min(map(abs, far[0])) < 1 << bits < max(map(abs, far[0]))


@wide
@pytest.mark.parametrize("bits", [31, 32])
def test_an_encoder_of_the_cascade_beyond_32_bits(bits: int) -> None:
    """The plant's place is a double: 2^-20 m a count leave it 2^-22 m of resolution, 2 km away."""
    count, paths = 2.0**-20, []
    for start in (0.0, 2.0**bits * count):
        p = make_params()
        set_count(p, count, count)
        rig = CascadeRig(p, start - 0.01)
        limits = MotionLimits(speed=0.2, acceleration=2.0, jerk=math.inf)
        profile = plan_move(start - 0.01, start + 0.02, limits, 20 * CASCADE_TICK)
        seen = rig.record(20_000, ["lines.motor.count"], every=20, profile=profile)
        paths.append(seen["lines.motor.count"] - round(start / count))
    assert np.abs(paths[1] - paths[0]).max() <= 1
    assert paths[0][0] < 0 < paths[0][-1]


# ---- rest


@wide
@pytest.mark.parametrize("name", CLOCKS)
def test_a_rest_leaves_everything_where_it_is(name: str) -> None:
    check_rest(CLOCKS[name], 60.0 if name in QUICK else 1.0)


@pytest.mark.long
@pytest.mark.parametrize("name", QUICK)
def test_a_day_of_rest_too(name: str) -> None:
    check_rest(CLOCKS[name], DAY)


def check_rest(clocks: Clocks, seconds: float) -> None:
    """After a rest the axis stands where it stood, and its next motion ends where it ends without the rest."""
    before_it, after_it, end = stood(clocks, seconds)
    assert after_it == pytest.approx(before_it, abs=clocks.dither)
    assert end == pytest.approx(stood(clocks, 0.0)[2], abs=clocks.dither)
    assert min(abs(one - other) for one, other in zip(before_it, end, strict=True)) > 5


# ---- energy


@cache
def driven() -> dict[str, float]:
    return energy.driven()


@cache
def alone() -> dict[str, energy.Alone]:
    return energy.alone()


@wide
@pytest.mark.parametrize(
    # What the carriage misses goes where it turns round: it stands for the rest of that tick.
    ("plant", "most"),
    [("carriage", 2e-7), ("motor and load", 2e-9), ("motor of a table", 5e-10)],
)
def test_energy_put_in_is_lost_or_held(plant: str, most: float) -> None:
    assert abs(driven()[plant]) < most


@wide
@pytest.mark.parametrize("plant", energy.PLANTS)
def test_a_plant_left_alone_never_gains_energy(plant: str) -> None:
    first, most, last = alone()[plant]
    assert 0 <= last <= most <= first * (1 + 1e-13)
    if "lossless" not in plant:
        assert last < 0.5 * first


@wide
@pytest.mark.parametrize(
    ("plant", "share"),
    [
        # It stands for the rest of the tick in which it turns round: 4e-6 of its energy each time.
        ("carriage", 0.1),
        ("motor and load", 1e-6),
        ("motor and load, with backlash", 1e-6),
        ("motor of a table", 0.0),
        ("rotor of a stepper", 1e-3),
    ],
)
def test_without_losses_energy_stays(plant: str, share: float) -> None:
    name, _, more = plant.partition(", ")
    first, _, last = alone()[f"{name}, lossless{', ' * bool(more)}{more}"]
    assert first * (1 - share) <= last <= first * (1 + 1e-13)


# ---- what is told of it


@wide
def test_the_page_holds_these_figures() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()
