"""Rigs of live tests 14 and 15: what a stop may take, courses under way, and the hunt for mutants."""

import inspect
import random
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from detent.planning import course, speed_ramp
from tests.course_rig import at_rest, limits, stop_from_level
from tests.mutants import load, mutants, source_of
from tests.unit.planning import test_course


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


def own_tests() -> list[Callable[[Any], None]]:
    """The quick tests of the two modules: those that ask for nothing but the modules."""
    found = [test for name, test in vars(test_course).items() if name.startswith("test_")]
    return [test for test in found if list(inspect.signature(test).parameters) == ["m"]]


COVERED = """
import sys
import coverage
measured = coverage.Coverage(data_file=None, config_file=False, branch=True, include=sys.argv[1:])
measured.start()
from tests.live_course import COMPILED, own_tests
for test in own_tests():
    test(COMPILED)
measured.stop()
measured.json_report(outfile="-")
"""


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
