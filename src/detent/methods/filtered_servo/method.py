"""The filtered servo as a method: what its package brings."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from detent.axisfile.catalogue import DC_MOTORS
from detent.files.findings import Caution, Derived
from detent.methods.filtered_servo.checks import RULES, find_cautions
from detent.methods.filtered_servo.derive import derive
from detent.methods.filtered_servo.schema import FilteredServoSpec, fill_derived
from detent.methods.moves.job import MoveJob, one_move
from detent.methods.moves.method import MoveMethod

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.methods.filtered_servo.host import FilteredHost
    from detent.methods.filtered_servo.page import FilteredView
    from detent.page.frame import Comparison
    from detent.record.capture import Clocking
    from detent.record.machine import AnyRecorder, Progress

SIGNALS = (
    "plant.train.position", "plant.train.velocity", "plant.train.current", "controller.generator.command",
    "controller.deviation.deviation", "controller.deviation.error", "lines.word", "controller.speed.word",
    "controller.filter.output", "controller.clock.period", "plant.gauge.target",
)  # fmt: skip
TIMING = (
    "controller.channel_a", "controller.channel_b", "controller.decoder.a1", "controller.decoder.a2",
    "controller.decoder.b1", "controller.decoder.b2", "controller.decoder.forward", "controller.decoder.reverse",
    "controller.generator.command", "controller.deviation.deviation", "controller.speed.count",
    "controller.speed.word", "controller.clock.left", "controller.filter.output", "lines.word",
)  # fmt: skip


class FilteredServoMethod(MoveMethod[FilteredServoSpec]):
    """Command pulses, counted speed behind a digital filter."""

    name = "filtered_servo"
    title = "filtered servo: command pulses, counted speed with a low-pass"
    pace = "10 us, every 10th"
    spec = FilteredServoSpec
    rules = RULES
    catalogue = DC_MOTORS
    every = 10
    signals, timing = SIGNALS, TIMING

    def fill(self, spec: FilteredServoSpec) -> FilteredServoSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: FilteredServoSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: FilteredServoSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.filtered_servo.system import FilteredServo

        return FilteredServo

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.filtered_servo.system import FilteredServoParams

        return FilteredServoParams

    def tick(self, spec: FilteredServoSpec) -> float:
        """Ten clocks."""
        from detent.methods.filtered_servo.system import TICK

        del spec
        return TICK

    def host(self, spec: FilteredServoSpec, recorder: "AnyRecorder | None") -> "FilteredHost":
        """The axis at power-on."""
        from detent.methods.filtered_servo.host import FilteredHost

        return FilteredHost(spec, recorder)

    def view(self, spec: FilteredServoSpec) -> "FilteredView":
        """What it shows of a move."""
        from detent.methods.filtered_servo.page import FilteredView

        return FilteredView(spec)

    def seed(self, spec: FilteredServoSpec) -> int:
        """The encoder's."""
        return spec.encoder.seed

    def clocking(self) -> "Clocking":
        """Ten clocks in a tick."""
        from detent.methods.filtered_servo.controller import CLOCKS
        from detent.record.capture import Clocking

        return Clocking(CLOCKS, clocks={"clock.C": ((0.0, 0.5), "decoder clock, 1 MHz")})

    def sample_move(self, spec: FilteredServoSpec) -> MoveJob:
        """A move for looking at signals."""
        return one_move("one move of 1000 pulses", 1000 * spec.pulse, 0.2)

    def compare(self, spec: FilteredServoSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside no filter, a longer window, a smaller multiplier."""
        from detent.methods.filtered_servo.comparison import compare_feedback

        return (compare_feedback(spec, progress=progress),)
