"""Each method held against the ways it was made to better."""

from detent.axisfile.methods import AnySpec
from detent.axisfile.phase_servo.schema import PhaseServoSpec
from detent.axisfile.print_head.schema import PrintHeadSpec
from detent.simulation.drive_comparison import DriveComparison, compare_drives
from detent.simulation.feedback_comparison import FeedbackComparison, compare_feedback
from detent.simulation.hold_comparison import HoldComparison, compare_hold
from detent.simulation.noise_comparison import NoiseComparison, compare_noise
from detent.simulation.print_run import Progress

AnyComparison = DriveComparison | NoiseComparison | HoldComparison | FeedbackComparison


def compare_methods(spec: AnySpec, progress: Progress | None = None) -> tuple[AnyComparison, ...]:
    """Compare a method with its alternatives on the axis of `spec`.

    Returns
    -------
    tuple
        Print head: `DriveComparison`. Phase servo: `NoiseComparison`, `HoldComparison`. Filtered servo:
        `FeedbackComparison`.

    Raises
    ------
    DetentError
        The axis cannot be compared, and why.
    AxisError
        The axis failed on the way.
    """
    if isinstance(spec, PrintHeadSpec):
        return (compare_drives(spec),)
    if isinstance(spec, PhaseServoSpec):
        return compare_noise(spec, progress=progress), compare_hold(spec)
    return (compare_feedback(spec, progress=progress),)
