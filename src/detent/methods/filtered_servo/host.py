"""The host of a filtered servo: command pulses, in position, fault."""

from detent.axisfile.blocks import describe_fault
from detent.control.deviation_counter import FAULT, GUARDED
from detent.control.pulse_generator import PER_PULSE
from detent.errors import SERVO_FAULT_TEXT
from detent.methods.filtered_servo.build import GUARD_PERIOD, build_filtered_servo
from detent.methods.filtered_servo.controller import arrive_within, forget_conduct, go_to, set_period, take_event
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServo, advance_by_clocks, switch_on
from detent.methods.moves.run import Destination, Host, Wrong
from detent.record.machine import AnyRecorder, Machine
from detent.units import format_quantity


class FilteredHost(Host):
    """Host of a filtered servo: command pulses, in position, fault."""

    forgets = staticmethod(forget_conduct)

    def __init__(self, spec: FilteredServoSpec, recorder: AnyRecorder | None = None) -> None:
        p, r, home = build_filtered_servo(spec), FilteredServo(), spec.mechanics.start_position
        machine = Machine(p, r, TICK, recorder, by_clocks=advance_by_clocks)
        switch_on(p, r, home, round(spec.method.sample_period * 1e6), spec.encoder.seed, machine.act)
        within = (spec.method.in_position + 1) * spec.pulse
        super().__init__(spec, machine, grid=spec.pulse, tolerance=within, home=home, look=GUARD_PERIOD)

    def command(self, to: Destination) -> None:
        """Ask for the pulses; a sample period of the move takes effect with the next window."""
        move = to.move
        self.act(set_period, round((move.sample_period or self.spec.method.sample_period) * 1e6))
        self.act(go_to, to.counts, round((move.speed or self.spec.limits.speed) / self.spec.pulse * PER_PULSE))

    def time_limit(self, to: Destination) -> float:
        """Time after which a move that is not in position has failed [s]."""
        speed = to.move.speed or self.spec.limits.speed
        way, a = abs(to.counts - self.controller.deviation.position) * self.grid, self.spec.method.command_acceleration
        return way / speed + (2 * speed / a if a > 0 else 0.0) + self.spec.method.timeout

    def wait(self, seconds: float) -> bool:
        """Wait until in position; False on a fault, or when it is not within `seconds`."""
        self.act(arrive_within, max(1, round(seconds / self.machine.tick)))
        self.machine.pass_time(seconds)
        arrived = bool(self.act(take_event))
        self.act(arrive_within, 0)
        return arrived and not self.controller.guard.code and not self.failure

    def problems(self, to: Destination, asked: float) -> Wrong:
        """Speed and sample period of a move against the limits of the counters."""
        del asked
        move, spec, top = to.move, self.spec, self.spec.limits.speed
        if move.speed is not None and not 0 < move.speed <= top * (1 + 1e-9):
            allowed = f"up to limits.speed, {format_quantity(top, 'm/s')}"
            yield "speed", format_quantity(move.speed, "m/s"), allowed, "lower it, or raise limits.speed"
        most = (1 << (spec.method.counter_bits - 1)) - 2
        longest = most * spec.pulse / (move.speed or top)
        period = move.sample_period
        if period is not None and not 1e-4 <= period <= min(longest, 0.1):
            allowed = f"from 0.1 ms to {format_quantity(min(longest, 0.1), 's')}: the speed counter holds {most} pulses"
            shorter = "shorten it, lower the speed, or widen the counter"
            yield "sample_period", format_quantity(period, "s"), allowed, shorter

    def in_counts(self, error: float) -> str:
        """How far off that is, and what the axis itself counts: it does not see a part of a pulse."""
        return f"{super().in_counts(error)} by its true position, P = {self.controller.deviation.deviation}"

    @property
    def failure(self) -> str:
        """Why the axis has given up; empty while it runs."""
        d, limits = self.controller.deviation, self.spec.limits
        if d.state != FAULT:
            return ""
        if d.cause != GUARDED:
            return SERVO_FAULT_TEXT[d.cause]
        speed, lower, upper = format_quantity(limits.speed, "m/s"), "0 m", format_quantity(limits.travel, "m")
        return describe_fault(self.controller.guard, self.spec.protection, speed, lower, upper)

    def stands(self, ticks: int) -> None:
        """Let the axis stand; that it comes into position again after a disturbance is no news."""
        left = ticks
        while left > 0:
            left -= self.machine.pass_ticks(left)
            self.act(take_event)
