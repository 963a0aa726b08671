"""What each control method shows: the report of a run, its summary, the comparison with its alternatives."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from detent.axisfile.methods import AnySpec
from detent.axisfile.print_head.schema import PrintHeadSpec
from detent.report.summary import move_summary_rows
from detent.report.summary import summary_rows as print_summary_rows
from detent.simulation.comparisons import AnyComparison
from detent.simulation.drive_comparison import DriveComparison
from detent.simulation.feedback_comparison import FeedbackComparison
from detent.simulation.hold_comparison import HoldComparison
from detent.simulation.methods import AnyResult
from detent.simulation.move_run import MoveRun
from detent.simulation.noise_comparison import NoiseComparison
from detent.simulation.print_run import PrintRun
from detent.simulation.trace import Trace
from detent.units import format_quantity

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Title, heads and rows."""


def summary_rows(spec: AnySpec, result: AnyResult) -> list[tuple[str, str]]:
    """The figures of a run that a person wants first."""
    if isinstance(result, PrintRun):
        return print_summary_rows(result)
    assert not isinstance(spec, PrintHeadSpec)  # noqa: S101 - a print head never makes a list of moves
    return move_summary_rows(spec, result)


def report_of(
    spec: AnySpec,
    result: AnyResult,
    trace: Trace | None,
    comparisons: tuple[AnyComparison, ...],
    settings: dict[str, str],
) -> Callable[[str | Path], None]:
    """The report of a run, to be written under a path."""
    if isinstance(spec, PrintHeadSpec) and isinstance(result, PrintRun):
        from detent.report.print_page import write_report
        from detent.report.print_report import print_report

        page = print_report(spec, result, trace, settings={"fidelity": spec.axis.fidelity} | settings)
        return lambda path: write_report(page, path)
    from detent.report.servo_page import write_servo_report
    from detent.report.servo_report import servo_report

    assert not isinstance(spec, PrintHeadSpec)  # noqa: S101 - see above
    assert isinstance(result, MoveRun)  # noqa: S101
    data = servo_report(
        spec,
        result,
        trace,
        noise=next((found for found in comparisons if isinstance(found, NoiseComparison)), None),
        hold=next((found for found in comparisons if isinstance(found, HoldComparison)), None),
        feedback=next((found for found in comparisons if isinstance(found, FeedbackComparison)), None),
        settings=settings,
    )
    return lambda path: write_servo_report(data, path)


def plot_comparison_of(spec: AnySpec, comparison: AnyComparison, path: Path) -> None:
    """Draw one comparison into a PNG, SVG or PDF file."""
    from detent.report import comparison_figures, figures, print_report

    if isinstance(comparison, DriveComparison):
        assert isinstance(spec, PrintHeadSpec)  # noqa: S101 - only a print head compares drives
        figures.plot_comparison(print_report.comparison_figure(comparison, spec), path)
    elif isinstance(comparison, NoiseComparison):
        comparison_figures.plot_noise(comparison, path)
    elif isinstance(comparison, HoldComparison):
        comparison_figures.plot_hold(comparison, path)
    else:
        comparison_figures.plot_feedback(comparison, path)


def comparison_table(spec: AnySpec, comparison: AnyComparison) -> Table:
    """One comparison as a table for the terminal."""
    if isinstance(comparison, DriveComparison):
        assert isinstance(spec, PrintHeadSpec)  # noqa: S101 - see above
        return _drive_table(spec, comparison)
    if isinstance(comparison, NoiseComparison):
        return _noise_table(comparison)
    if isinstance(comparison, HoldComparison):
        return _hold_table(comparison)
    return _feedback_table(comparison)


def _drive_table(spec: PrintHeadSpec, found: DriveComparison) -> Table:
    from detent.report.print_report import drift_text

    rows = [
        (f"{speed / 0.0254:.4g} in/s", *(f"{right:+.1%} / {left:+.1%}" for right, left in found.errors[:, k, :]))
        for k, speed in enumerate(found.speeds)
    ]
    return f"Steady speed error, right / left ({drift_text(spec)})", ("speed", *found.methods), rows


def _noise_table(found: NoiseComparison) -> Table:
    heads = ("pulses put in", "this servo, + pulses", "- pulses", "incremental servo, + pulses", "- pulses")
    rows = [
        (str(n), *(_range(rest[k, sign]) for rest in (found.absolute, found.incremental) for sign in (0, 1)))
        for k, n in enumerate(found.pulses)
    ]
    title = (
        f"Where a move of {found.pitches} pitches ends, in steps of {format_quantity(found.step, 'm')} from its target "
        f"(right / left; a pitch off from {found.margin} pulses on)"
    )
    return title, heads, rows


def _range(pair: Any) -> str:
    """Right and left, as whole numbers where they are far, else with two digits."""
    return " / ".join(f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.2f}" for value in pair)


def _hold_table(found: HoldComparison) -> Table:
    rows: list[tuple[str, ...]] = []
    for case in (*found.still, *found.loaded):
        late = case.t > case.t[-1] - 0.1
        last = case.displacement[late]
        rows.append((case.name, f"{last.max() - last.min():.2f}", f"{last.mean():+.2f}", f"{case.integral[-1]:g}"))
    return "Standing still, last 0.1 s, in steps", ("servo", "peak to peak", "mean displacement", "integral"), rows


def _feedback_table(found: FeedbackComparison) -> Table:
    heads = (
        "speed feedback", "window", "B", "A", "KV", "std of speed word", "std of E", "force ripple", "stop overshoot",
        "gain margin",
    )  # fmt: skip
    rows = [
        (
            case.name,
            format_quantity(case.sample_period, "s"),
            str(case.scale),
            "none" if case.coefficient == 1 else f"{case.coefficient:g}",
            f"{case.kv:.0f}/s",
            f"{case.std_speed:.3g}",
            f"{case.std_error:.3g}",
            format_quantity(case.force_ripple, "N", 3),
            "does not settle" if not case.stable else f"{case.stop_overshoot:.0f} pulses",
            f"{case.gain_margin:.2f}",
        )
        for case in found.cases
    ]
    return f"At {found.rate:g} pulses/s", heads, rows
