"""The print head as a method: what its package brings."""

from typing import TYPE_CHECKING

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.method import Method
from detent.methods.print_head.schema import PrintHeadSpec

if TYPE_CHECKING:
    from detent.methods.print_head.printed_page import PrintJob


class PrintHeadMethod(Method[PrintHeadSpec]):
    """Brush DC carriage that measures itself at power-up, then prints."""

    name = "print_head"
    title = "print head: DC carriage that identifies itself"
    jobs = "plain text or a Diablo 630 stream"
    pace = "40 us, every 10th"
    spec = PrintHeadSpec
    catalogue = DC_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    senses = "derive:position_sensors"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    actions = ("power_on", "write_command", "read_status", "ink_columns")
    interrupts = ("begin", "emitter", "reverse", "fired", "decide")
    state, params = "system:PrintHead", "system:PrintHeadParams"
    every = 10
    seed = "encoder.seed"
    signals = "run:SIGNALS"
    timing = (
        "plant.encoder.channel_a", "plant.encoder.channel_b", "controller.quadrature.count", "controller.head.state",
        "controller.head.drive_cmd", "plant.timer.pulse", "lines.right_left", "lines.transition", "plant.train.current",
    )  # fmt: skip
    takes, reads, runs = "print_job:PrintJob", "print_job:load_job", "run:print_job"
    searches = "tuning:HeadSearch"
    lives = "live:live"
    rests = "its drive is off there, and friction holds the carriage"
    compares = ("comparison:compare_drives",)
    sums_up, reports = "page:summary_rows", "page:print_page"
    says = "Printed {job} on {axis}.", "Not printed: {failure}"
    doubts = "Printed {job} on {axis}, but {doubt}."
    reports_comparisons = False

    def sample_job(self, spec: PrintHeadSpec) -> "PrintJob":
        """One word."""
        del spec
        return self.brought("print_job:parse_text")("detent", "one word")

    def trial_job(self, spec: PrintHeadSpec) -> "PrintJob":
        """Lines long and short."""
        return self.brought("tuning:four_lines")(spec)
