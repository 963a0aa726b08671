"""The rotary table as a method: what its package brings."""

from typing import TYPE_CHECKING

from detent.methods.method import Method
from detent.methods.rotary_table.schema import RotaryTableSpec

if TYPE_CHECKING:
    from detent.methods.rotary_table.sequence_job import SequenceJob


class RotaryTableMethod(Method[RotaryTableSpec]):
    """Absolute angle of one turn, servo-controlled jog for any number of turns."""

    name = "rotary_table"
    title = "rotary table: absolute angle of one turn, servo-controlled endless jog"
    jobs = "a sequence (.toml)"
    pace = "100 us, every 20th"
    spec = RotaryTableSpec
    fills, derives = "schema:fill_derived", "derive:derive"
    senses, begins = "derive:position_sensors", "mechanics.start_angle"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:RotaryTable", "system:RotaryTableParams"
    actions = (
        "power_on", "dial", "press", "release", "position", "acknowledge", "arrive_within", "forget_conduct",
    )  # fmt: skip
    fits = "controller:fit"
    every = 20
    seed = "detector.seed"
    signals = "run:SEQUENCE_SIGNALS"
    timing = (
        "lines.fine", "lines.coarse", "controller.absolute.theta", "controller.positioner.angle.dar",
        "controller.positioner.angle.flg", "controller.positioner.angle.turn", "controller.positioner.angle.aar",
        "controller.positioner.oar", "controller.positioner.interpolator.irr", "controller.positioner.dr",
        "controller.positioner.s4", "lines.word", "plant.train.motor.velocity",
    )  # fmt: skip
    takes, reads, runs = "sequence_job:SequenceJob", "sequence_file:load_sequence", "run:run_sequence"
    linear_loops = "derive:linear_loops"
    tunes = "tuning:TableTuning"
    stands = "standstill:TableEnsemble"
    leaves_out = ("Neglected: saturation, quantization, friction that is not viscous.",)
    lives = "live:live"
    wires, machines = "wired:wired", "wired:machine"
    compares = ("comparison:compare_angle",)
    sums_up, reports = "summary:sequence_summary_rows", "page:table_page"
    says = "{job}: every step was done on {axis}.", "Not done: {failure}"

    def sample_job(self, spec: RotaryTableSpec) -> "SequenceJob":
        """A short jog."""
        from detent.methods.rotary_table.sequence_job import Jog, SequenceJob

        return SequenceJob("a short jog", (Jog(direction=1, duration=max(0.2, spec.method.task_period)),), {})
