"""Kills of a live host that keeps its store while its axis moves: ``python -m tests.live_kills KILLS``.

The host is that of `detent live`: its loop in a thread, in wall time, its store kept from another, commands asked in
words. What is killed with it is everything but the machine: the registers of the simulated axis lie in shared memory,
and where it stands there is the truth that no start may miss.

A host lives for a fifth of a second, most of which it waits: so that the processors do not, several machines run side
by side, each with a store, a seed and hosts of its own. All are forks of one process in which everything is compiled.
"""

import gc
import json
import mmap
import os
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any, NoReturn

from detent.control import operation as ops
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.system import Cascade
from detent.methods.load import load_spec
from detent.methods.position import PositionSensor
from detent.methods.registry import METHODS
from detent.operate import host as host_module
from detent.operate.host import Host
from detent.operate.session import Session
from detent.operate.store import Store
from detent.operate.trust import Trust
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_rig import SENSORS, TRAVEL, Model, memory_folder, open_store, read, table_change, table_of

LONGEST = 0.2  # life of a host, from its start or its first motion [s]
MACHINES = 4 * (os.cpu_count() or 1)  # side by side
SPEED = 10.0  # how fast time passes on its axis
EXAMPLE = EXAMPLES / "cascade.toml"
OVERRIDES = (f"limits.travel={TRAVEL} um", "limits.speed=50 mm/s", "mechanics.start_position=5 mm")
ROLLS = 4000  # farthest that it rolls without torque [count]: so far from its ends all moves end


class Machine:
    """What is there without the host: the axis, and numbers of 64 bits, in memory that processes share."""

    def __init__(self, seed: int) -> None:
        self._memory = memoryview(mmap.mmap(-1, 4096)).cast("q")
        self.seed, self.zero = seed, 0
        self.spec: Any = load_spec(EXAMPLE, OVERRIDES)
        self._axis = mmap.mmap(-1, 1 << 20)
        self.axis: Any = Cascade.from_buffer(self._axis)
        self.stand(TRAVEL // 2)

    def _word(number: int) -> property:  # noqa: N805 - makes a property
        return property(lambda self: self._memory[number], lambda self, value: self._memory.__setitem__(number, value))

    begun = _word(2)  # changes of the table that were begun
    done = _word(3)  # those that were told to be made
    ready = _word(4)  # the store was open, and motion began

    @property
    def position(self) -> int:
        """Where it stands [count]."""
        return round(self.axis.plant.machine.motor.position * 1e6)

    @property
    def moving(self) -> bool:
        """Whether it has torque, or moves."""
        return bool(self.axis.controller.on or abs(self.axis.plant.machine.motor.velocity) > 1e-6)

    def stand(self, position: int) -> None:
        """At rest, without torque, somewhere."""
        axis = CascadeHost(self.spec, position=position * 1e-6).state
        axis.controller.on = 0
        self.axis.restore(bytes(axis))

    def host(self, store: Store | None, *, wall: bool = True) -> Host:
        """A host of it, as it stands."""
        spec = self.spec.changed(mechanics={"start_position": self.position * 1e-6})
        host = Host(METHODS["cascade"], spec, speed=SPEED, careful=False, wall=wall, store=store, stated=False)
        self.axis.restore(bytes(host.axis.state))
        host.axis = replace(host.axis, state=self.axis)
        return host


def live_host(path: Path, made: PositionSensor, machine: Machine) -> NoReturn:
    """A live axis: a person's word where the position is unknown, then moves and changes of the table for ever."""
    random = Random(os.getpid())
    host = machine.host(open_store(path, made))
    host_module.ask_for_time = list  # to lock the memory of a fork copies all of it
    host.start()
    session, keeper = Session(host, {}), host.keeper
    assert keeper is not None
    if session.status()["trust"] == "unknown":
        session.wait(session.ask("trust", ops.REFERENCED))
    while True:
        if random.random() < 0.5:
            move(session, machine, random)
        else:
            machine.begun += 1
            with keeper.lock:
                table_change(machine.begun, machine.seed)[0](keeper.store)
            machine.done += 1


def move(session: Session, machine: Machine, random: Random) -> None:
    """Torque, one motion or a few, some of them stopped, no torque; it may be asked again before it is parked."""
    session.wait(session.ask("enable"))
    for _ in range(random.randrange(3)):
        session.ask("move_to", random.uniform(ROLLS, TRAVEL - ROLLS) * 1e-6)
        machine.ready = 1
        time.sleep(random.uniform(0.0, 0.01))
        if random.random() < 0.3:
            session.ask("stop")
    session.ask("disable")
    time.sleep(random.choice((0.0, 0.15, 0.15)))


HOST: Callable[[Path, PositionSensor, Machine], NoReturn] = live_host


def kill_once(path: Path, made: PositionSensor, machine: Machine, random: Random) -> None:
    """Start a host, and kill it."""
    child = os.fork()
    if child == 0:
        try:
            HOST(path, made, machine)
        finally:
            os._exit(70)  # it must be killed, not fail
    # Some of them anywhere, the others once motion has begun.
    if random.random() < 0.8:
        end = time.monotonic() + 10.0
        while not machine.ready and time.monotonic() < end:
            time.sleep(0.0002)
    time.sleep(random.uniform(0.0, LONGEST))
    os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status), "the host failed before it was killed"


def happen(made: PositionSensor, machine: Machine, random: Random) -> None:
    """What a machine does without its host: it runs down, and what nothing holds is pushed."""
    if machine.moving:
        machine.stand(min(max(machine.position + random.randrange(-300, 300), ROLLS), TRAVEL - ROLLS))
    elif not made.held and random.random() < 0.2:
        machine.stand(random.randrange(ROLLS, TRAVEL - ROLLS))


def look(path: Path, made: PositionSensor, machine: Machine, model: Model) -> tuple[str, Model]:
    """What the store says after a kill: how the position was judged, and the table, which must be old or new."""
    with open_store(path, made) as store:
        assert store.aside is None, store.aside
        judged = store.restore(read(made, machine.position, machine.zero))
        assert judged.trust is not Trust.REFERENCED
        if judged.trust is not Trust.UNKNOWN:
            assert judged.counts is not None
            assert abs(judged.counts - machine.position) <= made.window, (judged, machine.position)
        table = table_of(store)
    if machine.begun > machine.done:
        after = model.copy()
        table_change(machine.begun, machine.seed)[1](after)
        if table == after.table and table != model.table:
            model = after
            machine.done = machine.begun
        # A change that was not told to be made will be made again.
        machine.begun = machine.done
    assert table == model.table
    return judged.why.name, model


def kill_many(kills: int, seed: int, folder: Path) -> Counter[str]:
    """Kills of hosts with each kind of sensor; how often each judgement came, and how many changes were kept."""
    told: Counter[str] = Counter()
    for number, (name, made) in enumerate(SENSORS.items()):
        machine, random, model = Machine(seed), Random(f"{seed} {name}"), Model()
        path, known = folder / f"{number}.state", 0
        for _ in range(-(-kills // len(SENSORS))):
            kill_once(path, made, machine, random)
            for change in range(known + 1, machine.done + 1):
                table_change(change, seed)[1](model)
            happen(made, machine, random)
            why, model = look(path, made, machine, model)
            known = machine.done
            told[why] += 1
            told["kills"] += 1
            told["in motion or ready"] += machine.ready
            machine.ready = 0
        told["changes"] += known
    return told


def kill_by_all(kills: int, machines: int = MACHINES) -> Counter[str]:
    """So many kills, of hosts of several machines at a time; a machine that finds what may not be ends all."""
    Machine(0).host(None, wall=False).run(1)  # compiled before there are processes that need it
    gc.freeze()
    told: Counter[str] = Counter()
    with memory_folder() as folder:
        pipes = [begin(seed, -(-kills // machines), folder / str(seed)) for seed in range(machines)]
        answers = [os.fdopen(pipe).read() for _, pipe in pipes]
    ends = [os.waitpid(child, 0)[1] for child, _ in pipes]
    assert not any(ends), "a machine has found what may not be: see above"
    for answer in answers:
        told.update(json.loads(answer))
    return told


def begin(seed: int, kills: int, folder: Path) -> tuple[int, int]:
    """A machine in a process of its own, and the pipe that it tells its counts by."""
    heard, telling = os.pipe()
    child = os.fork()
    if child:
        os.close(telling)
        return child, heard
    try:
        folder.mkdir()
        os.write(telling, json.dumps(kill_many(kills, seed, folder)).encode())
        os._exit(0)
    finally:
        traceback.print_exc()
        os._exit(70)


if __name__ == "__main__":
    print(json.dumps(kill_by_all(int(sys.argv[1]))))  # noqa: T201
