"""Energy of each plant over long runs: what goes in, what is lost, what is held; and what a plant left alone holds.

The loops are compiled, so that ten million ticks take a second. Integrals over a tick are those of its exact solution:
a value that runs as a parabola has the square ``mean^2 + d^2 / 3 + e^2 / 5``, with d half the change and e what the
mean of both ends is above that of the tick.
"""

from typing import Any

from detent.kernel.elementary import sin
from detent.kernel.step import step
from detent.plant.drive_train import DriveTrain, DriveTrainParams, fill_period, move_averaged
from detent.plant.rotary_motor import RotaryMotor, RotaryMotorParams, fill_motor, rotate
from detent.plant.stepper_rotor import StepperRotor, hold_field, turn_rotor
from detent.plant.two_mass import TwoMass, stand_masses
from detent.plant.two_mass_motion import move_masses
from tests.property.test_drive_train import machine as train_machine
from tests.stepper_rig import rotor_params
from tests.two_mass_rig import coupled

LONG = 10_000_000  # ticks
PLANTS = (
    *(f"carriage, {how}" for how in ("lossless", "shorted", "with friction")),
    *(f"motor and load, {how}" for how in ("lossless", "damped", "lossless, with backlash")),
    *(f"{what}, {how}" for what in ("motor of a table", "rotor of a stepper") for how in ("lossless", "damped")),
)
Account = tuple[float, float, float]  # energy put in, lost, and held at the end [J]
Alone = tuple[float, float, float]  # energy held at first, the most that was held since, and at the end [J]


@step
def square_mean(first: float, last: float, mean: float) -> float:
    """Mean of the square of what runs as a parabola."""
    d, e = 0.5 * (last - first), 0.5 * (first + last) - mean
    return mean * mean + d * d / 3.0 + e * e / 5.0


# ---- carriage of print head, phase servo and filtered servo


@step
def train_energy(p: Any, r: Any) -> float:
    """Magnetic and kinetic energy."""
    return 0.5 * p.inductance * r.current * r.current + 0.5 * p.mass * r.velocity * r.velocity


@step
def train_driven(p: Any, r: Any, ticks: int, voltage: float, half: int) -> Account:
    """To and fro at a voltage that is reversed every so many ticks."""
    put_in, lost, h = 0.0, 0.0, p.period
    for k in range(ticks):
        u = voltage if k // half % 2 == 0 else -voltage
        i, v, x = r.current, r.velocity, r.position
        move_averaged(p, r, u, u)
        way = r.position - x
        charge = (u * h - p.emf_constant * way - p.inductance * (r.current - i)) / p.resistance
        dry = p.friction.coulomb_right if way > 0.0 else p.friction.coulomb_left
        put_in += u * charge
        lost += p.resistance * h * square_mean(i, r.current, charge / h)
        lost += p.friction.viscous_right * h * square_mean(v, r.velocity, way / h) + dry * abs(way)
    return put_in, lost, train_energy(p, r)


@step
def train_alone(p: Any, r: Any, ticks: int) -> Alone:
    """With its winding shorted."""
    first, most = train_energy(p, r), 0.0
    for _ in range(ticks):
        move_averaged(p, r, 0.0, 0.0)
        most = max(most, train_energy(p, r))
    return first, most, train_energy(p, r)


def carriage(**changes: float) -> DriveTrainParams:
    """The default carriage with viscous friction; friction and winding may be taken away."""
    p = train_machine(2.0)[0].copy()
    p.left_end, p.right_end = -1e9, 1e9
    for name, value in changes.items():
        block, _, own = name.rpartition("_of_")
        setattr(getattr(p, own) if block else p, block or name, value)
    fill_period(p)
    return p


NO_FRICTION = {
    f"{kind}_{way}_of_friction": 0.0 for kind in ("coulomb", "static", "viscous") for way in ("right", "left")
}


# ---- motor and load of the cascade axis


@step
def masses_energy(p: Any, r: Any) -> float:
    """Kinetic energy and strain."""
    strain = max(abs(r.motor.position - r.load.position) - p.half_gap, 0.0)
    kinetic = p.motor.mass * r.motor.velocity * r.motor.velocity + p.load.mass * r.load.velocity * r.load.velocity
    return 0.5 * (kinetic + p.stiffness * strain * strain)


@step
def masses_driven(p: Any, r: Any, ticks: int, force: float, half: int, viscous: float) -> Account:
    """To and fro by a force on the motor that is reversed every so many ticks; both masses have viscous friction."""
    put_in, lost, h = 0.0, 0.0, p.period
    for k in range(ticks):
        r.effort = force if k // half % 2 == 0 else -force
        x, v, y, w = r.motor.position, r.motor.velocity, r.load.position, r.load.velocity
        move_masses(p, r)
        way, other = r.motor.position - x, r.load.position - y
        put_in += r.effort * way
        slip = square_mean(v - w, r.motor.velocity - r.load.velocity, (way - other) / h)
        drag = square_mean(v, r.motor.velocity, way / h) + square_mean(w, r.load.velocity, other / h)
        lost += h * (p.damping * slip + viscous * drag)
    return put_in, lost, masses_energy(p, r)


@step
def masses_alone(p: Any, r: Any, ticks: int) -> Alone:
    """Without an effort."""
    first, most = masses_energy(p, r), 0.0
    for _ in range(ticks):
        move_masses(p, r)
        most = max(most, masses_energy(p, r))
    return first, most, masses_energy(p, r)


# ---- motor of the rotary table


@step
def motor_driven(p: Any, r: Any, ticks: int, torque: float, half: int) -> Account:
    """To and fro by a torque that is reversed every so many ticks."""
    put_in, lost, h = 0.0, 0.0, p.period
    for k in range(ticks):
        t = torque if k // half % 2 == 0 else -torque
        v = r.velocity
        way = rotate(p, r, t, False)
        put_in += t * way
        lost += p.viscous * h * square_mean(v, r.velocity, way / h) + p.coulomb * abs(way)
    return put_in, lost, 0.5 * p.inertia * r.velocity * r.velocity


@step
def motor_alone(p: Any, r: Any, ticks: int) -> Alone:
    """Without a torque."""
    first, most = 0.5 * p.inertia * r.velocity * r.velocity, 0.0
    for _ in range(ticks):
        rotate(p, r, 0.0, False)
        most = max(most, 0.5 * p.inertia * r.velocity * r.velocity)
    return first, most, 0.5 * p.inertia * r.velocity * r.velocity


# ---- rotor of the stepper


@step
def rotor_energy(p: Any, r: Any) -> float:
    """Kinetic energy, and that of the field."""
    half = sin(0.5 * p.teeth * (r.commanded * p.step_angle - r.angle))
    return 0.5 * p.inertia * r.velocity * r.velocity + 2.0 * p.torque / p.teeth * half * half


@step
def rotor_alone(p: Any, r: Any, ticks: int, first: int) -> Alone:
    """Swinging about its step: the most in the first ticks, the most since, and at the end."""
    early, most = 0.0, 0.0
    for k in range(ticks):
        turn_rotor(p, r)
        held = rotor_energy(p, r)
        if k < first:
            early = max(early, held)
        else:
            most = max(most, held)
    return early, most, rotor_energy(p, r)


def imbalance(account: Account, before: float = 0.0) -> float:
    """What is missing of the energy put in, as a share of it."""
    put_in, lost, held = account
    return (put_in + before - lost - held) / put_in


def driven() -> dict[str, float]:
    """Imbalance of each plant over the long run, as a share of the energy put in."""
    p = carriage()
    train = imbalance(train_driven(p, DriveTrain(), LONG, 30.0, 12_500))
    q = coupled()
    for mass in (q.motor, q.load):
        for way in (mass.friction.positive, mass.friction.negative):
            way.viscous = 3.0
    r = TwoMass()
    stand_masses(r, 0.0)
    masses = imbalance(masses_driven(q, r, LONG, 6.0, 2_500, 3.0))
    m = RotaryMotorParams(inertia=1e-3, viscous=2e-3, coulomb=0.05, static=0.06, period=1e-4)
    fill_motor(m, 0.0)
    motor = imbalance(motor_driven(m, RotaryMotor(), LONG, 0.4, 5_000))
    return {"carriage": train, "motor and load": masses, "motor of a table": motor}


def alone() -> dict[str, Alone]:
    """What each plant holds that is left alone, for the long run; without friction, and with little."""
    found: dict[str, Alone] = {}
    for name, changes in (("lossless", {"resistance": 0.0}), ("shorted", {"resistance": 1e-3})):
        p = carriage(**NO_FRICTION, **changes)
        found[f"carriage, {name}"] = train_alone(p, DriveTrain(current=1.0, velocity=0.5), LONG)
    found["carriage, with friction"] = train_alone(carriage(), DriveTrain(current=1.0, velocity=0.5), LONG)
    for name, changes in (
        ("lossless", {"damping": 0.0}), ("damped", {}), ("lossless, with backlash", {"damping": 0.0, "half_gap": 1e-4}),
    ):  # fmt: skip
        r = TwoMass()
        stand_masses(r, 0.0)
        r.motor.velocity, r.load.velocity = 0.05, -0.02
        found[f"motor and load, {name}"] = masses_alone(coupled(period=2e-5, **changes), r, LONG)
    for name, viscous in (("lossless", 0.0), ("damped", 1e-6)):
        m = RotaryMotorParams(inertia=1e-3, viscous=viscous, period=1e-4)
        fill_motor(m, 0.0)
        found[f"motor of a table, {name}"] = motor_alone(m, RotaryMotor(velocity=3.0), LONG)
    for name, share in (("lossless", 0.0), ("damped", 1e-4)):
        q = rotor_params()
        q.friction, q.damping = 0.0, q.damping * share
        s = StepperRotor(angle=0.4 * q.step_angle)
        hold_field(s)
        found[f"rotor of a stepper, {name}"] = rotor_alone(q, s, LONG, LONG // 10)
    return found
