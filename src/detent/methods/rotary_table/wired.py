"""Both halves of a rotary table by themselves: its controller before a drive, and what a drive has of it.

The drive closes the velocity loop, which is the amplifier's in the axis file, and has a sensor of its own on the motor
that counts its turns without power (6064). From its count come the words that both comparators would show; from the
speed word comes the velocity that it is told. The sensor is read where the drive was told something, so that the word
acts a strobe period after it, not `method.interrupt_delay`.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from detent.control.operation import OperationParams
from detent.errors import DetentError
from detent.kernel.loop import advance, ticks
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, f8, i4, i8, register, u1, u4
from detent.kernel.step import hot_step, step
from detent.methods.method import Live, Plant, Wiring
from detent.methods.rotary_table.build import build_rotary_table, start_turns
from detent.methods.rotary_table.controller import TableController, TableControllerParams, control
from detent.methods.rotary_table.derive import TableFigures
from detent.methods.rotary_table.live import live
from detent.methods.rotary_table.plant import TablePlant, TablePlantParams, move
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.plant.rotary_motor import stand_at
from detent.sensing.resolver_counter import CompositionParams

NO_ROWS = np.zeros((1, 0), np.uint8), np.zeros(0, np.int64), 0
LEAST_DAMPING = 0.1  # of the position loop with the delay of the bus


class WiredTableLines(Registers):
    """Wires to the drive, and the words that the resolvers would show."""

    count: i8 = register("position of the motor, over all turns", unit="count", by=PLANT)
    fine: u4 = register("word of comparator 17 at that position", unit="count", by=CONTROLLER)
    coarse: u4 = register("word of comparator 18 at that position", unit="count", by=CONTROLLER)
    strobe: u1 = register("1: the position is taken over at the beginning of the next tick", by=CONTROLLER)
    word: i4 = register("speed register 5", unit="count", by=CONTROLLER)
    interrupt: u1 = register("1 in a tick with an interrupt", by=CONTROLLER)
    enable: u1 = register("1 lets the drive turn the motor", by=CONTROLLER)
    velocity: f8 = register("velocity demand", unit="rad/s", by=CONTROLLER)


class WiredTableParams(Registers):
    """What does not change while the controller runs before a drive."""

    controller: TableControllerParams = block("controller")
    speed: f8 = register("table speed per count of the speed word", unit="rad/s")


class WiredTable(Registers):
    """The controller and its lines."""

    tick: i8 = register("periods of 100 us since power-on", unit="tick")
    controller: TableController = block("controller")
    lines: WiredTableLines = block("wires to the drive")


class TableMachineParams(Registers):
    """What does not change of amplifier and mechanics."""

    plant: TablePlantParams = block("plant")


class TableMachine(Registers):
    """Amplifier and mechanics, and their lines."""

    tick: i8 = register("periods of 100 us since power-on", unit="tick")
    lines: WiredTableLines = block("wires to the controller")
    plant: TablePlant = block("plant")


@step
def show_words(p: CompositionParams, lines: WiredTableLines) -> None:
    """Words of both comparators at the count of the drive, without their errors."""
    period = p.ratio * p.fine
    lines.fine = (lines.count + p.fine_zero) % p.fine
    lines.coarse = ((lines.count % period) * p.coarse // period + p.coarse_zero) % p.coarse


@ticks(WiredTableParams)
@hot_step
def wired_tick(p: WiredTableParams, r: WiredTable) -> bool:
    """One tick of the controller; none while the host must look."""
    if r.controller.positioner.event:
        return False
    if r.lines.strobe:
        show_words(p.controller.composition, r.lines)
    control(p.controller, r.controller, r.lines)  # pyright: ignore[reportArgumentType] - the table's are among them
    r.lines.velocity = r.lines.word * p.speed if r.lines.enable else 0.0
    r.tick += 1
    return True


@ticks(TableMachineParams)
@hot_step
def machine_tick(p: TableMachineParams, r: TableMachine) -> bool:
    """One substep of amplifier and mechanics."""
    move(p.plant, r.plant, r.plant.train, r.lines, r.tick)  # pyright: ignore[reportArgumentType] - as above
    r.tick += 1
    return True


def wiring(spec: RotaryTableSpec, mode: str) -> Wiring:
    """Its lines in the units of a drive; refused where the drive has no place in the axis."""
    delayed = replace(TableFigures(spec).loop, delay=spec.method.strobe_period * (1 - 1e-9))
    refusals = (
        (mode != "velocity", f"the mode {mode}", "a velocity: the table's amplifier closes that loop",
         "?mode=velocity behind the address"),
        (not spec.method.position_control, "method.position_control = false", "true: nothing else finds the angle",
         "leave it out"),
        (delayed.damping < LEAST_DAMPING, f"a loop with a damping of {delayed.damping:.2g} by the delay of a bus",
         f"{LEAST_DAMPING} or more", f"method.position_gain = {delayed.largest_gain(0.3):.3g}"),
    )  # fmt: skip
    for met, got, allowed, remedy in refusals:
        if met:
            raise DetentError(f"{spec.axis.name}: got {got} and a drive; expected: {allowed}; try: {remedy}")
    return Wiring(
        lines=WiredTableLines, enable="enable", position="count", demand="velocity", count=spec.count,
        turn=spec.detector.fine.counts, turn_key="detector.fine.counts", torque=0.0,
        largest=spec.largest_word * spec.speed_per_word, sample=spec.method.strobe_period,
        hardware=spec.hardware.id if spec.hardware else "", mode=mode,
    )  # fmt: skip


def wired(
    spec: RotaryTableSpec, operation: Callable[..., OperationParams], mode: str = "torque"
) -> dict[str, tuple[Live, Wiring]]:
    """The controller at power-on, its drive off, to be operated."""
    lines, made = wiring(spec, mode), live(spec, operation)[""]
    before: Any = made.state
    state: Any = WiredTable(controller=before.controller)
    state.lines.strobe = before.lines.strobe
    params: Any = made.params
    params = WiredTableParams(controller=params.controller, speed=spec.speed_per_word)

    def fault() -> str:
        """What the guard says, whose registers are those of the controller here."""
        before.controller.restore(state.controller.snapshot())
        return made.fault()

    return {"": (replace(made, params=params, state=state, fault=fault, places={}), lines)}


def machine(spec: RotaryTableSpec, mode: str = "torque") -> dict[str, tuple[Plant, Wiring]]:
    """Amplifier and mechanics at rest, before a drive that has its own sensor on the motor."""
    lines, built = wiring(spec, mode), build_rotary_table(spec)
    params, state, turn = TableMachineParams(plant=built.plant), TableMachine(), spec.detector.fine.counts
    motor: Any = state.plant.train.motor
    wires: Any = state.lines
    stand_at(motor, start_turns(spec))
    advance(params, state, 0, *NO_ROWS)  # compiles
    ticks_of_sample = built.controller.clocks.strobe_ticks

    def sample() -> None:
        """The sensor latches, then the time until the next sample passes with what was told before it."""
        wires.count = motor.turns * turn + math.floor(motor.angle / math.tau * turn)
        wires.word = round(wires.velocity / spec.speed_per_word)
        advance(params, state, ticks_of_sample, *NO_ROWS)

    return {"": (Plant(params, state, sample), lines)}
