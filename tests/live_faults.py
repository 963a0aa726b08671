"""Faults put into every simulated machine, in every state, of every kind: what comes of each, and the page of it.

``python -m tests.live_faults`` writes ``docs/explanation/fault-matrix.md``.
"""

import math
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from detent.control import operation as ops
from detent.control.reaction import REACTION_NAMES, rule_of
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.faults import Faults, injection_of, injections
from detent.operate.host import Host
from tests.acceptance.test_golden_bits import EXAMPLES

PAGE = Path(__file__).parents[1] / "docs/explanation/fault-matrix.md"
FILES = {
    "cascade": "cascade", "equipped": "cascade, equipped", "filtered_servo": "filtered servo",
    "phase_servo": "phase servo", "rotary_table": "rotary table", "print_head": "print head",
    "zoom": "stepper envelope",
}  # fmt: skip
EQUIPPED = (
    "encoder.checked=true", "load_encoder.resolution=1 um", "load_encoder.checked=true", "limit_switches.lower=-10 mm",
    "brake.force=1 kN",
)  # fmt: skip
"""What the cascade example has not got: encoders with a check, one on the load, limit switches, and a brake."""
STATES = ("power-up", "rest", "move", "stop", "quick stop")
LOOKED = 1.2  # time in which a fault is waited for [s]


class Cell(NamedTuple):
    """What came of one fault in one state."""

    name: str
    place: str
    kind: str
    state: str
    code: int  # number in the table of faults, 0 where none was found
    seconds: float  # until it was found
    reaction: str
    known: bool  # the axis still trusts its position afterwards
    recovered: str  # how it came back: "" where it did not
    wrong: bool  # the position that it shows is no longer the true one

    @property
    def found(self) -> str:
        """In a word."""
        return f"F{self.code:02d}" if self.code else "not seen" if self.wrong or not self.recovered else "nothing"


class Rig:
    """An example without a wall clock, brought into a state as often as is wanted."""

    def __init__(self, name: str) -> None:
        self.name = name
        file, overrides = ("cascade", EQUIPPED) if name == "equipped" else (name, ())
        self.spec: Any = load_spec(EXAMPLES / f"{file}.toml", overrides)
        method = METHODS[self.spec.axis.method]
        self.host = Host(method, self.spec, motor="group_a" if name == "zoom" else "", wall=False)
        self.axis: Any = self.host.axis
        self.operation: Any = self.host.board.operation
        self.axis.live.operation.lease_looks = 1 << 40  # nobody keeps the jogs
        self._states: dict[str, Any] = {}

    @property
    def true_position(self) -> float:
        """Where the machine truly is [m], [rad]."""
        plant = self.axis.state.plant
        if hasattr(plant, "machine"):
            return plant.machine.motor.position
        if hasattr(plant, "rotor"):
            return (
                self.axis.live.lower + plant.rotor.angle / self.axis.params.plant.rotor.step_angle * self.axis.live.step
            )
        if hasattr(plant.train, "motor"):
            turn = self.spec.detector.fine.counts * self.spec.count  # of the motor
            return (plant.train.motor.turns + plant.train.motor.angle / math.tau) * turn
        return plant.train.position

    def pass_time(self, seconds: float) -> None:
        self.host.run(round(seconds * 1e9 / self.host.board.loop.period))

    def ask(self, kind: int, value: float = 0.0, **more: int) -> Any:
        """Ask, and let time pass until it has ended, 4 s at most."""
        command = self.host.ask(kind, value, **more)
        for _ in range(80):
            self.pass_time(0.05)
            ending = self.host.ending(command)
            if ending is not None:
                return ending
        return None

    def set_out(self) -> None:
        """A motion that lasts for longer than a fault is waited for, where the axis goes that far."""
        if self.name == "rotary_table":
            self.host.ask(ops.JOG, 0.5 * self.spec.limits.speed)
        else:
            here = self.operation.answer.commanded
            lowest, highest = self.axis.live.operation.lowest, self.axis.live.operation.highest
            self.host.ask(ops.MOVE_TO, highest - 1e-2 if here < 0.5 * (lowest + highest) else lowest + 1e-2)

    def enable(self) -> bool:
        """Operation enabled, at rest, the first motion confirmed."""
        if self.ask(ops.ENABLE).how != ops.DONE:
            return False
        self.pass_time(0.3)
        for _ in range(100):
            if self.operation.answer.rests:
                break
            self.pass_time(0.1)
        return self.ask(ops.CONFIRM).how == ops.DONE

    def _prepare(self, state: str) -> None:
        if state == "power-up":
            self.pass_time(0.7)
            return
        self.bring("power-up")
        assert self.enable()
        assert self.host.state == "operation enabled"
        self.pass_time(0.3)
        if state in ("move", "stop"):
            self.set_out()
            self.pass_time(0.1)
            assert not self.operation.answer.rests
        if state == "stop":
            self.host.stop()
            self.host.run(2)
        if state == "quick stop":
            self.ask(ops.ORDER, 5)

    def bring(self, state: str) -> "Rig":
        """Into a state, as it was the first time."""
        if state not in self._states:
            self._prepare(state)
            self._states[state] = self._kept()
        parts, feed, numbers = self._states[state]
        for part, memory in zip(self._parts(), parts, strict=True):
            part.restore(memory)
        for one, values in zip(self.axis.feed, feed, strict=True):
            one[:] = values
        host: Any = self.host
        host._ids, host._read, host._noted, host._pulls = numbers
        host._ended, host.faults = {}, Faults(host)
        return self

    def _parts(self) -> list[Any]:
        return [self.axis.state, self.axis.memory, self.axis.params, self.host.board]

    def _kept(self) -> Any:
        host: Any = self.host
        numbers = host._ids, host._read, host._noted, host._pulls
        return [one.snapshot() for one in self._parts()], [list(one) for one in self.axis.feed], numbers

    def inject(self, text: str) -> None:
        """Something goes wrong, or nothing any more."""
        self.host.ask(*injection_of(self.axis.places, text))
        self.host.run(1)

    # ---- a cell

    def cell(self, place: str, kind: str, state: str) -> Cell:
        """Put it in, wait, look at what came of it, mend it, and come back."""
        apart = self.bring("rest").apart
        self.bring(state)
        notes, loop = self.host.board.faults, self.host.board.loop
        begun, before = int(loop.periods), int(notes.count)
        self.inject(f"{place} {kind}")
        if state == "power-up" and self.enable():
            self.set_out()
        while notes.count == before and (loop.periods - begun) * loop.period < LOOKED * 1e9:
            self.host.run(10)
        if notes.count == before:  # some are found only as they end
            self.inject("nothing")
            self.pass_time(0.2)
        code, seconds, reaction = 0, 0.0, ""
        if notes.count > before:
            given = int(notes.code[before % 16])
            code, seconds = (
                self.axis.fault_numbers.get(given, given),
                (notes.period[before % 16] - begun) * loop.period * 1e-9,
            )
            reaction = self.reaction()
        self.inject("nothing")
        if not code:
            self.host.stop()
        self._settle()
        known, wrong = bool(self.operation.trust), abs(self.apart - apart) > self.window
        return Cell(self.name, place, kind, state, code, seconds, reaction, known, self._recover(code), wrong)

    @property
    def apart(self) -> float:
        """True position less the one that is shown."""
        return self.true_position - self.operation.answer.position

    @property
    def window(self) -> float:
        """What a healthy sensor may be off by."""
        grain = getattr(self.spec, "count", 0.0) or getattr(self.spec, "pulse", 0.0) or getattr(self.spec, "step", 2e-5)
        return 3e-4 if self.name == "print_head" else 1.5 * self.axis.live.step if self.name == "zoom" else 12 * grain

    def _settle(self) -> None:
        """Let it come to rest."""
        for _ in range(30):
            before = self.true_position
            self.pass_time(0.1)
            if abs(self.true_position - before) < 1e-7:
                return

    def reaction(self) -> str:
        """As it is seen from outside: it rolls out without torque, or is led to rest and then let go, or held."""
        let_go = self.operation.demand.do == ops.REST_OFF
        for _ in range(2000):
            if self.host.state == "fault":
                break
            self.host.run(1)
        self.host.run(2)
        assert self.host.state == "fault"
        if let_go:
            return REACTION_NAMES[0]
        return REACTION_NAMES[1 if self.operation.demand.do == ops.REST_OFF else 2]

    def _recover(self, code: int) -> str:
        """Reset and enable; where the position is lost, no absolute move until it is known again."""
        way: list[str] = []
        if code:
            assert self.ask(ops.ENABLE).why == ops.IN_FAULT
            assert self.ask(ops.RESET).how == ops.DONE
            assert self.host.state == "switch on disabled"
            way.append("reset")
        else:
            self.pass_time(0.5)
        if not self.enable():
            return ""
        way.append("enable")
        if not self.operation.trust:
            if self.name == "print_head":
                self.ask(ops.HOME)
            else:
                absolute = self.ask(ops.GO if self.name == "rotary_table" else ops.MOVE_TO, 1.0)
                assert absolute.why in (ops.UNREFERENCED, ops.BEYOND)
            way.append("reference")
        return " ".join(way) if self._moves() else ""

    def _moves(self) -> bool:
        """It goes a short way, and says truly how far."""
        before, begin = self.apart, self.true_position
        if self.name == "rotary_table":
            self.host.ask(ops.JOG, 0.2)
            self.pass_time(0.5)
            done = self.ask(ops.STOP).how == ops.DONE
        else:
            middle = 0.5 * (self.axis.live.operation.lowest + self.axis.live.operation.highest)
            ending = self.ask(ops.MOVE_BY, -5e-3 if self.true_position > middle else 5e-3)
            done = ending is not None and ending.how == ops.DONE
        self._settle()
        return done and abs(self.apart - before) < self.window and abs(self.true_position - begin) > 2e-3


@cache
def rig(name: str) -> Rig:
    """The rig of an example."""
    return Rig(name)


def cells(name: str, states: tuple[str, ...] = STATES) -> Iterator[tuple[str, str, str]]:
    """Place, kind and state of all cells of an example; of the equipped one those that the plain one has not got."""
    known = injections(rig("cascade").axis.places) if name == "equipped" else {}
    for place, kinds in injections(rig(name).axis.places).items():
        if place in known:
            continue
        yield from ((place, kind, state) for kind in kinds for state in states)


RUNS = {  # what a fault-free hour consists of: a motion there and back, again and again
    "cascade": 0.1, "filtered_servo": 0.05, "phase_servo": 0.05, "rotary_table": 0.0, "print_head": 0.05, "zoom": 0.01,
}  # fmt: skip


def false_alarms(name: str, seconds: float) -> tuple[int, int]:
    """Faults and motions of an example that nothing is wrong with, in a time of the axis [s]."""
    one = rig(name).bring("rest")
    host, motions, jogs = one.host, 0, name == "rotary_table"
    begun, before = int(host.board.loop.periods), int(host.board.faults.count)
    way = RUNS[name] if one.operation.answer.commanded < 0.2 else -RUNS[name]
    while (host.board.loop.periods - begun) * host.board.loop.period < seconds * 1e9:
        ending = one.ask(*((ops.GO, 1 + motions % 3) if jogs else (ops.MOVE_BY, way)))
        assert ending is not None
        assert ending.how == ops.DONE, (name, motions, ending)
        way, motions = -way, motions + 1
    return int(host.board.faults.count) - before, motions


@cache
def run(name: str) -> tuple[Cell, ...]:
    """Every cell of an example."""
    return tuple(rig(name).cell(*one) for one in cells(name))


def page(found: list[Cell], beside: str) -> str:
    """The page of the docs; `beside` is what `live_outside` has to tell."""
    named = [one for one in found if one.code]
    nothing, unseen = (sum(one.found == what for one in found) for what in ("nothing", "not seen"))
    trusted = [one for one in named if one.known and one.wrong]
    text = [HEADING.format(cells=len(found), named=len(named), nothing=nothing, unseen=unseen, trusted=len(trusted))]
    text += [
        "| fault | cells | found after, at the soonest and the latest | reaction | recovery |",
        "| --- | --: | --- | --- | --- |",
    ]
    for code in sorted({one.code for one in named}):
        ones = [one for one in named if one.code == code]
        times = f"{min(one.seconds for one in ones) * 1e3:.0f} ms to {max(one.seconds for one in ones) * 1e3:.0f} ms"
        reactions = ", ".join(f"{what} {n}" for what, n in sorted(Counter(one.reaction for one in ones).items()))
        text.append(f"| F{code:02d} | {len(ones)} | {times} | {reactions} | {RECOVERIES[rule_of(code).recovery]} |")
    for name, title in FILES.items():
        text += [
            "",
            f"## {title[:1].upper()}{title[1:]}",
            "",
            f"| | | {' | '.join(STATES)} |",
            "| --- | --- |" + " --- |" * len(STATES),
        ]
        rows: dict[tuple[str, str], list[str]] = {}
        for one in found:
            if one.name == name:
                shown = f"{one.found} {one.seconds * 1e3:.0f} ms{'' if one.known else ' H'}" if one.code else one.found
                rows.setdefault((one.place, one.kind), []).append(shown)
        text += [f"| {place} | {kind} | {' | '.join(row)} |" for (place, kind), row in rows.items()]
    return "\n".join([*text, "", beside])


HEADING = """# Faults injected: what comes of each

This page is written by `python -m tests.live_faults`, run from the root of the project; do not edit it.
`make test-wide` makes all of it again, and compares.

Into each simulated machine, in each state, goes each kind of fault that applies: {cells} cells. Then the axis is
watched for 1.2 s, the fault is taken away, and the axis must come back: reset, enabled, moved by a short way whose
length it shows truly. In {named} cells a fault was reported. In {nothing} nothing came of what was injected: a sensor
that is stuck while nothing moves is no fault yet. In {unseen} the position that is shown is no longer the true one, and
nothing in the controller could tell: an open loop, or pulses that are lost one by one. A fault
that leaves a wrong position trusted: {trusted} cells. A following error, or an effort at its limit, does not tell a
dead channel of an encoder from a heavy load (F10, F11); where one sensor alone counts the way, as in the filtered and
the phase servo, it therefore takes the trust in the position with it.

States: the fault is there before the axis is enabled and sent on its way (power-up); the axis holds (rest), moves,
comes to rest after a stop, or stands in a quick stop. Each cell gives the fault, the time until it was reported, and an
H where the position counts as unknown afterwards; then an absolute move is refused (F35) until the reference is found.
The time counts from the injection; at power-up it holds the 0.4 s in which the axis is enabled, of a print head those
in which it looks for its frames. What is reported after more than 1.2 s was found as the fault ended.

A reaction that begins as a ramp ends in torque off where the ramp makes it worse; it is then counted by how it began,
but as torque off where both came within a look.
"""
RECOVERIES = {
    "A": "reset", "E": "mend, reset, enable", "H": "mend, reset, enable, find the reference", "C": "correct the file",
    "S": "start detent live anew", "": "ask again",
}  # fmt: skip


def main() -> None:
    """Write the page."""
    from tests import live_outside  # which stands on this rig

    beside = live_outside.page([one for name in live_outside.EXAMPLES for one in live_outside.run(name)])
    PAGE.write_text(page([one for name in FILES for one in run(name)], beside), "utf-8")


if __name__ == "__main__":
    main()
