"""What each control method shows: the report of a run, its summary, the comparison with its alternatives."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from detent.methods.cascade.comparison import ProfileComparison
from detent.methods.cascade.replay import ReplayRun
from detent.methods.cascade.run import CascadeRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.compared import AnyComparison
from detent.methods.moves.run import MoveRun, ServoSpec
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head.comparison import DriveComparison
from detent.methods.print_head.run import PrintRun
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.registry import AnySpec
from detent.methods.rotary_table.comparison import AngleComparison
from detent.methods.rotary_table.run import SequenceRun
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.simulated import AnyResult
from detent.methods.stepper_envelope.comparison import JerkComparison, StepComparison
from detent.methods.stepper_envelope.run import StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.page.figure import Figure
from detent.page.frame import Comparison as PageComparison
from detent.page.frame import Page as FramePage
from detent.page.page import Page
from detent.page.table import TextTable
from detent.record.trace import Trace

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Title, heads and rows."""

Comparisons = tuple[AnyComparison, ...]
C = TypeVar("C")


def summary_rows(spec: AnySpec, result: AnyResult) -> list[tuple[str, str]]:
    """The figures of a run that a person wants first."""
    if isinstance(result, PrintRun):
        from detent.methods.print_head.summary import summary_rows as print_summary_rows

        return print_summary_rows(result)
    if isinstance(spec, RotaryTableSpec) and isinstance(result, SequenceRun):
        from detent.methods.rotary_table.summary import sequence_summary_rows

        return sequence_summary_rows(spec, result)
    if isinstance(spec, StepperEnvelopeSpec) and isinstance(result, StageRun):
        from detent.methods.stepper_envelope.summary import stage_summary_rows

        return stage_summary_rows(spec, result)
    if isinstance(spec, CascadeSpec):
        return _cascade_summary(spec, result)
    return _servo_summary(*_servo(spec, result))


def _servo_summary(spec: ServoSpec, run: MoveRun) -> list[tuple[str, str]]:
    from detent.methods.filtered_servo.page import filtered_summary
    from detent.methods.phase_servo.page import phase_summary

    return phase_summary(spec, run) if isinstance(spec, PhaseServoSpec) else filtered_summary(spec, run)


def _cascade_summary(spec: CascadeSpec, result: AnyResult) -> list[tuple[str, str]]:
    from detent.methods.cascade.report import cascade_summary_rows, replay_summary_rows

    if isinstance(result, ReplayRun):
        return replay_summary_rows(spec, result)
    assert isinstance(result, CascadeRun)  # noqa: S101 - a cascade axis makes no other run
    return cascade_summary_rows(spec, result)


def _servo(spec: AnySpec, result: AnyResult) -> tuple[ServoSpec, MoveRun]:
    """A run of moves with its axis, which no other axis makes."""
    assert isinstance(result, MoveRun)  # noqa: S101
    assert not isinstance(spec, PrintHeadSpec | RotaryTableSpec | StepperEnvelopeSpec | CascadeSpec)  # noqa: S101
    return spec, result


def report_of(
    spec: AnySpec, result: AnyResult, trace: Trace | None, comparisons: Comparisons, settings: dict[str, str]
) -> Page | FramePage:
    """The report of a run."""
    if isinstance(spec, PrintHeadSpec) and isinstance(result, PrintRun):
        from detent.methods.print_head.page import make_print_page
        from detent.methods.print_head.report import print_report

        page = print_report(spec, result, trace, settings={"fidelity": spec.axis.fidelity} | settings)
        return make_print_page(page)
    if isinstance(spec, RotaryTableSpec) and isinstance(result, SequenceRun):
        from detent.methods.rotary_table.page import make_table_page
        from detent.methods.rotary_table.report import sequence_report

        table = sequence_report(spec, result, trace, comparison=_first(comparisons, AngleComparison), settings=settings)
        return make_table_page(table)
    if isinstance(spec, StepperEnvelopeSpec) and isinstance(result, StageRun):
        return _stage_report(spec, result, trace, comparisons, settings)
    if isinstance(spec, CascadeSpec):
        return _cascade_report(spec, result, trace, comparisons, settings)
    return _servo_report(*_servo(spec, result), trace, comparisons, settings)


def _cascade_report(
    spec: CascadeSpec, result: AnyResult, trace: Trace | None, comparisons: Comparisons, settings: dict[str, str]
) -> Page:
    from detent.methods.cascade.page import make_cascade_page
    from detent.methods.cascade.replay_page import make_replay_page
    from detent.methods.cascade.report import cascade_report, replay_report

    if isinstance(result, ReplayRun):
        replay = replay_report(spec, result, settings=settings)
        return make_replay_page(replay)
    assert isinstance(result, CascadeRun)  # noqa: S101 - see above
    found = _first(comparisons, ProfileComparison)
    data = cascade_report(spec, result, trace, comparison=found, settings=settings)
    return make_cascade_page(data)


def _stage_report(
    spec: StepperEnvelopeSpec,
    result: StageRun,
    trace: Trace | None,
    comparisons: Comparisons,
    settings: dict[str, str],
) -> Page:
    from detent.methods.stepper_envelope.page import make_stage_page
    from detent.methods.stepper_envelope.report import stage_report

    steps = tuple(found for found in comparisons if isinstance(found, StepComparison))
    data = stage_report(spec, result, trace, steps=steps, jerk=_first(comparisons, JerkComparison), settings=settings)
    return make_stage_page(data)


def _servo_report(
    spec: ServoSpec, result: MoveRun, trace: Trace | None, comparisons: Any, settings: dict[str, str]
) -> FramePage:
    from detent.methods.filtered_servo.page import filtered_page
    from detent.methods.phase_servo.page import phase_page

    if isinstance(spec, PhaseServoSpec):
        return phase_page(spec, result, trace, comparisons, settings)
    return filtered_page(spec, result, trace, comparisons, settings)


def _first(found: Sequence[object], kind: type[C]) -> C | None:
    """The comparison of a kind, if there is one."""
    return next((one for one in found if isinstance(one, kind)), None)


@dataclass(frozen=True, slots=True)
class _TableOnly:
    """A comparison that does not draw its figures itself yet."""

    table: TextTable

    def figures(self) -> tuple[Figure, ...]:
        return ()


def comparison_of(spec: AnySpec, comparison: Any) -> PageComparison:
    """A comparison as page and terminal show it."""
    return comparison if hasattr(comparison, "figures") else _TableOnly(TextTable(*comparison_table(spec, comparison)))


def plot_comparison_of(spec: AnySpec, comparison: Any, path: Path) -> None:
    """Draw one comparison into a PNG, SVG or PDF file."""
    if hasattr(comparison, "figures"):
        from detent.page.draw import draw_figures

        draw_figures(comparison.figures(), path)
        return
    if isinstance(comparison, DriveComparison):
        from detent.methods.print_head import report as print_report
        from detent.page import plots as figures

        assert isinstance(spec, PrintHeadSpec)  # noqa: S101 - only a print head compares drives
        figures.plot_comparison(print_report.comparison_figure(comparison, spec), path)
        return
    _plotter(comparison)(comparison, path)


def _plotter(comparison: AnyComparison) -> Callable[[Any, Path], None]:
    """What draws a comparison."""
    from detent.methods.cascade import comparison_section as cascade_comparisons
    from detent.methods.rotary_table import comparison_section as table_comparisons
    from detent.methods.stepper_envelope import stage_figures

    plotters: dict[type, Callable[[Any, Path], None]] = {
        AngleComparison: table_comparisons.plot_angle,
        StepComparison: stage_figures.plot_steps,
        JerkComparison: stage_figures.plot_jerk,
        ProfileComparison: cascade_comparisons.plot_profiles,
    }
    return plotters[type(comparison)]


def comparison_table(spec: AnySpec, comparison: AnyComparison) -> Table:
    """One comparison as a table for the terminal."""
    if isinstance(comparison, DriveComparison):
        assert isinstance(spec, PrintHeadSpec)  # noqa: S101 - see above
        return _drive_table(spec, comparison)
    from detent.methods.cascade import comparison_section as cascade_comparisons
    from detent.methods.rotary_table import comparison_section as table_comparisons
    from detent.methods.stepper_envelope import stage_figures

    tables: dict[type, Callable[[Any], Table]] = {
        AngleComparison: table_comparisons.angle_table,
        StepComparison: stage_figures.steps_table,
        JerkComparison: stage_figures.jerk_table,
        ProfileComparison: cascade_comparisons.profiles_table,
    }
    return tables[type(comparison)](comparison)


def _drive_table(spec: PrintHeadSpec, found: DriveComparison) -> Table:
    from detent.methods.print_head.report import drift_text

    rows = [
        (f"{speed / 0.0254:.4g} in/s", *(f"{right:+.1%} / {left:+.1%}" for right, left in found.errors[:, k, :]))
        for k, speed in enumerate(found.speeds)
    ]
    return f"Steady speed error, right / left ({drift_text(spec)})", ("speed", *found.methods), rows
