"""The drive train inside one PWM period: switch by switch, by exact piecewise solutions.

A period is a high and a low part of the PWM line, each with its own terminal voltage per sign of the current. While the
current keeps its sign, the end of the period follows from two table rows per pulse width (superposition of the low
voltage over the whole period and of the difference over the pulse). Where the current reaches zero, the parts are
integrated piece by piece up to the crossing.
"""

from detent.kernel.registers import Registers, block, f8, f8_array, register
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import (
    DriveTrain,
    DriveTrainParams,
    account,
    flow,
    friction_force,
    sense_of_motion,
    settle_contacts,
)

CLOCKS = 300
ROW = 7
"""Table row of one pulse width: end current, velocity and travel per volt of pulse; then the current at the end of the
pulse from current, velocity, voltage and force."""

CROSSING_STEPS = 6
MOST_PIECES = 4
"""Pieces of one part of the period: a current can reach zero, rest and start again; more cannot happen in 40 us."""


class SwitchedParams(Registers):
    """Pulse responses for every pulse width, moving right and moving left."""

    right: f8_array = register("pulse responses moving right, 301 rows of 7", length=(CLOCKS + 1) * ROW)
    left: f8_array = register("pulse responses moving left, 301 rows of 7", length=(CLOCKS + 1) * ROW)


class Scratch(Registers):
    """Work space of the piecewise solution."""

    volt_seconds: f8 = register("integral of the terminal voltage over the period so far", unit="V.s")
    piece: DriveTrain = block("state at the beginning of the present piece")
    trial: DriveTrain = block("state tried while a zero crossing is looked for")


@hot_step
def copy_state(source: DriveTrain, target: DriveTrain) -> None:
    """What `flow` reads and writes, and the peak current."""
    target.current = source.current
    target.velocity = source.velocity
    target.position = source.position
    target.force = source.force
    target.sense = source.sense
    target.peak_current = source.peak_current


@step
def time_of_zero(p: DriveTrainParams, r: DriveTrain, w: Scratch, u: float, duration: float) -> float:
    """Time at which the current reaches zero, known to lie within `duration` (Illinois form of the false position)."""
    early, late = 0.0, duration
    at_early, at_late = r.current, w.trial.current
    t = late
    for _ in range(CROSSING_STEPS):
        t = late - at_late * (late - early) / (at_late - at_early)
        copy_state(r, w.trial)
        flow(p, w.trial, u, True, t)
        found = w.trial.current
        if found * at_late < 0.0:
            early, at_early = late, at_late
        else:
            at_early *= 0.5
        late, at_late = t, found
        if found == 0.0 or at_late == at_early:
            break
    return t


@step
def part_of_period(
    p: DriveTrainParams, r: DriveTrain, w: Scratch, u_positive: float, u_negative: float, duration: float
) -> None:
    """One part of the period with fixed switches, split where the current reaches zero."""
    left = duration
    for _ in range(MOST_PIECES):
        if left <= 0.0:
            break
        emf = p.emf_constant * r.velocity
        positive = r.current > 0.0 or (r.current == 0.0 and u_positive > emf)
        negative = r.current < 0.0 or (r.current == 0.0 and u_negative < emf)
        if not (positive or negative):
            start = r.position
            flow(p, r, 0.0, False, left)
            w.volt_seconds += p.emf_constant * (r.position - start)
            break
        u = u_positive if positive else u_negative
        copy_state(r, w.trial)
        flow(p, w.trial, u, True, left)
        lasted = left
        crossed = (positive and w.trial.current < 0.0) or (negative and w.trial.current > 0.0)
        if crossed and r.current != 0.0:
            lasted = time_of_zero(p, r, w, u, left)
            w.trial.current = 0.0
        elif crossed:
            w.trial.current = 0.0
        r.current = w.trial.current
        r.velocity = w.trial.velocity
        r.position = w.trial.position
        w.volt_seconds += u * lasted
        left -= lasted
        r.peak_current = max(r.peak_current, abs(r.current))


@hot_step
def whole_period(
    p: DriveTrainParams, q: SwitchedParams, r: DriveTrain, w: Scratch, pulse: int, u_on: float, u_off: float
) -> bool:
    """The period by table, if the current keeps its sign throughout; False leaves the state untouched."""
    m = p.right if r.sense > 0 else p.left
    table = q.right if r.sense > 0 else q.left
    k = pulse * ROW
    force = friction_force(p, r)
    i, v, extra = r.current, r.velocity, u_on - u_off
    middle = table[k + 3] * i + table[k + 4] * v + table[k + 5] * u_on + table[k + 6] * force
    end = m.i_i * i + m.i_v * v + m.i_u * u_off + m.i_f * force + table[k] * extra
    if middle * i <= 0.0 or end * i <= 0.0:
        return False
    r.position += m.x_i * i + m.x_v * v + m.x_u * u_off + m.x_f * force + table[k + 2] * extra
    r.velocity = m.v_i * i + m.v_v * v + m.v_u * u_off + m.v_f * force + table[k + 1] * extra
    r.current = end
    r.peak_current = max(r.peak_current, abs(middle))
    w.volt_seconds = p.period * (u_off + extra * (pulse * (1.0 / CLOCKS)))
    return True


@hot_step
def move_switched(
    p: DriveTrainParams,
    q: SwitchedParams,
    r: DriveTrain,
    w: Scratch,
    pulse: int,
    on_positive: float,
    on_negative: float,
    off_positive: float,
    off_negative: float,
) -> None:
    """One tick at switch level; voltages per state of the PWM line and sign of the current."""
    sense_of_motion(p, r)
    current, position = r.current, r.position
    w.volt_seconds = 0.0
    u_on = on_positive if current > 0.0 else on_negative
    u_off = off_positive if current > 0.0 else off_negative
    if r.sense == 0:
        r.ticks_held += 1
    quiet = r.sense == 0 and current == 0.0 and on_positive <= 0.0 and on_negative >= 0.0 and pulse == CLOCKS
    quiet = quiet or (r.sense == 0 and current == 0.0 and pulse == 0 and off_positive <= 0.0 and off_negative >= 0.0)
    if not quiet and (r.sense == 0 or current == 0.0 or not whole_period(p, q, r, w, pulse, u_on, u_off)):
        on_time = p.period * (pulse * (1.0 / CLOCKS))
        copy_state(r, w.piece)
        part_of_period(p, w.piece, w, on_positive, on_negative, on_time)
        part_of_period(p, w.piece, w, off_positive, off_negative, p.period - on_time)
        copy_state(w.piece, r)
    travel = r.position - position
    charge = (w.volt_seconds - p.emf_constant * travel - p.inductance * (r.current - current)) / p.resistance
    settle_contacts(p, r)
    account(p, r, w.volt_seconds / p.period, charge / p.period)


def fill_pulse_table(p: DriveTrainParams, q: SwitchedParams) -> None:
    """Compute the pulse responses of every width from the exact solution."""
    coulomb = (p.friction.coulomb_right, p.friction.coulomb_left)
    p.friction.coulomb_right = p.friction.coulomb_left = 0.0
    for table, sense in ((q.right, 1), (q.left, -1)):
        for pulse in range(CLOCKS + 1):
            on_time = p.period * (pulse * (1.0 / CLOCKS))
            _fill_row(p, table, pulse * ROW, sense, on_time)
    p.friction.coulomb_right, p.friction.coulomb_left = coulomb


def _fill_row(p: DriveTrainParams, table: list[float], k: int, sense: int, on_time: float) -> None:
    pulsed = DriveTrain(sense=sense)
    flow(p, pulsed, 1.0, True, on_time)
    table[k + 5] = pulsed.current
    flow(p, pulsed, 0.0, True, p.period - on_time)
    table[k], table[k + 1], table[k + 2] = pulsed.current, pulsed.velocity, pulsed.position
    for place, state in ((3, DriveTrain(current=1.0)), (4, DriveTrain(velocity=1.0)), (6, DriveTrain(force=1.0))):
        state.sense = sense
        flow(p, state, 0.0, True, on_time)
        table[k + place] = state.current
