"""What a print head cannot measure of itself: how hard it accelerates, and how fast it prints; each pair is printed.

It identifies its own slope and friction at power-up; `ir_counts` and `max_print_speed` are told to it. Of the pairs
with which a few lines come out whole, each dot within half an emitter of its place and no line by a second run at it,
the best is done first.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from detent.files.quantities import INCH
from detent.methods.print_head.checks import find_cautions
from detent.methods.print_head.print_job import PrintJob, parse_text
from detent.methods.print_head.run import print_job
from detent.methods.print_head.schema import EMITTER, PrintHeadSpec
from detent.methods.tuning import Search, Trial
from detent.units import format_quantity

COUNTS, SPEED = "method.ir_counts", "method.max_print_speed"
TRIED_COUNTS = range(48, 193, 8)
SLOWEST, STEP = 15.0 * INCH, 5.0 * INCH  # speeds that are tried, beside limits.speed [m/s]
WITHIN = 0.5  # emitters, that a dot may be off its place
TEXT = """The quick brown fox jumps over the lazy dog, and back again.
A short line

                              to the right of it, then
The quick brown fox jumps over the lazy dog once more, to the end."""


def four_lines(spec: PrintHeadSpec) -> PrintJob:
    """Lines long and short, from either side."""
    del spec
    return parse_text(TEXT, "four lines")


class HeadSearch(Search):
    """What `tune` asks."""

    keys = (COUNTS, SPEED)
    decides = "print time, to a millisecond, and of those alike the smallest error of a dot"
    measure, sides = "print time [s]", ("speed [in/s]", "ir_counts")

    def __init__(self, spec: PrintHeadSpec) -> None:
        self.spec = spec
        self.warned = {one.name for one in find_cautions(spec)}

    def candidates(self, held: Sequence[str]) -> list[dict[str, Any]]:
        """Every pair of drive counts and speed, those of the file among them."""
        method, top = self.spec.method, self.spec.limits.speed
        counts = sorted({*TRIED_COUNTS, method.ir_counts}) if COUNTS not in held else [method.ir_counts]
        number = int((top - SLOWEST) / STEP + 1e-9) + 1
        steps = [SLOWEST + k * STEP for k in range(number)]
        speeds = [one for one in steps if one < top * (1 - 1e-9)] + [top]
        speeds = speeds if SPEED not in held else [method.max_print_speed]
        return [{COUNTS: one, SPEED: float(f"{speed:.9g}")} for speed in speeds for one in counts]

    def place(self, values: Mapping[str, Any]) -> tuple[float, float]:
        """Speed [in/s] and drive counts."""
        return round(values[SPEED] / INCH, 3), float(values[COUNTS])

    def tried(self, spec: PrintHeadSpec, job: PrintJob) -> Trial:
        """A few lines, from power-on."""
        run = print_job(spec, job)
        if not run.done:
            return Trial("the job is not printed")
        figures = {
            "print time": format_quantity(run.print_time, "s", 4),
            "largest error of a dot": format_quantity(run.worst_error, "m", 3),
            "lines that took a second run": str(run.repositions),
            "peak current": format_quantity(run.peak_current, "A", 3),
        }
        if run.worst_error > WITHIN * EMITTER:
            return Trial("a dot is more than half an emitter off", figures=figures)
        if run.repositions:
            return Trial("a line takes a second run", figures=figures)
        if run.warnings:
            return Trial("its run is doubted", figures=figures)
        new = sorted({one.name for one in find_cautions(spec)} - self.warned)
        if new:
            return Trial(f"a caution of {new[0]}", figures=figures)
        return Trial("", (round(run.print_time, 3), run.worst_error), figures)
