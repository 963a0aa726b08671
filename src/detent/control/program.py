"""A job whose moves the operation makes: one after another, each once the one before has ended and its rest has passed.

The host lays the moves ready in a tray, some places ahead; `FEED` says how far. A stop empties it, for it ends the job.
A pause brings the commanded point to rest where it is and holds it; going on leads to the same target.
"""

from detent.control.move_commands import allowed_share, is_allowed
from detent.control.operation import (
    BEYOND,
    DONE,
    FAILED,
    GO,
    HALT,
    JOB,
    JOG,
    MOVE_BY,
    MOVE_TO,
    NUMBERED,
    RUN,
    TRAVEL,
    Operation,
    OperationParams,
    end_running,
    halt,
    tell,
)
from detent.kernel.registers import Registers, block, f8, f8_array, i8, register, u1
from detent.kernel.step import step

WAIT = 0  # kind of a piece that only rests; the others are MOVE_TO, MOVE_BY, GO and JOG
PLACES = 64  # of the tray
FIELDS = 4  # of a piece: kind, value, share of the speed, looks


class Tray(Registers):
    """Moves that the host has laid ready."""

    pieces: f8_array = register("kind, value, share of the speed, looks, of each", length=PLACES * FIELDS, unit="1")


class Program(Registers):
    """How far the job has come."""

    job: i8 = register("id of the job", unit="code")
    pieces: i8 = register("moves that it has", unit="count")
    begun: i8 = register("of them that have begun", unit="count")
    done: i8 = register("of them that have ended", unit="count")
    under_way: u1 = register("1 while one is under way")
    held: u1 = register("1 while a pause holds it")
    do: u1 = register("what the method was told for the present one", unit="code")
    looks: i8 = register("looks left of a jog, or of the rest after a move", unit="count")
    origin: f8 = register("commanded point at the beginning of the job", unit="m")
    tray: Tray = block("moves laid ready")


@step
def perform(q: OperationParams, o: Operation, m: Program) -> None:
    """One look, after the method's answer was judged: the next move of the job, or its end."""
    if o.kind != JOB or q.performs == 0:
        return
    if m.job != o.running:
        m.job, m.pieces = o.running, o.demand.number
        m.begun = m.done = m.looks = 0
        m.under_way = m.held = 0
    if o.paused != m.held:
        hold_or_go_on(o, m)
    if m.held:
        return
    if m.under_way:
        see_move(q, o, m)
    elif m.looks > 0:
        m.looks -= 1
    if m.under_way or m.looks > 0 or o.answer.rests == 0:  # what moved before the job comes to rest first
        return
    if m.begun == m.pieces:
        end_running(o, DONE, 0, 0)
    elif m.begun < o.demand.laid:
        begin_move(q, o, m)


@step
def hold_or_go_on(o: Operation, m: Program) -> None:
    """Come to rest on the way, or go on to where the way led."""
    m.held = o.paused
    if m.under_way and m.held:
        halt(o)
    elif m.under_way:
        o.within = 0
        tell(o, m.do)


@step
def see_move(q: OperationParams, o: Operation, m: Program) -> None:
    """A jog is released when its time has passed; a move ends as one that is asked for by itself does."""
    if m.do == RUN:
        m.looks -= 1
        if m.looks <= 0:
            m.do, o.within = HALT, 0
            halt(o)
    elif o.within >= q.window_looks:
        m.under_way = 0
        m.done += 1


@step
def begin_move(q: OperationParams, o: Operation, m: Program) -> None:
    """Begin the next one."""
    d, k = o.demand, m.begun % PLACES * FIELDS
    kind, value = round(m.tray.pieces[k]), m.tray.pieces[k + 1]
    if m.begun == 0:
        m.origin = o.answer.commanded
    if kind == MOVE_BY:
        value += m.origin
    if kind in (MOVE_TO, MOVE_BY) and not is_allowed(q, o, value):
        end_running(o, FAILED, BEYOND, 0)
        return
    m.begun += 1
    m.looks = round(m.tray.pieces[k + 3])
    if kind == WAIT:
        m.done += 1
        return
    d.share = allowed_share(q, o, m.tray.pieces[k + 2])
    if kind == JOG:
        d.velocity, m.do = value, RUN
    elif kind == GO:
        d.number, m.do = round(value), NUMBERED
    else:
        d.target, m.do = value, TRAVEL
    m.under_way = 1
    o.within = o.outside = 0
    tell(o, m.do)
