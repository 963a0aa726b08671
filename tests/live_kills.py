"""Kills of a host that writes its store while an axis moves: ``python -m tests.live_kills KILLS SEED FOLDER``.

A host is a function of a store's path, a sensor and the machine; it never returns. The machine is shared memory: where
the axis stands, whether it can be in motion, and how far the changes of the table have come; it outlives the host, as
a machine does. `stand_in` is a host without a loop. Whatever else shall be killed here takes its place in `HOST`.
"""

import gc
import json
import mmap
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import NoReturn

from detent.methods.position import PositionSensor
from detent.operate.trust import Trust
from tests.live_rig import SENSORS, TRAVEL, Model, open_store, read, table_change, table_of

LONGEST = 0.005  # life of a host, from its start or its first motion [s]


class Machine:
    """What is there without the host: numbers of 64 bits in memory that processes share."""

    def __init__(self, seed: int) -> None:
        self._memory = memoryview(mmap.mmap(-1, 4096)).cast("q")
        self.seed, self.zero = seed, 1234  # position at which an absolute sensor shows 0
        self.position = TRAVEL // 2

    def _word(number: int) -> property:  # noqa: N805 - makes a property
        return property(lambda self: self._memory[number], lambda self, value: self._memory.__setitem__(number, value))

    position = _word(0)  # counts
    moving = _word(1)  # motion is possible
    begun = _word(2)  # changes of the table that were begun
    done = _word(3)  # those that were told to be made
    ready = _word(4)  # the store was open, and motion began


def stand_in(path: Path, made: PositionSensor, machine: Machine) -> NoReturn:
    """A host without a loop: home where the position is unknown, then moves and changes of the table for ever."""
    random = Random(os.getpid())
    store = open_store(path, made)
    if store.restore(read(made, machine.position, machine.zero)).trust is Trust.UNKNOWN:
        move(store, machine, random.randrange(TRAVEL))
        store.refer(machine.position, "index", read(made, machine.position, machine.zero))
    while True:
        if random.random() < 0.4:
            move(store, machine, random.randrange(TRAVEL))
        else:
            machine.begun += 1
            table_change(machine.begun, machine.seed)[0](store)
            machine.done += 1


def move(store, machine: Machine, target: int) -> None:
    """Mark, move, rest, mark."""
    store.moving()
    machine.moving = 1
    machine.ready = 1
    for _ in range(20):
        machine.position += (target - machine.position) // 2
    machine.moving = 0
    store.parked(machine.position, moves=1)


HOST: Callable[[Path, PositionSensor, Machine], NoReturn] = stand_in


def kill_once(path: Path, made: PositionSensor, machine: Machine, random: Random) -> None:
    """Start a host, and kill it."""
    child = os.fork()
    if child == 0:
        try:
            HOST(path, made, machine)
        finally:
            os._exit(70)  # it must be killed, not fail
    # Half of them anywhere, the others once motion has begun.
    if random.random() < 0.5:
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
        machine.position = min(max(machine.position + random.randrange(-300, 300), 0), TRAVEL - 1)
        machine.moving = 0
    elif not made.held and random.random() < 0.2:
        machine.position = random.randrange(TRAVEL)


def look(path: Path, made: PositionSensor, machine: Machine, model: Model) -> tuple[str, Model]:
    """What the store says after a kill: how the position was judged, and the table, which must be old or new."""
    with open_store(path, made) as store:
        assert store.aside is None, store.aside
        judged = store.restore(read(made, machine.position, machine.zero))
        assert judged.trust is not Trust.REFERENCED
        if judged.trust is not Trust.UNKNOWN:
            assert judged.counts == machine.position, (judged, machine.position)
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


def kill_many(kills: int, seed: int, folder: Path) -> dict[str, int]:
    """Kills of hosts with each kind of sensor; how often each judgement came, and how many changes were kept."""
    gc.freeze()
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
    return dict(told)


if __name__ == "__main__":
    print(json.dumps(kill_many(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))))  # noqa: T201
