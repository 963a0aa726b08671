"""What a stepper's envelope costs: to build it, to change it, and per step; none of it may depend on the travel.

Every alternative to the run-time rule makes the same moves through the same timer, one step per decision:

- C is the rule and the timer by hand, statement for statement;
- method B works the permissible frequency out anew: a comparison of distances, two products and a square root;
- AccelStepper works out the braking distance and the next interval: three divisions.

The word of a step is a frequency, which the timer divides its clock by, or the timer's reload value. With frequencies
the rule stands beside method B, both with that one division in the timer. With reload values it stands beside
AccelStepper, whose intervals are such values, and again beside method B, which only a table spares the division.
"""

import ctypes
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from tests.bench import accel_stepper
from tests.bench.race import COMPILER, OPTIMISED, Race, compile_c, first_line, needs_c, timed
from tests.c_struct import c_struct
from tests.stepper_rig import COARSE_FINE, MAX_HZ, NO_TRACE, RAMP, RELOAD_CLOCK_HZ, START_HZ, Rig

from detent.control.step_comparison import PERMISSIBLE_FREQUENCY
from detent.control.step_rule import FAULT, OUT_OF_RANGE, REST, acknowledge
from detent.kernel.loop import advance
from detent.methods.stepper_envelope.controller import StepperController, StepperControllerParams
from detent.planning.step_envelope import SENTINEL, StepEnvelope, ZoneMap
from detent.planning.step_ramp import make_ramp

BUILD_BAR = 0.05
"""Seconds to build a table of a million steps."""

SPREAD = 0.3
"""How far the time per step may differ between travels of 10^3 and 10^6 steps (acceptance test 10)."""

C_BAR = 2.0
"""The composed steps may take this much longer than C."""

SIZES = (10**3, 10**4, 10**5, 10**6)
LONGEST = 10**9
MOVES = 25
ROUNDS = 60
SOURCE = Path(__file__).with_name("step_rule.c")

RULE = {"rule, frequencies": False, "rule, reload values": True}
"""Whether its words are reload values."""

FASTER = {"rule, frequencies": ["method B"], "rule, reload values": ["method B", "AccelStepper"]}
"""What the rule must be faster than."""


def test_building_a_million_steps(benchmark):
    zones = ZoneMap(10**6, MAX_HZ, COARSE_FINE)
    benchmark(StepEnvelope, RAMP, zones)
    if not benchmark.disabled:
        assert benchmark.stats.stats.median < BUILD_BAR


@pytest.mark.parametrize("steps", SIZES)
def test_moving_a_stop(benchmark, steps):
    table = StepEnvelope(RAMP, ZoneMap(steps, MAX_HZ))
    places = iter(range(10**9))
    benchmark(lambda: table.move_stop(500 + next(places) % 400))


# ---- engines ---------------------------------------------------------------------------------------------------------


def compiled(rig, steps=LONGEST):
    """The composed steps; returns the steps made."""
    return advance(rig.alone, rig.r, steps, *NO_TRACE, *rig.tables)


def rule_in_c(folder, *flags):
    """The same in C, compiled against the register files' own declarations."""
    (folder / "step_rule_registers.h").write_text(c_struct(StepperControllerParams, StepperController))
    function: Any = compile_c(SOURCE, folder, *flags).advance
    function.argtypes, function.restype = [ctypes.c_void_p] * 4 + [ctypes.c_int64] * 2, ctypes.c_int64

    def run(rig, steps=LONGEST):
        up, down = rig.up.entries, rig.down.entries
        state = ctypes.addressof(rig.p.controller), ctypes.addressof(rig.r.controller)
        return function(*state, up.ctypes.data, down.ctypes.data, len(up), steps)

    return run


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rule")
    return {f"C {flags}": rule_in_c(folder, *flags.split()) for flags in OPTIMISED}


# ---- C makes the same steps ------------------------------------------------------------------------------------------


class Course(NamedTuple):
    """A motor, what its host does before so many steps each, and how it must end."""

    make: Any
    acts: tuple
    end: tuple[int, int]
    """State and position."""
    cause: int = 0


def nothing(_rig):
    """Let it run on."""


def nearer(rig):
    assert not rig.edit_stop(5000).overrun


def spoil(rig):
    """The table ends 10 steps ahead of a motor at full speed."""
    rig.up.entries[rig.position + 10 :] = SENTINEL


def reset(rig):
    rig.rule.reset = 1


COURSES = {
    "a single step": Course(lambda **k: Rig(1, **k), ((Rig.start, 9),), (REST, 1)),
    "there and back, twice": Course(
        lambda **k: Rig(300, pause=2, **k), ((lambda rig: rig.start(turns=3), LONGEST),), (REST, 0)
    ),
    "coarse and fine, in pieces": Course(
        lambda **k: Rig(8000, COARSE_FINE, **k), ((Rig.start, 1), (nothing, 2500), (nothing, LONGEST)), (REST, 8000)
    ),
    "from the middle": Course(lambda **k: Rig(at=1000, **k), ((Rig.start, LONGEST),), (REST, 8000)),
    "by joystick": Course(
        lambda **k: Rig(at=3000, **k),
        (
            (lambda rig: rig.joystick(MAX_HZ), 500),
            (lambda rig: rig.joystick(1234), 500),
            (lambda rig: rig.joystick(3000, -1), 1000),
            (lambda rig: rig.joystick(0), LONGEST),
        ),
        (REST, 2925),
    ),
    "a stop drawn nearer": Course(Rig, ((Rig.start, 3000), (nearer, LONGEST)), (REST, 5000)),
    "the table falls too fast": Course(Rig, ((Rig.start, 1000), (spoil, LONGEST), (Rig.start, 9)), (FAULT, 1237), 1),
    "beyond the travel": Course(lambda **k: Rig(at=-1, **k), ((Rig.start, 9),), (FAULT, -1), OUT_OF_RANGE),
    "reset": Course(lambda **k: Rig(at=8001, **k), ((Rig.start, 9), (reset, 9)), (REST, 8001), OUT_OF_RANGE),
    "the literal rule": Course(
        lambda **k: Rig(900, literal=True, at=400, **k),
        ((Rig.start, 300), (nothing, LONGEST)),
        (REST, 900),
    ),
}


def drive(course, engine, **kwargs):
    """State after each act."""
    rig = course.make(**kwargs)
    states = []
    for act, steps in course.acts:
        act(rig)
        engine(rig, steps)
        states.append(rig.r.controller.snapshot())
        acknowledge(rig.rule)
    assert (rig.rule.state, rig.position, rig.rule.cause) == (*course.end, course.cause)
    return states


@needs_c
@pytest.mark.parametrize("reload", [False, True], ids=["frequencies", "reload values"])
@pytest.mark.parametrize("course", COURSES.values(), ids=COURSES)
def test_c_ends_on_the_same_registers(in_c, course, reload):
    expected = drive(course, compiled, reload=reload)
    for name, engine in in_c.items():
        assert drive(course, engine, reload=reload) == expected, name


# ---- time per step ---------------------------------------------------------------------------------------------------


class Motion(NamedTuple):
    """Moves of so many steps with one constant acceleration [step/s2], in one zone."""

    steps: int
    acceleration: float

    def rig(self, *, reload=False):
        """A motor at rest at 0."""
        ramp = make_ramp(START_HZ, MAX_HZ, lambda _: self.acceleration)
        return Rig(self.steps, ramp=ramp, reload=reload)

    def computed(self):
        """The same, with method B in place of the rule."""
        rig = self.rig().compared(PERMISSIBLE_FREQUENCY)
        rig.p.comparison.acceleration = self.acceleration
        return rig


MOTIONS = {"mostly at full speed": Motion(8000, 40_000.0), "ramps alone": Motion(3960, 4000.0)}


def to_and_fro(rig, engine=compiled):
    """Moves from end to end, the host asked for the first one only."""
    begin = rig.r.snapshot()

    def run():
        rig.r.restore(begin)
        made = engine(rig.start(turns=MOVES - 1))
        assert made == MOVES * rig.zones.steps
        return made

    return timed(run)


def up_again(rig):
    """Moves from 0 to the end, each started by the host; those that compute know no other."""
    begin = rig.r.snapshot()

    def run():
        made = 0
        for _ in range(MOVES):
            rig.r.restore(begin)
            made += compiled(rig.start())
        assert made == MOVES * rig.zones.steps
        return made

    return timed(run)


def by_accel_stepper(motion):
    """The same moves with AccelStepper."""
    p, r = accel_stepper.accel_stepper(motion.acceleration, MAX_HZ, RELOAD_CLOCK_HZ)
    begin = r.snapshot()

    def run():
        made = 0
        for _ in range(MOVES):
            r.restore(begin)
            accel_stepper.move_to(p, r, motion.steps)
            made += accel_stepper.advance(p, r, LONGEST, *NO_TRACE)
        assert made == MOVES * motion.steps
        return made

    return timed(run)


def test_accel_stepper_moves_as_its_recurrence_says():
    p, r = accel_stepper.accel_stepper(40_000.0, MAX_HZ, RELOAD_CLOCK_HZ)
    for target in (8000, 0):
        accel_stepper.move_to(p, r, target)
        begin, words = r.timer.expires, []
        while r.word:
            words.append(r.word)
            accel_stepper.advance(p, r, 1, *NO_TRACE)
        assert (r.position, len(words), min(words)) == (target, 8000, RELOAD_CLOCK_HZ / MAX_HZ)
        # Exact intervals of a constant acceleration: sqrt(2/a) (sqrt(n + 1) - sqrt(n)).
        exact = [(2 / 40_000) ** 0.5 * ((n + 1) ** 0.5 - n**0.5) * RELOAD_CLOCK_HZ for n in range(100)]
        assert words[1:100] == pytest.approx(exact[1:], rel=0.025)
        assert words[:-100:-1] == pytest.approx(words[:99], rel=0.01)
        assert r.timer.expires - begin == pytest.approx((8000 / MAX_HZ + MAX_HZ / 40_000) * RELOAD_CLOCK_HZ, rel=0.005)


@needs_c
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_the_rule_against_c(benchmark, in_c, motion):
    runs = {name: to_and_fro(motion.rig(reload=reload)) for name, reload in RULE.items()}
    twins = {rule: [f"{name}, for the {rule}" for name in in_c] for rule in RULE}
    for rule, reload in RULE.items():
        runs |= {
            name: to_and_fro(motion.rig(reload=reload), engine)
            for name, engine in zip(twins[rule], in_c.values(), strict=True)
        }
    race = Race(runs)
    if race.hold(benchmark, "rule, frequencies", ROUNDS):
        benchmark.extra_info["C compiler"] = first_line(str(COMPILER), "--version")
        assert all(race.ratio(rule, twins[rule]) <= C_BAR for rule in RULE), race.nanoseconds()


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_the_rule_against_what_is_computed_at_each_step(benchmark, motion):
    computed = {"method B": up_again(motion.computed()), "AccelStepper": by_accel_stepper(motion)}
    race = Race({name: up_again(motion.rig(reload=reload)) for name, reload in RULE.items()} | computed)
    if race.hold(benchmark, "rule, frequencies", ROUNDS):
        # Best rounds, not medians: another program on the same core takes time from the rule, which keeps all units of
        # the processor busy, and next to none from AccelStepper, which waits for one division after the other.
        best = {name: min(times) for name, times in race.times.items()}
        benchmark.extra_info.update({f"best ns per step, {name}": round(ns, 2) for name, ns in best.items()})
        assert all(best[rule] < best[other] for rule, others in FASTER.items() for other in others), best


def million_steps(travel):
    """A million steps, to and fro over the travel, the host asked for the first move only."""
    rig = Rig(travel)
    begin, moves = rig.r.snapshot(), 10**6 // travel

    def run():
        rig.r.restore(begin)
        made = compiled(rig.start(turns=moves - 1))
        assert made == 10**6
        return made

    return timed(run)


def test_the_time_per_step_does_not_depend_on_the_travel(benchmark):
    race = Race({f"N = {travel}": million_steps(travel) for travel in SIZES})
    if race.hold(benchmark, f"N = {SIZES[-1]}", 20):
        found = race.nanoseconds()
        middle = sorted(found.values())[len(found) // 2]
        assert all(abs(ns / middle - 1) < SPREAD for ns in found.values()), found
