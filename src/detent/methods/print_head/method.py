"""The print head as a method: what its package brings."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.method import Method, Shown, Simulated
from detent.methods.print_head.schema import PrintHeadSpec

if TYPE_CHECKING:
    from detent.methods.print_head.printed_page import PrintJob
    from detent.page.frame import Comparison, Page
    from detent.record.machine import Progress


class PrintHeadMethod(Method[PrintHeadSpec]):
    """Brush DC carriage that measures itself at power-up, then prints."""

    name = "print_head"
    title = "print head: DC carriage that identifies itself"
    jobs = "plain text or a Diablo 630 stream"
    pace = "40 us, every 10th"
    spec = PrintHeadSpec
    catalogue = DC_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:PrintHead", "system:PrintHeadParams"
    every = 10
    seed = "encoder.seed"
    timing = (
        "plant.encoder.channel_a", "plant.encoder.channel_b", "controller.quadrature.count", "controller.head.state",
        "controller.head.drive_cmd", "plant.timer.pulse", "lines.right_left", "lines.transition", "plant.train.current",
    )  # fmt: skip
    takes, reads, runs = "print_job:PrintJob", "print_job:load_job", "run:print_job"
    reports = "page:print_page"
    says = "Printed {job} on {axis}.", "Not printed: {failure}"
    reports_comparisons = False

    def simulated(self, spec: PrintHeadSpec) -> Simulated:
        """A print head that prints texts."""
        return replace(super().simulated(spec), signals=tuple(self.brought("run:default_signals")()))

    def sample_job(self, spec: PrintHeadSpec) -> "PrintJob":
        """One word."""
        del spec
        return self.brought("print_job:parse_text")("detent", "one word")

    def compare(self, spec: PrintHeadSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Three drives on a machine that has drifted."""
        del progress
        return (self.brought("comparison:compare_drives")(spec),)

    def summary(self, spec: PrintHeadSpec, result: Any) -> list[tuple[str, str]]:
        """Lines, times, speeds, column error, what was identified."""
        del spec
        return self.brought("summary:summary_rows")(result)

    def page(self, spec: PrintHeadSpec, result: Any, shown: Shown) -> "Page":
        """The report, which says how exactly the machine was simulated."""
        return super().page(spec, result, replace(shown, settings={"fidelity": spec.axis.fidelity} | shown.settings))
