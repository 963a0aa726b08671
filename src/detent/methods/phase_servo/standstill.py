"""A phase servo at standstill: after moves to places anywhere in a step, at any phase of the speed sample.

While it settles its corrector knows no zero, so that it swings from edge to edge of a step; at stop dead band and
integrator bring it to rest.
"""

from detent.axisfile.blocks import describe_fault
from detent.control.guard import NO_ARRIVAL
from detent.methods.phase_servo.derive import PhaseFigures
from detent.methods.phase_servo.host import START, PhaseBench
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo, be_ready
from detent.methods.standing import HostCourse, Standing, Watched
from detent.methods.tuning import Swing
from detent.record.recorder import Recorder
from detent.units import format_quantity

PITCHES = 6  # of each move
EVERY = 64  # ticks between two rows
POSITION, VELOCITY = "plant.train.position", "plant.train.velocity"
WORD, INTEGRAL = "controller.law.word", "controller.law.integral"
EDGE = 2.5  # steps that a swing across the edge of a step has at most
OFTEN = 0.05  # share of the time at the limit of an axis that saturates


class PhaseEnsemble(Standing):
    """What `hunt` asks of a phase servo."""

    draws = "moves to places anywhere in a step, at any phase of the speed sample"

    def __init__(self, spec: PhaseServoSpec) -> None:
        self.spec, self.unit, self.grain = spec, "m", spec.step

    @property
    def earlier(self) -> tuple[str, PhaseServoSpec] | None:
        """Settling, until stop."""
        if self.spec.method.stop_always_off:
            return None
        after = format_quantity(self.spec.method.stop_time, "s", 3)
        return f"while settling, until stop {after} after the change of mode", self.spec.changed(
            method={"stop_always_off": True}
        )

    def begun(self, number: int, place: float, phase: float) -> HostCourse:
        """A move by a few pitches, to the right and to the left in turn, until stop."""
        spec = self.spec
        recorder = Recorder(PhaseServo, [POSITION, VELOCITY, WORD, INTEGRAL], every=EVERY, period=spec.tick)
        bench = PhaseBench(spec, -PITCHES if number % 2 else PITCHES, recorder=recorder)
        state, machine, target = bench.machine.state, bench.machine, bench.target
        state.plant.train.position += (place - 0.5) * spec.step
        be_ready(machine.params, state)
        bench.run_until(START + phase * spec.sample_period)
        bench.move()
        if not spec.method.stop_always_off:
            bench.run_until(machine.time + spec.method.stop_time)
        limit = (1 << (spec.drive.pwm_bits - 1)) - 1
        watched = Watched(
            place=lambda seen: seen[POSITION], error=lambda seen: target - seen[POSITION],
            velocity=VELOCITY, command=WORD, limit=limit, integral=INTEGRAL,
        )  # fmt: skip
        guard = state.controller.guard

        def failure() -> str:
            """Why the bridge is off."""
            speed = format_quantity(spec.limits.speed, "m/s")
            return "" if guard.code in {0, NO_ARRIVAL} else describe_fault(guard, spec.protection, speed)

        return HostCourse(
            start="move", machine=machine, watched=watched, failure=failure, noisy=spec.detector.jitter > 0.0,
            rest=lambda ticks: bench.run_until(machine.time + ticks * spec.tick),
        )  # fmt: skip

    def kind(self, swing: Swing) -> str:
        """What makes it hunt so."""
        if swing.largest <= EDGE * self.grain:
            return "count edge"
        slow = swing.period > 2.0 * 6.3 / PhaseFigures(self.spec).position_loop
        return "saturation with integral" if slow and swing.limited > OFTEN else "beyond the margin"
