"""The filtered servo as a method: what its package brings."""

from typing import TYPE_CHECKING

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.moves.job import MoveJob, one_move
from detent.methods.moves.method import MoveMethod

if TYPE_CHECKING:
    from detent.record.capture import Clocking

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
    catalogue = DC_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    senses = "derive:position_sensors"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:FilteredServo", "system:FilteredServoParams"
    actions = (
        "power_on", "go_to", "reset", "set_period", "arrive_within", "take_event", "forget_conduct",
    )  # fmt: skip
    every = 10
    seed = "encoder.seed"
    signals, timing = SIGNALS, TIMING
    linear_loops = "derive:linear_loops"
    tunes = "tuning:FilteredTuning"
    stands = "standstill:FilteredEnsemble"
    leaves_out = ("Neglected: saturation, quantization, friction that is not viscous.",)
    lives = "live:live"
    compares = ("comparison:compare_feedback",)
    commands, shows = "host:FilteredHost", "page:FilteredView"

    def clocking(self, spec: FilteredServoSpec) -> "Clocking":
        """Ten clocks in a tick."""
        from detent.record.capture import Clocking

        del spec
        return Clocking(self.brought("controller:CLOCKS"), clocks={"clock.C": ((0.0, 0.5), "decoder clock, 1 MHz")})

    def sample_job(self, spec: FilteredServoSpec) -> MoveJob:
        """A thousand pulses."""
        return one_move("one move of 1000 pulses", 1000 * spec.pulse, 0.2)
