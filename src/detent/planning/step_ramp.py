"""What an open-loop stepper can do: its pull-out torque, and its ramp list (stepper-envelope specification 3.1).

A stepper has no sensor: a step that the rotor does not follow is lost for good. Pull-out torque is the most a motor
that is in step can drive without falling out of it. It falls with the step frequency, because coil current rises at a
limited rate and the rotor's own voltage opposes it. Part of it accelerates the inertia. From this follow the frequency
at which the motor starts and stops directly, and the frequency that each further step may have: the ramp list.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

LEAST_GAIN_HZ = 0.5  # a ramp ends where a step gains less than this: the torque left over is used up
MAX_HZ = 65535  # largest frequency in a 16-bit word
FIRST_HARMONIC = 4 / pi  # fundamental of a square wave of amplitude 1: full steps switch each coil so
PullOut = Callable[[float], float]  # pull-out torque [N m] at a step frequency [Hz]; 0 where the motor drives nothing


@dataclass(frozen=True, slots=True)
class FirstOrderPullOut:
    """T_po0 / sqrt(1 + (f/f_c)^2), stepper-envelope specification 3.1."""

    torque: float  # pull-out torque at standstill T_po0 [N m]
    corner_hz: float  # step frequency at which it has fallen to 1/sqrt 2 [Hz]

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        return self.torque / hypot(1.0, hz / self.corner_hz)


@dataclass(frozen=True, slots=True)
class WindingPullOut:
    """Two-phase hybrid or permanent-magnet motor on a supply of limited voltage and current.

    With the rotor's linked flux times teeth ``k = T_hold / (sqrt 2 I_rated)``, the electrical frequency
    ``w = 2 pi f / 4`` and ``Z = sqrt(R^2 + (w L)^2)``, a voltage drive pulls out at ``k (V / Z - w psi R / Z^2)``
    (P. Acarnley, Stepping Motors, 4th ed., IEE 2002, chapter 5), V the fundamental of the square wave and psi the flux.
    A chopper holds the current, and with it the torque, to ``k I`` below the frequency where the voltage no longer
    reaches it. Measured curves lie below this by the ripple and the resonances of a real drive: that is what the
    safety factor of the ramp is for.
    """

    holding_torque: float  # both phases at the rated current [N m]
    rated_current: float  # and current: rated, and set at the drive, per phase [A]
    current: float  # [A]
    supply: float  # voltage that drives the current [V]
    resistance: float  # winding and drive, per phase [ohm]
    inductance: float  # per phase [H]
    teeth: float  # rotor teeth, a quarter of the steps per turn

    @property
    def per_current(self) -> float:
        """Torque per current of one phase at its best angle [N m/A]."""
        return self.holding_torque / (sqrt(2) * self.rated_current)

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        omega = 2 * pi * hz / 4
        impedance = hypot(self.resistance, omega * self.inductance)
        flux = self.per_current / self.teeth
        driven = FIRST_HARMONIC * self.supply / impedance - omega * flux * self.resistance / impedance**2
        return self.per_current * max(min(FIRST_HARMONIC * self.current, driven), 0.0)


@dataclass(frozen=True, slots=True)
class MeasuredPullOut:
    """Points of a published curve, straight lines between them."""

    # step frequencies, rising [Hz]; below the first one its torque holds, above the last there is none
    hz: Sequence[float]
    torque: Sequence[float]  # pull-out torque at each [N m]

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        if hz <= self.hz[0]:
            return self.torque[0]
        for (f0, t0), (f1, t1) in pairwise(zip(self.hz, self.torque, strict=True)):
            if hz <= f1:
                return t0 + (t1 - t0) * (hz - f0) / (f1 - f0)
        return 0.0


@dataclass(frozen=True, slots=True)
class MicrosteppedPullOut:
    """Curve of full steps for a drive that makes each of several pulses: the field turns as fast as with full steps."""

    whole: PullOut
    microsteps: int  # pulses of a full step

    def __call__(self, hz: float) -> float:
        """Pull-out torque at a pulse frequency of `hz` [N m]."""
        return self.whole(hz / self.microsteps)


def natural_frequency(steps_per_turn: int, holding_torque: float, inertia: float) -> float:
    """Frequency at which a rotor swings about a step: sqrt(teeth T_hold / J) / 2 pi, teeth a quarter of the steps."""
    return sqrt(steps_per_turn / 4 * holding_torque / inertia) / (2 * pi)


@dataclass(frozen=True, slots=True)
class StepperMotor:
    """What a stepper can do with its load."""

    steps_per_turn: int  # full ones: 200 for 1.8 degrees, 96 for 3.75 degrees, 360 for 1 degree
    rotor_inertia: float  # [kg m^2]
    holding_torque: float  # peak of the static torque curve [N m]
    pull_out: PullOut
    unloaded_start_hz: float  # start frequency of the bare rotor on full steps [Hz]
    load_inertia: float  # all that turns with the rotor, the moved mass included [kg m^2]
    friction_torque: float  # Coulomb friction at the shaft [N m]
    microsteps: int = 1  # pulses of a full step; frequencies and angles below are those of pulses

    @property
    def step_angle(self) -> float:
        """Angle of one step, or microstep [rad]."""
        return 2 * pi / (self.steps_per_turn * self.microsteps)

    @property
    def incremental_torque(self) -> float:
        """Torque that a rotor at rest feels when the field goes on by one pulse: T_hold sin(90 deg / N) [N m]."""
        return self.holding_torque * sin(pi / 2 / self.microsteps)

    @property
    def swinging_hz(self) -> float:
        """Pulse frequency at which the full steps come in time with the swing of the rotor [Hz]."""
        return self.natural_hz * self.microsteps

    @property
    def inertia(self) -> float:
        """Inertia that the motor accelerates, its own rotor included [kg m^2]."""
        return self.rotor_inertia + self.load_inertia

    @property
    def natural_hz(self) -> float:
        """Frequency at which the loaded rotor swings about a step [Hz]."""
        return natural_frequency(self.steps_per_turn, self.holding_torque, self.inertia)

    def start_hz(self, safety: float = 2.1) -> float:
        """Frequency at which the loaded motor starts and stops without losing steps; one speed with any microsteps."""
        return self.microsteps * self.unloaded_start_hz / sqrt(1 + self.load_inertia / self.rotor_inertia) / safety

    def acceleration_limit(self, max_acceleration: float, safety: float = 2.0) -> Callable[[float], float]:
        """Acceleration that motor and load allow [step/s^2], as a function of the step frequency [Hz]."""
        per_torque = 1 / (self.inertia * self.step_angle)

        def acceleration(hz: float) -> float:
            spare = self.pull_out(hz) / safety - self.friction_torque
            return min(max_acceleration, spare * per_torque)

        return acceleration

    def needed_torque(self, hz: Numbers) -> Numbers:
        """Torque that the motor must give in each step of a run.

        Magnitude of J theta a + T_fric with a = (f_i^2 - f_(i-1)^2) / 2, 0 in the first step [N m]: the inverse of the
        ramp's rule; friction helps to brake.
        """
        acceleration = np.diff(hz**2, prepend=hz[:1] ** 2) / 2
        return np.abs(self.inertia * self.step_angle * acceleration + self.friction_torque)

    def torque_margin(self, hz: Numbers) -> Numbers:
        """Pull-out torque over the torque needed in each step of a run, shape (n,); below 1 the rotor falls behind.

        A step that needs no torque has an infinite margin.
        """
        available, needed = np.array([self.pull_out(f) for f in hz.tolist()]), self.needed_torque(hz)
        return np.divide(available, needed, out=np.full(len(hz), np.inf), where=needed > 0)


@dataclass(frozen=True, slots=True, eq=False)
class StepRamp:
    """The frequencies of a run-up from rest, one per step."""

    hz: Numbers  # strictly increasing; `hz[0]` is the frequency to start and to stop at [Hz]

    def __len__(self) -> int:
        return len(self.hz)

    @property
    def duration(self) -> float:
        """Time that the whole list takes, one period each [s]."""
        return float(np.sum(1 / self.hz))

    def index_of(self, hz: float) -> int:
        """Smallest index whose frequency reaches `hz` [Hz]; the last one where none does."""
        return min(int(np.searchsorted(self.hz, hz)), len(self.hz) - 1)

    def words(self, clock_hz: int, *, reload: bool) -> NDArray[np.int64]:
        """The list as the control unit stores it: periods of its timer [tick], or whole Hz, shape (L,)."""
        return np.rint(clock_hz / self.hz if reload else self.hz).astype(np.int64)


def make_ramp(start_hz: float, max_hz: float, acceleration: Callable[[float], float]) -> StepRamp:
    """Ramp list from the start frequency up; braking uses it backwards (friction helps, so that is the safe side).

    f^2 grows by 2 a(f) per step, with a(f) at the middle of the step. It is f^2 that is summed up: at constant
    acceleration the entries are then those of sqrt(f_start^2 + 2 a n) to the last bit, and an index found by
    comparison with a round frequency is the right one.
    """
    if not 1 <= start_hz <= max_hz <= MAX_HZ:
        raise ValueError(f"start_hz is {start_hz}, max_hz is {max_hz}, must be 1 <= start_hz <= max_hz <= {MAX_HZ}")
    found = [start_hz]
    square = start_hz * start_hz
    while found[-1] < max_hz:
        hz = found[-1]
        predicted = sqrt(max(square + 2 * acceleration(hz), 0.0))
        square += 2 * acceleration(min(max_hz, (hz + predicted) / 2))
        gained = min(max_hz, sqrt(max(square, 0.0)))
        # A measured curve may end, or the motor's own voltage take the torque away, within one step.
        spent = gained - hz < LEAST_GAIN_HZ and gained < max_hz
        if spent or acceleration(gained) < 0:
            break
        found.append(gained)
    return StepRamp(np.array(found))
