"""How long a log of 25 s takes to simulate on the cascade axis: what an identification repeats some hundred times."""

import numpy as np
from tests.bench.race import Race, timed
from tests.cascade_rig import NO_TRACE, SAMPLE_TICKS, T_SAMPLE, Rig, make_params, set_friction

from detent.kernel.loop import advance
from detent.methods.cascade.system import along
from detent.planning.profile import MotionLimits, plan_move

LOG = 25.0
"""[s]"""

LOG_BAR = 0.1
"""Seconds of processor time for it, whatever the plant."""


class Shuttle:
    """To and fro for the whole log, at 1 kHz on ticks of 50 us."""

    def __init__(self, *, coupled: bool, stribeck: bool) -> None:
        p = make_params(coupled=coupled, gap=1e-4 if coupled else 0.0)
        for mass in (p.plant.machine.motor, p.plant.machine.load):
            set_friction(mass.friction, coulomb=3.0, static=4.0, viscous=5.0, stribeck=2e-3 if stribeck else 0.0)
        there = plan_move(0.0, 0.1, MotionLimits(0.5, 5.0, 100.0), T_SAMPLE)
        samples = round(LOG / T_SAMPLE)
        times = -(-samples // (2 * there.count))
        reference = tuple(
            np.tile(np.concatenate([way, back]), times)[:samples]
            for way, back in (
                (there.position, there.position[::-1]),
                (there.velocity, -there.velocity[::-1]),
                (there.acceleration, there.acceleration[::-1]),
            )
        )
        self.feed = along(*reference)
        self.rig = Rig(p)
        self.begin = self.rig.r.snapshot()
        self.ticks = samples * SAMPLE_TICKS

    def run(self) -> int:
        """The log; returns the ticks."""
        rig = self.rig
        rig.r.restore(self.begin)
        advance(rig.p, rig.r, self.ticks, *NO_TRACE, *self.feed)
        assert abs(rig.r.controller.law.position_error) < 0.05
        return self.ticks


def test_a_log_of_25_seconds(benchmark):
    shuttles = {
        "rigid": Shuttle(coupled=False, stribeck=False),
        "rigid, Stribeck": Shuttle(coupled=False, stribeck=True),
        "two masses, backlash": Shuttle(coupled=True, stribeck=False),
        "two masses, backlash, Stribeck": Shuttle(coupled=True, stribeck=True),
    }
    race = Race({name: timed(shuttle.run) for name, shuttle in shuttles.items()})
    if race.hold(benchmark, "rigid", 20):
        worst = max(race.nanoseconds().values()) * 1e-9 * shuttles["rigid"].ticks
        benchmark.extra_info["seconds of processor time per log, at worst"] = round(worst, 3)
        assert worst < LOG_BAR
