"""An axis left to itself at standstill, and the leap over the time in which it stands and only its integral grows.

While both masses are held, what the loops read does not change: after some samples every increment of the integral is
the same, and the command n samples later is known. The first sample at which friction would no longer hold is found by
asking the axis's own steps (`find_senses` at the converted command), so that a leap goes to a few samples before it,
and never through motion. Where friction would hold for an hour on end, the axis rests: with an ideal encoder an error
of a rounding would take years to become a slip.
"""

from detent.drive.effort_source import MEMORY as COMMANDS
from detent.drive.effort_source import EffortSourceParams, converted, take_command
from detent.kernel.compiled import copy_back, local_copy
from detent.kernel.loop import HostArray
from detent.kernel.registers import Registers, f8, i8, register, u1
from detent.kernel.step import step
from detent.methods.cascade.controller import CascadeController
from detent.methods.cascade.plant import CascadePlantParams
from detent.methods.cascade.system import Cascade, CascadeParams, tick
from detent.plant.dc_winding import limit_current
from detent.plant.stribeck import is_dry
from detent.plant.two_mass import TwoMass, TwoMassParams, find_senses

HALVINGS = 60
QUIET = 400  # samples without any change, beside those of what is still on its way, that are rest
REPEATS = 1e-9  # of an increment, by which two may differ and repeat all the same


class Watch(Registers):
    """What is known of an axis that is watched."""

    settled: i8 = register("samples at rest after which every increment of the integral is the same", unit="count")
    margin: i8 = register("samples left between a leap and the sample at which friction gives way", unit="count")
    leaps: u1 = register("1 while it may leap")
    longest: i8 = register("samples of standing after which an axis rests", unit="count")
    slow: f8 = register("speed below which a mass without friction stands", unit="m/s")
    sample: i8 = register("samples since the start, those leapt over with them", unit="count")
    held: i8 = register("samples in a row in which both masses have stood", unit="count")
    quiet: i8 = register("samples in a row that have changed neither a position nor the integral", unit="count")
    increment: f8 = register("of the integral in the last sample", unit="V")
    proven: u1 = register("1 once nothing will ever change")
    leapt: i8 = register("samples that were leapt over", unit="count")


@step
def stands(p: TwoMassParams, r: TwoMass, slow: float) -> bool:
    """True while friction holds both masses; one without any stands while it is `slow` [m/s]."""
    motor = r.motor.sense == 0 and r.motor.velocity == 0.0
    if p.stiffness == 0.0 or is_dry(p.load.friction):
        return motor and r.load.sense == 0 and r.load.velocity == 0.0
    return motor and abs(r.load.velocity) < slow


@step
def gives_way(p: CascadePlantParams, r: TwoMass, command: float) -> bool:
    """True where friction does not hold both masses under a command [V] that has stood for long."""
    r.effort = p.source.gain * converted(p.source, command)
    if p.machine.winding.used and p.machine.winding.inductance > 0.0:
        r.current = limit_current(p.machine.winding, r.effort / p.machine.winding.resistance)
    find_senses(p.machine, r)
    return r.motor.sense != 0 or (is_dry(p.machine.load.friction) and r.load.sense != 0)


@step
def most_command(p: CascadeParams, command: float, increment: float, samples: float) -> float:
    """Command so many samples later [V], within the limit of the law."""
    limit = p.controller.law.max_command
    return min(max(command + samples * increment, -limit), limit)


@step
def samples_left(p: CascadeParams, r: Cascade, machine: TwoMass, w: Watch) -> float:
    """Samples until friction gives way; -1 where it holds for longer than anybody waits."""
    law, held = r.controller.law, local_copy(machine)
    command, increment, early, late = law.command, w.increment, 0.0, float(w.longest)
    if not gives_way(p.plant, held, most_command(p, command, increment, late)):
        return -1.0
    for _ in range(HALVINGS):
        if late - early <= 1.0:
            break
        middle = 0.5 * (early + late)
        if gives_way(p.plant, held, most_command(p, command, increment, middle)):
            late = middle
        else:
            early = middle
    return early


@step
def refill(p: EffortSourceParams, r: Cascade, increment: float) -> None:
    """The amplifier's memory after a leap: the last commands that it would have taken."""
    for back in range(COMMANDS - 1, -1, -1):
        take_command(p, r.plant.source, r.controller.law.command - back * increment)


@step
def leap(p: CascadeParams, r: Cascade, machine: TwoMass, w: Watch) -> None:
    """Go on to shortly before friction gives way, where that is far; or see that it never will."""
    c: CascadeController = r.controller
    left = samples_left(p, r, machine, w) if w.increment != 0.0 else -1.0
    w.held = 0  # what is left until then is simulated
    if left < 0.0:
        w.proven = 1
        return
    n = int(left) - w.margin
    if not w.leaps or n < 2 * COMMANDS:
        return
    c.law.integral += n * w.increment
    c.law.command += n * w.increment
    c.samples += n
    r.tick += n * p.controller.sample_ticks
    r.lines.command = c.law.command
    refill(p.plant.source, r, w.increment)
    machine.effort = r.plant.source.output
    w.sample += n
    w.leapt += n


@step
def watch_standstill(p: CascadeParams, r: Cascade, w: Watch, rows: HostArray, *feed: HostArray) -> int:
    """Let samples pass, a row each, until the rows are full or rest is proven; how many there are.

    Columns are those of `methods.tuning.COLUMNS`, the time in samples.
    """
    machine = local_copy(r.plant.machine)
    m, n, law = machine.motor, machine.load, r.controller.law
    done = 0
    while done < rows.shape[0] and not w.proven:
        place, other = m.position, n.position
        low, high, below, above = m.position, m.position, n.position, n.position
        before, still, stuck = law.integral, True, True
        for _ in range(p.controller.sample_ticks):
            tick(p, r, machine, *feed)
            low, high = min(low, m.position), max(high, m.position)
            below, above = min(below, n.position), max(above, n.position)
            still = still and stands(p.plant.machine, machine, w.slow)
            stuck = stuck and m.sense == 0
        w.sample += 1
        rows[done, 0] = w.sample
        rows[done, 1], rows[done, 2], rows[done, 3], rows[done, 4] = low, high, below, above
        rows[done, 5], rows[done, 6], rows[done, 7] = law.position_error, law.command, law.integral
        rows[done, 8], rows[done, 9] = 1.0 if stuck else 0.0, 1.0 if law.limited else 0.0
        done += 1
        increment = law.integral - before
        repeats = abs(increment - w.increment) <= REPEATS * abs(increment)
        w.held, w.increment = w.held + 1 if still else 0, increment
        unchanged = low == place == high and below == other == above and increment == 0.0
        w.quiet = w.quiet + 1 if unchanged else 0
        if (
            w.quiet > w.settled + QUIET
        ):  # it creeps to where the drive is as strong as Coulomb friction, and never stops
            w.proven = 1
        if w.held >= w.settled and repeats:
            leap(p, r, machine, w)
    copy_back(r.plant.machine, machine)
    return done
