"""Live specification, section 8, tests 14 and 15: the stop of the motion generator, and how well its tests know it."""

import inspect
import json
import os
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import pytest
from tests.course_rig import at_rest, excursions, follow, limits, shortest_stop, stop_from_level, turns
from tests.mutants import load, mutants, source_of
from tests.places import ROOT
from tests.unit.planning import test_course

from detent.planning import course, speed_ramp

STOPS = 20_000
SHARE = 0.9  # of the mutants, that the module's own tests must kill
EVERY = 60  # mutants of which the ordinary tests take one


# ---- 14: stop from anywhere


def bound(v: float, a: float, most: float, jerk: float, latency: float) -> float:
    """What a stop may take: v^2 / 2 a + v a / 2 j + v T.

    While the axis still speeds up, the speed that counts is that which it reaches while the acceleration is taken away,
    v + a^2 / 2 j, and the time that this takes, a / j, is time that passes before it slows down: latency as well.
    """
    if a * v > 0.0:
        v, latency = v + a * abs(a) / (2 * jerk), latency + abs(a) / jerk
    return v * v / (2 * most) + abs(v) * most / (2 * jerk) + abs(v) * latency


def under_way(rng: random.Random) -> tuple[Any, Any]:
    """A course in any phase of any move, jog, or change between them, mostly near its soft limits."""
    speed, most, jerk = 10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(0, 1.5), 10 ** rng.uniform(1, 4)
    way = stop_from_level(speed, most, jerk)
    p = limits(COMPILED, speed, most, jerk, lowest=-way * rng.uniform(0, 3), highest=way * rng.uniform(0, 3))
    c = at_rest(COMPILED, rng.uniform(p.lowest, p.highest))
    lasts = speed / most + most / jerk
    for _ in range(rng.randint(1, 3)):
        if rng.random() < 0.5:
            assert course.go_to(p, c, rng.uniform(p.lowest, p.highest)) == course.TAKEN
        else:
            assert course.run_at(p, c, rng.uniform(-speed, speed)) == course.TAKEN
        course.advance(p, c, min(rng.random() * lasts, 1.0))
    return p, c


COMPILED = SimpleNamespace(**{**vars(speed_ramp), **vars(course)})


@pytest.mark.parametrize("stops", [2000, pytest.param(STOPS, marks=pytest.mark.wide)])
def test_14_a_stop_is_short_without_reversal_inside_the_limits_and_continuous(stops):
    """The rig checks each sample: finite, |v|, |a|, |j| within their limits, no step of the command."""
    rng, phases = random.Random(14), Counter[str]()
    for _ in range(stops):
        p, c = under_way(rng)
        x, v, a = c.position, c.velocity, c.acceleration
        most, jerk, level = p.acceleration, p.jerk, course.level_speed(p.jerk, v, a)
        low, high = excursions(COMPILED, c)
        course.come_to_rest(p, c)
        assert c.end - x == pytest.approx(shortest_stop(v, a, most, jerk), rel=1e-9, abs=1e-12)
        period = rng.uniform(0.05, 0.3) * (p.speed / most + most / jerk)
        states = follow(COMPILED, p, c, min(period, 1.0))
        assert all(p.lowest <= one[0] <= p.highest for one in states)
        assert all(low - 1e-12 <= one[0] <= high + 1e-12 for one in states)
        if v * level >= 0.0:
            assert abs(c.position - x) <= bound(v, a, most, jerk, period) + 1e-12
            assert turns(states) == 0
        else:  # an acceleration against the speed, too large to be taken away before the speed is gone: one turn
            ahead, back = (high - x, high - c.position) if v > 0.0 else (x - low, c.position - low)
            assert ahead <= bound(v, 0.0, most, jerk, period) + 1e-12
            assert back <= bound(level, 0.0, most, jerk, abs(a) / jerk) + 1e-12
            assert turns(states) <= 1
        phases["at rest" if v == a == 0.0 else "turning" if v * level < 0.0 else "speeding up" if v * a > 0.0 else
               "slowing down" if v * a < 0.0 else "steady"] += 1  # fmt: skip
    assert min(phases[name] for name in ("turning", "speeding up", "slowing down", "steady")) > stops / 50, phases


def test_14_the_bound_of_the_specification_is_too_short_while_the_axis_speeds_up():
    """v^2 / 2 a + v a / 2 j + v T, to the letter: no stop within the jerk can be that short. In exact fractions.

    At v = 0.5 m/s and a = 5 m/s^2, with limits of 5 m/s^2 and 100 m/s^3: taking the acceleration away lasts 50 ms and
    carries the axis 29.2 mm; then it goes at 0.625 m/s, and needs 54.7 mm more.
    """
    v, a, most, jerk, latency = Fraction(1, 2), Fraction(5), Fraction(5), Fraction(100), Fraction(1, 1000)
    t = a / jerk
    carried = v * t + a * t**2 / 2 - jerk * t**3 / 6
    level = v + a**2 / (2 * jerk)
    rest = level**2 / (2 * most) + level * most / (2 * jerk)
    assert (carried, level, rest) == (Fraction(7, 240), Fraction(5, 8), Fraction(7, 128))
    to_the_letter = v**2 / (2 * most) + v * most / (2 * jerk) + v * latency
    assert float(carried + rest) == pytest.approx(0.0838542, rel=1e-6)
    assert float(to_the_letter) == 0.038
    # Not by the speed that counts alone, either; with the time that the acceleration takes, it is.
    assert carried + rest > rest + level * latency
    assert carried + rest <= rest + level * (latency + t)
    assert shortest_stop(0.5, 5.0, 5.0, 100.0) == pytest.approx(float(carried + rest), rel=1e-15)


# ---- 15: its own tests


def own_tests() -> list[Callable[[Any], None]]:
    """The quick tests of the two modules: those that ask for nothing but the modules."""
    found = [test for name, test in vars(test_course).items() if name.startswith("test_")]
    return [test for test in found if list(inspect.signature(test).parameters) == ["m"]]


COVERED = """
import sys
import coverage
measured = coverage.Coverage(data_file=None, config_file=False, branch=True, include=sys.argv[1:])
measured.start()
from tests.acceptance.test_live_course import COMPILED, own_tests
for test in own_tests():
    test(COMPILED)
measured.stop()
measured.json_report(outfile="-")
"""


def test_15_every_branch_is_taken_by_its_own_tests():
    files = [str(path) for path in test_course.SOURCES]
    done = subprocess.run(
        [sys.executable, "-c", COVERED, *files],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT)])},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout)["files"].values()
    assert [(one["missing_lines"], one["missing_branches"]) for one in found] == [([], [])] * len(files)
    assert sum(one["summary"]["num_branches"] for one in found) > 60


class Hunt:
    """Mutants one after another against the tests; the test that killed the last one goes first."""

    def __init__(self) -> None:
        self.tests, self.alive, self.count = own_tests(), list[str](), 0

    def kill(self, source: Any, what: str) -> None:
        """One mutant: it dies of whatever a test raises."""
        self.count += 1
        try:
            m = load(source)
        except Exception:  # noqa: BLE001 - so wrong that it cannot even be loaded
            return
        for test in list(self.tests):
            try:
                test(m)
            except Exception:  # noqa: BLE001 - the kinds of death are as many as the mutants
                self.tests.remove(test)
                self.tests.insert(0, test)
                return
        self.alive.append(what)


def hunted(every: int, first: int = 0) -> Hunt:
    """Every so manieth mutant."""
    source, hunt = source_of(*test_course.SOURCES), Hunt()
    for k, (what, mutant) in enumerate(mutants(source)):
        if k % every == first:
            hunt.kill(mutant, what)
    return hunt


def test_15_its_own_tests_kill_some_of_its_mutants():
    hunt = hunted(EVERY)
    assert hunt.count >= 10
    assert len(hunt.alive) <= 0.3 * hunt.count, hunt.alive  # of so few, many may happen to change nothing


@pytest.mark.wide
def test_15_its_own_tests_kill_its_mutants(record_property):
    hunt = hunted(1)
    record_property("mutants", [hunt.count, *hunt.alive])
    assert hunt.count > 500
    assert len(hunt.alive) <= (1 - SHARE) * hunt.count, "\n".join(hunt.alive)


def test_15_a_test_that_looks_at_nothing_kills_nothing(monkeypatch):
    """The hunt itself can fail."""
    monkeypatch.setattr(sys.modules[__name__], "own_tests", lambda: [lambda _: None])
    hunt = hunted(4 * EVERY)
    assert len(hunt.alive) > 0.5 * hunt.count
