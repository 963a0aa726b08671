"""Each method held against the ways it was made to better."""

from detent.methods.cascade.comparison import ProfileComparison, compare_profiles
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.filtered_servo.comparison import FeedbackComparison, compare_feedback
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.phase_servo.hold_comparison import HoldComparison, compare_hold
from detent.methods.phase_servo.noise_comparison import NoiseComparison, compare_noise
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head.comparison import DriveComparison, compare_drives
from detent.methods.print_head.run import Progress
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.registry import AnySpec
from detent.methods.rotary_table.comparison import AngleComparison, compare_angle
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.stepper_envelope.comparison import JerkComparison, StepComparison, compare_jerk, compare_steps

AnyComparison = (
    DriveComparison
    | NoiseComparison
    | HoldComparison
    | FeedbackComparison
    | AngleComparison
    | StepComparison
    | JerkComparison
    | ProfileComparison
)


def compare_methods(spec: AnySpec, progress: Progress | None = None) -> tuple[AnyComparison, ...]:
    """Compare a method with its alternatives on the axis of `spec`.

    Returns
    -------
    tuple
        Print head: `DriveComparison`. Phase servo: `NoiseComparison`, `HoldComparison`. Filtered servo:
        `FeedbackComparison`. Rotary table: `AngleComparison`. Steppers: a `StepComparison` per motor, and the
        `JerkComparison` of the first. Cascade: `ProfileComparison`.

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
    if isinstance(spec, FilteredServoSpec):
        return (compare_feedback(spec, progress=progress),)
    if isinstance(spec, RotaryTableSpec):
        return (compare_angle(spec, progress=progress),)
    if isinstance(spec, CascadeSpec):
        return (compare_profiles(spec, progress=progress),)
    return (*compare_steps(spec, progress=progress), compare_jerk(spec))
