"""A filtered servo at standstill: after stops from speed, anywhere in a pulse, at any phase of the sample."""

import math
from functools import cached_property

from detent.control.pulse_generator import PER_PULSE
from detent.methods.filtered_servo.controller import go_to
from detent.methods.filtered_servo.derive import FilteredFigures
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServo
from detent.methods.standing import HostCourse, Standing, Watched
from detent.methods.tuning import Swing
from detent.record.recorder import Recorder

EVERY = 20  # ticks between two rows
POSITION, VELOCITY, WORD = "plant.train.position", "plant.train.velocity", "lines.word"
AT_SPEED = 0.1  # time at speed before the stop [s]
ROOM = 0.4  # of the travel, that a start may take up to there
EDGE = 2.5  # counts that a swing across the edge of a count has at most
OFTEN = 0.05  # share of the time at the limit of an axis that saturates


class FilteredEnsemble(Standing):
    """What `hunt` asks of a filtered servo."""

    draws = "stops from speed at places anywhere in a pulse, at any phase of the sample"

    def __init__(self, spec: FilteredServoSpec) -> None:
        middle, undisturbed = 0.5 * spec.limits.travel, type(spec.disturbance)()
        self.spec = spec.changed(mechanics={"start_position": middle}, disturbance=undisturbed)
        self.unit, self.grain = "m", spec.pulse

    @cached_property
    def stop(self) -> tuple[float, float]:
        """Speed of the command [m/s], at most that of which half the travel leaves room, and when it stops [s]."""
        a, room = self.spec.method.command_acceleration, ROOM * self.spec.limits.travel
        speed = min(self.spec.limits.speed, room / (2.0 * AT_SPEED), math.sqrt(a * room) if a > 0.0 else math.inf)
        return speed, (speed / a if a > 0.0 else 0.0) + AT_SPEED

    def begun(self, number: int, place: float, phase: float) -> HostCourse:
        """Speed to the right and to the left in turn, and a stop."""
        spec, (speed, seconds) = self.spec, self.stop
        start = spec.mechanics.start_position + (place - 0.5) * spec.pulse
        recorder = Recorder(FilteredServo, [POSITION, VELOCITY, WORD], every=EVERY, period=TICK)
        host = FilteredHost(spec.changed(mechanics={"start_position": start}), recorder)
        host.start()
        host.stands(round(phase * spec.method.sample_period / TICK))
        pulses = round(speed * seconds / spec.pulse) * (-1 if number % 2 else 1)
        go_to(host.controller, pulses, round(speed / spec.pulse * PER_PULSE))
        a = spec.method.command_acceleration
        host.stands(round((seconds + (speed / a if a > 0.0 else 0.0)) / TICK))
        target = start + host.controller.generator.command * spec.pulse
        watched = Watched(
            place=lambda seen: seen[POSITION], error=lambda seen: target - seen[POSITION],
            velocity=VELOCITY, command=WORD, limit=spec.word_limit,
        )  # fmt: skip
        return HostCourse(
            start="stop", machine=host.machine, watched=watched, rest=host.stands, failure=lambda: host.failure
        )

    def kind(self, swing: Swing) -> str:
        """What makes it hunt so."""
        if FilteredFigures(self.spec).gain_margin < 1.0:
            return "beyond the margin"
        if swing.largest <= EDGE * self.grain:
            return "count edge"
        return "saturation" if swing.limited > OFTEN else "beyond the margin"
