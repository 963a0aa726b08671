"""What goes wrong beside the machine of an axis: who asks, the loop, the link to a drive, the program, its store.

In every state of every example where it can happen; a part of the page of faults (`tests.live_faults`).
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from detent.control import operation as ops
from detent.control.reaction import RAMP_HOLD, REACTION_NAMES, REFUSE
from tests.live_faults import STATES, Rig, rig

LEASE = 0.2  # [s]
EXAMPLES = ("cascade", "filtered_servo", "phase_servo", "rotary_table", "print_head", "zoom")
PLACE = {"rotary_table": (ops.GO, 1)}  # a command that goes somewhere


class Told(NamedTuple):
    """What came of one thing in one state of one example."""

    name: str
    what: str
    state: str
    code: int  # number in the table of faults, 0 where it cannot happen or nothing came of it
    seconds: float  # until it was told
    reaction: str


def somewhere(one: Rig) -> tuple[int, float]:
    """A place that it may go to."""
    q = one.axis.live.operation
    return PLACE.get(one.name, (ops.MOVE_TO, 0.5 * (q.lowest + q.highest)))


def _asked(one: Rig, kind: int, value: float, **more: int) -> int:
    """Ask for something; gives why it was refused, and then nothing has changed."""
    o = one.operation
    before = int(o.state), int(o.running), int(o.kind), float(o.demand.target), int(o.demand.do)
    command = one.host.ask(kind, value, **more)
    one.host.run(1)
    ending = one.host.ending(command)
    assert ending is not None
    assert ending.how == ops.REFUSED, (one.name, kind, ending)
    assert before == (int(o.state), int(o.running), int(o.kind), float(o.demand.target), int(o.demand.do))
    return ending.why


def beyond(one: Rig) -> int:
    """F31: a target beyond a soft limit."""
    return _asked(one, ops.MOVE_TO, one.axis.live.operation.highest + 1e-3)


def unknown(one: Rig) -> int:
    """F35: to a place, while the position is not known."""
    one.operation.trust = ops.NOT_KNOWN
    return _asked(one, *somewhere(one))


def second(one: Rig) -> int:
    """F43: another one commands."""
    return _asked(one, *somewhere(one), client=2)


def stale(one: Rig) -> int:
    """F44: a stop came after it was asked."""
    return _asked(one, *somewhere(one), epoch=int(one.operation.epoch) - 1)


def no_number(one: Rig) -> int:
    """F52: a value that is no number."""
    return _asked(one, ops.MOVE_TO, math.nan)


def silent(one: Rig) -> None:
    """F41: whoever held the jog says nothing more."""
    q = one.axis.live.operation
    q.lease_looks = round(LEASE / (one.axis.live.look_ticks * one.axis.tick))
    one.host.ask(ops.JOG, 0.2 * one.axis.speed)


def late(one: Rig) -> None:
    """F50: a period comes more than five periods late."""
    loop = one.host.board.loop
    loop.delay_at, loop.delay = loop.periods + 1, round(5.2 * loop.period)


def often(one: Rig) -> None:
    """F50: four come late in a second."""
    loop = one.host.board.loop
    for _ in range(4):
        loop.delay_at, loop.delay = loop.periods + 1, loop.period
        one.host.run(10)


def dead(one: Rig) -> None:
    """F51: the loop stands for longer than its watchdog waits."""
    loop = one.host.board.loop
    loop.patience = 100_000_000
    loop.delay_at, loop.delay = loop.periods + 1, 150_000_000


def spoilt(one: Rig) -> None:
    """F52: something in the loop is no number."""
    controller = one.axis.state.controller
    if one.name == "cascade":
        controller.law.integral = math.nan
    else:
        controller.filter.output = math.nan


def cut(one: Rig) -> None:
    """F40: a drive on a bus is silent."""
    wires = one.host.board.wires
    wires.silence, wires.heard, wires.taken, wires.written, wires.driven = 30_000_000, 0, 1, 1, 1


def broken(one: Rig) -> None:
    """F54: a part of the program beside the loop ends in an error."""
    one.host.supervised(lambda: (_ for _ in ()).throw(RuntimeError("injected")))()


class Trouble(NamedTuple):
    """Something that goes wrong: what it is called, what it leads to, how it is brought about, and where it can be."""

    text: str
    code: int
    make: Callable[[Rig], int | None]
    states: tuple[str, ...] = STATES[1:]
    names: tuple[str, ...] = EXAMPLES


JOGGED = tuple(name for name in EXAMPLES if name != "phase_servo")
GOES = tuple(name for name in EXAMPLES if name != "rotary_table")
TROUBLES = (
    Trouble("a target beyond a limit", 31, beyond, ("rest", "move"), GOES),
    Trouble("to a place while its position is not known", 35, unknown, ("rest", "move")),
    Trouble("somebody else commands", 43, second, ("rest", "move")),
    Trouble("asked before a stop", 44, stale, STATES),
    Trouble("a value that is no number, asked", 52, no_number, STATES),
    Trouble("nobody keeps the jog", 41, silent, ("rest", "move"), JOGGED),
    Trouble("a period 5.2 periods late", 50, late),
    Trouble("four periods late in a second", 50, often),
    Trouble("the loop stands for 150 ms", 51, dead),
    Trouble("a value that is no number, in the loop", 52, spoilt, STATES[1:], ("cascade", "filtered_servo")),
    Trouble("the drive is silent", 40, cut),
    Trouble("an error in the program", 54, broken),
)


def told(one: Rig, trouble: Trouble, state: str) -> Told:
    """Bring it about, and look at what comes of it; then the axis comes back as its rule says."""
    one.bring(state)
    loop, o, notes = one.host.board.loop, one.operation, one.host.board.faults
    begun, before = int(loop.periods), int(notes.count)
    refused = trouble.make(one)
    if refused is not None:
        return Told(one.name, trouble.text, state, refused, loop.period * 1e-9, REACTION_NAMES[REFUSE])
    jog = one.host._ids
    for _ in range(600):
        one.host.run(1)
        ending = one.host.ending(jog) if trouble.code == 41 else None
        if notes.count > before or (ending is not None and ending.how == ops.FAILED):
            break
    seconds = (int(loop.periods) - begun) * loop.period * 1e-9
    code = int(o.fault) or (ending.why if ending is not None else 0)
    code = one.axis.fault_numbers.get(code, code)
    if code == 41:
        one.pass_time(0.8)
        assert o.answer.rests
        assert o.state == 4
        reaction = REACTION_NAMES[RAMP_HOLD]
    else:
        reaction = one.reaction()
    _come_back(one, code)
    return Told(one.name, trouble.text, state, code, seconds, reaction)


def _come_back(one: Rig, code: int) -> None:
    """Nothing resumes by itself; a reset and an enabling bring it back, but after an error in the program."""
    loop, o, wires = one.host.board.loop, one.operation, one.host.board.wires
    loop.patience, wires.driven, o.barred = 0, 0, 0
    if code == 41:
        assert o.fault == 0
        return
    assert o.state == 7, (one.name, code, int(o.state))
    assert one.ask(ops.RESET).how == ops.DONE
    if code == 52:
        return  # the controller's numbers are mended by enabling it in the file's state
    ended = one.ask(ops.ENABLE)
    assert ended is not None
    assert (ended.how, ended.why) == ((ops.REFUSED, 54) if code == 54 else (ops.DONE, 0)), (one.name, code, ended)


BUSY = ("phase_servo", "move")  # takes no other move under way, whatever else is wrong with it


def cells(name: str) -> Iterator[tuple[Trouble, str]]:
    """All that can happen to an example."""
    for one in TROUBLES:
        states = one.states if name in one.names else ()
        yield from ((one, state) for state in states if one.code not in (31, 35) or (name, state) != BUSY)


def run(name: str) -> tuple[Told, ...]:
    """Every cell of an example."""
    return tuple(told(rig(name), *one) for one in cells(name))


BESIDE = """## Beside the machine

Some faults are not of the machine: of who asks, of the loop, of the way to a drive, of the program. They are brought
about in every state of the six examples in which they can happen: {cells} cells more. Each entry has the fault, the
time until it was told, what followed, and of how many examples. What is refused leaves the axis as it is. A phase servo
takes no other move while one is under way, and says that first. After all others but a lost jog the axis must be reset
and enabled; after an error in the program it is not enabled any more.
"""
OPENED = (
    ("F07", "turns of a sensor that cannot be told from what it shows", "position unknown", "test_36"),
    ("F34", "homing finds nothing, or no end of it", "it comes to rest, position unknown", "test_22"),
    ("F55", "what survives cannot be written", "no new motion begins; what moves goes on", "test_f55"),
    ("F60", "an axis file with an unknown key, unit or range", "no axis", "tests/unit/axisfile"),
    ("F62", "a damaged store", "kept aside, position unknown", "tests/unit/operate/test_store.py"),
    ("F63", "the power cut while it was written", "old or new, never mixed", "test_34"),
    ("F64", "killed in motion", "position unknown, or restored by an absolute sensor", "test_33"),
    ("F65", "a store of another scale, travel or sensor", "kept aside, both shown", "test_35"),
    ("F66", "a board with another firmware", "not enabled", "test_32"),
    ("F67", "moved while off", "not restored, the distance shown", "test_36"),
)
AT_ONCE = """What the store, the axis file and a drive tell as they are opened happens before anything moves. Each has
tests of its own:

| fault | what goes wrong | what follows | test |
| --- | --- | --- | --- |
{rows}

F61, a parameter changed while the axis is enabled, cannot come about: nothing changes one while an axis runs. F06, a
wrap that is ambiguous, is [not raised](live.md#faults).
"""


def page(found: list[Told]) -> str:
    """Its part of the page: what went wrong, by states; several figures where the examples differ."""
    rows = [f"| | {' | '.join(STATES)} |", "| --- |" + " --- |" * len(STATES)]
    for one in TROUBLES:
        row = [one.text]
        for state in STATES:
            ones = [each for each in found if (each.what, each.state) == (one.text, state)]
            times = sorted({round(each.seconds * 1e3) for each in ones})
            shown = f"{times[0]}" if len(times) == 1 else f"{times[0]} to {times[-1]}" if times else ""
            reactions = ", ".join(sorted({each.reaction for each in ones}))
            row.append(f"F{one.code:02d} {shown} ms, {reactions}, {len(ones)} of {len(one.names)}" if ones else "")
        rows.append(f"| {' | '.join(row)} |")
    opened = "\n".join(f"| {code} | {wrong} | {follows} | `{test}` |" for code, wrong, follows, test in OPENED)
    return "\n".join([BESIDE.format(cells=len(found)), *rows, "", AT_ONCE.format(rows=opened)])
