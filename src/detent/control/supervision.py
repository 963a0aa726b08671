"""What a controller watches around its loop: links and agreement of its encoders, limit switches, heat, swings.

It is part of the guard (`control.guard`), whose codes and first cause it shares; call it before `guard.watch`. What an
axis has not got is not watched: its parameter is 0.
"""

from detent.control.guard import Guard, GuardParams, lasting, trip
from detent.kernel.registers import Registers, i1, i4, real, register, u1
from detent.kernel.step import step

LINK_LOST, DISAGREE, SWINGS, TOO_HOT, ON_SWITCH, OPEN_WIRE = 1, 5, 14, 21, 30, 33

APART = 2  # samples in a row with encoders that disagree: one alone may hold a word that was none
MOST_SWINGS = 10  # half swings in a row that are an oscillation, and no overshoot


class SupervisionParams(Registers):
    """What there is to watch."""

    link: i4 = register("samples within which a second word that is none is a fault; 0: no checks", unit="count")
    slip: real = register("largest difference between both encoders; 0: there is one, or any", unit="m")
    switches: u1 = register("1 where limit switches are wired")
    bears: real = register("command that the motor bears for ever; 0: there is no model of its heat", unit="V")
    warming: real = register("part of a new load that its heat takes over at a sample", unit="1")
    swing: real = register("error to either side, in turn, that counts as a half swing; 0: any", unit="m")
    slowest: i4 = register("samples that one may take", unit="count")


class Supervision(Registers):
    """What has been seen."""

    left: i4 = register("samples in which another word that is none is a fault", unit="count")
    apart: i4 = register("samples in a row with encoders that disagree", unit="count")
    side: i1 = register("end on whose limit switch the axis is: -1 lower, 1 upper, 0 none", unit="code")
    heat: real = register("load of the motor, squared and smoothed, over what it bears for ever", unit="1")
    sense: i1 = register("side of the last half swing", unit="code")
    age: i4 = register("samples since it began", unit="count")
    swings: i4 = register("half swings in a row", unit="count")


@step
def watch_link(p: SupervisionParams, s: Supervision, q: GuardParams, g: Guard, lost: int) -> None:
    """A word that failed its check, or never came: one is made up for by the word before, two are a fault."""
    if p.link > 0 and lost:
        if s.left > 0:
            trip(q, g, LINK_LOST)
        s.left = p.link
    elif s.left > 0:
        s.left -= 1


@step
def watch_switches(p: SupervisionParams, s: Supervision, q: GuardParams, g: Guard, lower: int, upper: int) -> None:
    """An axis that runs onto a limit switch, whose circuit is then open, 0; both at once are a wire.

    Where somebody leads the axis, one that is enabled on a switch may come away from it.
    """
    if p.switches == 0:
        return
    if lower == 0 and upper == 0:
        trip(q, g, OPEN_WIRE)
        return
    side = -1 if lower == 0 else 1 if upper == 0 else 0
    if side not in (0, s.side) and not (g.fresh and q.softly):
        trip(q, g, ON_SWITCH)
        if g.code == ON_SWITCH:
            g.side = side
    s.side = side


@step
def watch_swings(p: SupervisionParams, s: Supervision, q: GuardParams, g: Guard, error: float) -> None:
    """A loop that swings about its demand, further than any overshoot goes on."""
    if p.swing == 0.0:
        return
    sense = 1 if error > p.swing else -1 if error < -p.swing else 0
    if g.fresh or s.age >= p.slowest:
        s.swings = s.sense = 0
    s.age = min(s.age + 1, p.slowest)
    if sense not in (0, s.sense):
        s.sense, s.age = sense, 0
        s.swings += 1
        if s.swings >= MOST_SWINGS:
            trip(q, g, SWINGS)


@step
def warm_up(p: SupervisionParams, s: Supervision, command: float) -> None:
    """Heat of the motor at the command of a sample; it cools at 0."""
    if p.bears > 0.0:
        load = command / p.bears
        s.heat += p.warming * (load * load - s.heat)


@step
def supervise(
    p: SupervisionParams, s: Supervision, q: GuardParams, g: Guard, lost: int, apart: float, lower: int,
    upper: int, error: float,
) -> None:  # fmt: skip
    """One sample.

    `lost`: 1 with a word that is none; `apart`: one encoder less the other [m]; `lower`, `upper`: 1 with the circuit
    of that limit switch closed; `error`: of the position [m].
    """
    watch_link(p, s, q, g, lost)
    s.apart = lasting(0.0 < p.slip < abs(apart), s.apart)
    if s.apart >= APART:
        trip(q, g, DISAGREE)
    watch_switches(p, s, q, g, lower, upper)
    if p.bears > 0.0 and s.heat >= 1.0:
        trip(q, g, TOO_HOT)
    watch_swings(p, s, q, g, error)
