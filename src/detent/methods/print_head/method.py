"""The print head as a method: what its package brings."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.files.findings import Caution, Derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.print_head.checks import RULES, find_cautions
from detent.methods.print_head.derive import derive
from detent.methods.print_head.schema import PrintHeadSpec, fill_derived

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

TIMING = (
    "plant.encoder.channel_a", "plant.encoder.channel_b", "controller.quadrature.count", "controller.head.state",
    "controller.head.drive_cmd", "plant.timer.pulse", "lines.right_left", "lines.transition", "plant.train.current",
)  # fmt: skip


class PrintHeadMethod(Method[PrintHeadSpec]):
    """Brush DC carriage that measures itself at power-up, then prints."""

    name = "print_head"
    title = "print head: DC carriage that identifies itself"
    jobs = "plain text or a Diablo 630 stream"
    pace = "40 us, every 10th"
    spec = PrintHeadSpec
    rules = RULES
    catalogue = DC_MOTORS
    reports_comparisons = False

    def fill(self, spec: PrintHeadSpec) -> PrintHeadSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: PrintHeadSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: PrintHeadSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.print_head.system import PrintHead

        return PrintHead

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.print_head.system import PrintHeadParams

        return PrintHeadParams

    def simulated(self, spec: PrintHeadSpec) -> Simulated:
        """A print head that prints texts."""
        from detent.methods.print_head import system
        from detent.methods.print_head.print_job import PrintJob, load_job, parse_text
        from detent.methods.print_head.run import PrintRun, default_signals, print_job
        from detent.record.capture import Clocking

        def run(job: PrintJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None) -> PrintRun:
            return print_job(spec, job, recorder=recorder, progress=progress)

        return Simulated(
            registers=system.PrintHead,
            tick=system.TICK,
            every=10,
            seed=spec.encoder.seed,
            signals=tuple(default_signals()),
            timing=TIMING,
            clocking=Clocking(),
            load=load_job,
            job=PrintJob,
            run=run,
            sample_job=lambda: parse_text("detent", "one word"),
        )

    def compare(self, spec: PrintHeadSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Three drives on a machine that has drifted."""
        from detent.methods.print_head.comparison import compare_drives

        del progress
        return (compare_drives(spec),)

    def verdict(self, axis: str, result: Any) -> str:
        """Printed or not."""
        return f"Printed {result.job.name} on {axis}." if result.done else f"Not printed: {result.failure}"

    def summary(self, spec: PrintHeadSpec, result: Any) -> list[tuple[str, str]]:
        """Lines, times, speeds, column error, what was identified."""
        from detent.methods.print_head.summary import summary_rows

        del spec
        return summary_rows(result)

    def page(self, spec: PrintHeadSpec, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.print_head.page import print_page

        settings = {"fidelity": spec.axis.fidelity} | shown.settings
        return print_page(spec, result, shown.trace, shown.comparisons, settings)
