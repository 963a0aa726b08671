"""Random motors, loads and ramps for which the rotor rig is promised to lose no step.

The tables and the rule hold for any ramp. That the rotor loses no step is promised inside a margin, in which every
motor here is drawn. The rig's torque at standstill is the holding torque; at a frequency it is T(f), less in the
proportion in which the pull-out torque is less than at standstill. The margin, with the defaults of specification 7.1
in brackets:

- friction at most 1/10 of the holding torque (1/10);
- start frequency at most 1.46 times the natural frequency of rotor and field (400 Hz to 274 Hz: 1.46), and before it
  turns, or starts again, the motor stands for a period of the start frequency (as long); at most 0.73 times where it
  does not wait, for to and fro by single steps would swing the rotor up;
- up to 1.46 times the natural frequency, where a rotor swings, T(f) at least 0.9 of the holding torque (0.95);
- friction and twice the torque that accelerates, from each entry of the ramp to the next, together at most 0.45 T(f)
  at the faster of the two (0.44). Twice, because the limit of a zone may lie between two entries of the ramp: from
  there to the entry above the next it is almost two ramp steps in one;
- the clock of a timer that takes reload values at least 100 times the largest frequency (250 times).
"""

import math
from dataclasses import dataclass

import numpy as np
from tests.property.numbered_cases import chance, log_uniform, whole
from tests.stepper_rig import MOTOR, START_HZ, Load

from detent.planning.step_ramp import (
    FIRST_HARMONIC,
    FirstOrderPullOut,
    MeasuredPullOut,
    PullOut,
    StepperMotor,
    StepRamp,
    WindingPullOut,
    make_ramp,
)

FRICTION = 0.1
"""Friction, as a part of the holding torque."""
START = START_HZ / MOTOR.natural_hz
"""Start frequency, as a multiple of the natural frequency."""
AT_START = 0.9
"""Torque at the highest start frequency, as a part of that at standstill."""
USED = 0.45
"""Torque that friction and twice the acceleration take, as a part of what there is."""
RELOAD_TICKS = 100
"""Ticks of a timer with reload values in the shortest period."""
LONGEST_RAMP = 400


@dataclass(frozen=True)
class Axis:
    """A motor inside the margin, and its ramp."""

    motor: StepperMotor
    ramp: StepRamp
    natural_hz: float
    max_hz: float

    @property
    def must_wait(self) -> bool:
        """Whether a reversal needs its waiting time."""
        return float(self.ramp.hz[0]) > START / 2 * self.natural_hz


def draw_first_order(rng: np.random.Generator, natural: float, _teeth: float) -> tuple[PullOut, float]:
    """The specification's form; with it the holding torque [N m]."""
    torque = log_uniform(rng, 0.01, 10.0)
    return FirstOrderPullOut(torque, log_uniform(rng, 2.5, 30.0) * natural), torque / rng.uniform(0.3, 0.95)


def draw_winding(rng: np.random.Generator, natural: float, teeth: float) -> tuple[PullOut, float]:
    """A winding on a chopper, or on a voltage that never reaches the current that is set."""
    rated = log_uniform(rng, 0.3, 8.0)
    current, resistance = rated * rng.uniform(0.4, 1.0), log_uniform(rng, 0.2, 20.0)
    supply = current * resistance * log_uniform(rng, 0.7, 12.0)
    corner = log_uniform(rng, 2.0, 15.0) * natural
    inductance = math.sqrt(max((supply / current) ** 2 - resistance**2, resistance**2)) / (2 * math.pi * corner / 4)
    pull_out = WindingPullOut(log_uniform(rng, 0.01, 10.0), rated, current, supply, resistance, inductance, teeth)
    # Both phases on in full make sqrt 2 times the torque of one, and a square wave 4/pi times a sine.
    return pull_out, pull_out(0.0) * math.sqrt(2) / FIRST_HARMONIC


def draw_measured(rng: np.random.Generator, natural: float, _teeth: float) -> tuple[PullOut, float]:
    """Points of a curve that falls, with a dip now and then, to nothing or to where it was measured last."""
    torque = log_uniform(rng, 0.01, 10.0)
    points = whole(rng, 2, 8)
    hz = natural * (rng.uniform(0.2, 2.0) + np.cumsum(rng.uniform(0.2, 4.0, points)))
    parts = np.minimum(np.cumprod(rng.uniform(0.45, 1.05, points)), 1.0)
    parts[0] = 1.0
    if chance(rng, 0.3):
        parts[-1] = 0.0
    return MeasuredPullOut(hz.tolist(), (torque * parts).tolist()), torque / rng.uniform(0.3, 0.95)


FORMS = (draw_first_order, draw_winding, draw_measured)


def draw_motor(rng: np.random.Generator) -> tuple[StepperMotor, float]:
    """Motor with its load, and their natural frequency [Hz]."""
    natural = log_uniform(rng, 250.0, 1200.0) if chance(rng, 0.9) else log_uniform(rng, 60.0, 250.0)
    steps = (48, 96, 100, 200, 360, 400)[whole(rng, 0, 5)]
    pull_out, torque = FORMS[whole(rng, 0, 2)](rng, natural, steps / 4)
    inertia = steps / 4 * torque / (2 * math.pi * natural) ** 2
    rotor = inertia / (1 + log_uniform(rng, 0.01, 10.0))
    share, pitch = rng.random(), log_uniform(rng, 5e-4, 2e-2)
    load = Load(
        pitch=pitch,
        mass=(inertia - rotor) * share / (pitch / (2 * math.pi)) ** 2,
        spindle_inertia=(inertia - rotor) * (1 - share),
        coupling_inertia=0.0,
        friction_torque=0.0 if chance(rng, 0.1) else rng.uniform(0.0, FRICTION) * torque,
    )
    return StepperMotor(steps, rotor, torque, pull_out, natural, **load.of_motor), natural


def is_inside_margin(motor: StepperMotor, ramp: StepRamp) -> bool:
    """Whether the rotor is promised to follow this ramp."""
    inertia, friction, natural = motor.inertia, motor.friction_torque, motor.natural_hz
    torque = np.array([motor.pull_out(float(hz)) for hz in ramp.hz]) * motor.holding_torque / motor.pull_out(0.0)
    taken = friction + inertia * motor.step_angle * np.diff(ramp.hz**2, append=ramp.hz[-1] ** 2)
    return bool(
        friction <= FRICTION * motor.holding_torque * (1 + 1e-12)
        and ramp.hz[0] <= START * natural * (1 + 1e-12)
        and min(motor.pull_out(hz) for hz in (float(ramp.hz[0]), START * natural)) >= AT_START * motor.pull_out(0.0)
        and (taken <= USED * np.append(torque[1:], torque[-1])).all()
    )


def spare_acceleration(motor: StepperMotor, hz: float) -> float:
    """What the margin leaves at a frequency to accelerate with [step/s^2]."""
    torque = motor.pull_out(hz) / motor.pull_out(0.0) * motor.holding_torque
    return (USED * torque - motor.friction_torque) / 2 / (motor.inertia * motor.step_angle)


def draw_share(rng: np.random.Generator) -> float:
    """Part of the acceleration that the margin leaves at the top: often all of it.

    With more than all only a ramp that the falling torque bends stays inside the margin.
    """
    kind = rng.random()
    return 1.0 if kind < 0.25 else log_uniform(rng, 0.01, 1.0) if kind < 0.85 else log_uniform(rng, 1.0, 5.0)


def draw_axis(rng: np.random.Generator) -> Axis:
    """Draw until a ramp lies inside the margin and is of a length that a test has time for."""
    while True:
        motor, natural = draw_motor(rng)
        start = natural * (START if chance(rng, 0.3) else rng.uniform(0.3, START))
        top = start * log_uniform(rng, 1.0 if chance(rng, 0.1) else 2.0, 20.0)
        steepest = spare_acceleration(motor, top) * draw_share(rng)
        if not steepest * 2 * LONGEST_RAMP > top**2 - start**2:
            continue
        acceleration = motor.acceleration_limit(steepest, rng.uniform(1.5, 5.0))
        if acceleration(start) > 0:
            ramp = make_ramp(start, top, acceleration)
            if len(ramp) <= 2 * LONGEST_RAMP and is_inside_margin(motor, ramp):
                return Axis(motor, ramp, natural, top)
