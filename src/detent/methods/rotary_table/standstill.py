"""A rotary table at standstill: after stops of a jog at any phase of the strobe, with and without noise."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.rotary_table.build import start_turns
from detent.methods.rotary_table.derive import TableFigures
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.methods.standing import HostCourse, Standing, Watched
from detent.methods.tuning import Swing
from detent.record.recorder import Recorder

EVERY = 2  # ticks between two rows
TURNS, ANGLE = "plant.train.motor.turns", "plant.train.motor.angle"
VELOCITY, WORD = "plant.train.motor.velocity", "lines.word"
LAG, WAY = "controller.positioner.dr", "controller.positioner.z"
NOISES = "detector.fine.noise", "detector.coarse.noise"
AT_SPEED = 0.2  # time at speed before the stop [s]
EDGE = 2.5  # counts that a swing across the edge of a count has at most
STICKS = 0.1  # share of the time that friction holds a table which it makes hunt


class TableEnsemble(Standing):
    """What `hunt` asks of a rotary table."""

    draws = "stops of a jog at places anywhere in a count, at any phase of the strobe"

    def __init__(self, spec: RotaryTableSpec) -> None:
        self.spec = spec.changed(disturbance={"load": None})
        self.unit, self.grain = "rad", spec.count
        self.noisy = max(spec.detector.fine.noise, spec.detector.coarse.noise) > 0.0
        self.remarks = (
            ("every other start is without the noise of the resolvers",) if self.noisy
            else ("the file states no noise of the resolvers, so that none was tried",)
        )  # fmt: skip

    def begun(self, number: int, place: float, phase: float) -> HostCourse:
        """A jog to the right and to the left in turn, and its stop."""
        noisy = self.noisy and number % 2 == 0
        spec = self.spec if noisy else self.spec.varied(dict.fromkeys(NOISES, 0.0))
        recorder = Recorder(RotaryTable, [TURNS, ANGLE, VELOCITY, WORD, LAG, WAY], every=EVERY, period=TICK)
        host = TableHost(spec, recorder)
        motor = host.machine.state.plant.train.motor
        motor.angle = (motor.angle + (place - 0.5) * math.tau / spec.detector.fine.counts) % math.tau
        first, ratio, fraction = start_turns(spec), spec.ratio, 1 << spec.method.fraction_bits

        def rest(ticks: int) -> None:
            """Let so many ticks pass; that it is in position is no news."""
            left = ticks
            while left > 0:
                left -= host.machine.pass_ticks(left)
                host.acknowledge()

        def place_of(seen: Any) -> NDArray[np.float64]:
            """Angle of the table from where it began [rad]."""
            return ((seen[TURNS] - math.floor(first)) * math.tau + seen[ANGLE]) / ratio

        host.start()
        rest(round(phase * spec.method.strobe_period / TICK))
        speed = spec.limits.speed
        host.press(-1 if number // 2 % 2 else 1, speed)
        rest(round((spec.method.task_period + speed / spec.limits.acceleration + AT_SPEED) / TICK))
        host.release()
        rest(round((spec.method.task_period + speed / spec.limits.acceleration + host.settling_time) / TICK))
        watched = Watched(
            place=place_of, error=lambda seen: seen[LAG] * seen[WAY] * (spec.count / fraction),
            velocity=VELOCITY, command=WORD, limit=spec.largest_word,
        )  # fmt: skip
        return HostCourse(
            start="stop with noise" if noisy else "stop", machine=host.machine, watched=watched, rest=rest,
            failure=lambda: host.failure, noisy=noisy,
        )  # fmt: skip

    def kind(self, swing: Swing) -> str:
        """What makes it hunt so."""
        if not TableFigures(self.spec).is_stable:
            return "beyond the margin"
        if swing.held > STICKS:
            return "converter step against friction"
        return "count edge" if swing.largest <= EDGE * self.grain else "beyond the margin"
