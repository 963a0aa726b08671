"""Both halves of a cascade axis by themselves: its controller on the lines of a drive, and what a drive has of it.

A tick of the controller alone is that of `system`, without what the plant does in it; so is one of the plant alone.
The encoder latches where the drive is told to take a command, once in a sample: what the controller makes of it acts
from the next sample on. That is the first of the samples that `drive.delay` counts.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from detent.control.operation import OperationParams
from detent.errors import DetentError
from detent.kernel.loop import HostArray, advance, ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import hot_step
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.controller import CascadeController, CascadeControllerParams, CascadeLines, control
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.led import NO_ROWS, led, led_machine
from detent.methods.cascade.live import live_of
from detent.methods.cascade.plant import CascadePlant, CascadePlantParams, latch_both, move, sense
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.method import Live, Plant, Wiring
from detent.plant.two_mass import stand_masses


class WiredCascadeParams(Registers):
    """What does not change while the controller runs on a drive."""

    controller: CascadeControllerParams = block("controller")


class WiredCascade(Registers):
    """The controller and its lines."""

    tick: i8 = register("ticks since power-on", unit="tick")
    controller: CascadeController = block("controller")
    lines: CascadeLines = block("wires to the drive")


class CascadeMachineParams(Registers):
    """What does not change of amplifier and mechanics."""

    plant: CascadePlantParams = block("plant")


class CascadeMachine(Registers):
    """Amplifier and mechanics, and their lines."""

    tick: i8 = register("ticks since power-on", unit="tick")
    lines: CascadeLines = block("wires to the controller")
    plant: CascadePlant = block("plant")


@ticks(WiredCascadeParams)
@hot_step
def control_tick(p: WiredCascadeParams, r: WiredCascade, *feed: HostArray) -> bool:
    """One tick of the controller."""
    control(p.controller, r.controller, r.lines, *feed)
    r.tick += 1
    return True


@ticks(CascadeMachineParams)
@hot_step
def machine_tick(p: CascadeMachineParams, r: CascadeMachine) -> bool:
    """One substep of the mechanics."""
    sense(p.plant, r.plant, r.plant.machine, r.lines)
    r.lines.sync, r.lines.brake = 0, r.lines.enable  # a drive opens the brake of its motor with its own torque
    move(p.plant, r.plant, r.plant.machine, r.tick, r.lines)
    r.tick += 1
    return True


def wiring(spec: CascadeSpec) -> Wiring:
    """Its lines in the units of a drive; refused where a drive in torque mode has no place in the axis."""
    torque = 0.0 if spec.motor is None else spec.motor.torque_constant * spec.drive.current_per_volt
    refusals = (
        (spec.drive.input != "current" or spec.motor is None, f"drive.input = {spec.drive.input!r}",
         'a motor, and "current": the drive takes a torque', 'describe [motor], and write drive.input = "current"'),
        (spec.load_encoder is not None, "an encoder on the load", "the encoder of the motor alone: it is the drive's",
         "leave out [load_encoder]"),
        (spec.encoder.resolution == 0.0, "an encoder without counts", "one with counts", "write encoder.resolution"),
        (spec.limit_switches is not None, "limit switches", "none here: they are wired to the drive",
         "leave out [limit_switches]"),
        (spec.encoder.checked, "an encoder with a check", "one without: the drive looks after its encoder",
         "leave out encoder.checked"),
        (spec.drive.delay == 0, "drive.delay = 0", "1 or more: a command acts a sample after its position",
         "write drive.delay = 1"),
    )  # fmt: skip
    for met, got, allowed, remedy in refusals:
        if met:
            raise DetentError(f"{spec.axis.name}: got {got} and a drive; expected: {allowed}; try: {remedy}")
    return Wiring(
        lines=CascadeLines, enable="enable", position="motor.count", demand="command", count=spec.encoder.resolution,
        turn=2.0 * math.pi * spec.radius / spec.encoder.resolution, torque=torque, largest=spec.largest_command,
        sample=spec.method.sample_period, hardware=spec.hardware.id if spec.hardware else "",
    )  # fmt: skip


def wired(
    spec: CascadeSpec, operation: Callable[..., OperationParams], mode: str = "torque"
) -> dict[str, tuple[Live, Wiring]]:
    """The controller at power-on, its drive off, to be operated; its loops are here, or in the drive."""
    if mode != "torque":
        return {"": led(spec, operation, mode)}
    host, lines = CascadeHost(spec), wiring(spec)
    live = live_of(host, operation)
    state = spec.registers_of(WiredCascade)(controller=host.controller, lines=host.state.lines)
    host.controller = state.controller  # of which a fault is told
    params = spec.registers_of(WiredCascadeParams)(controller=host.params.controller)
    return {"": (replace(live, params=params, state=state), lines)}


def machine(spec: CascadeSpec, mode: str = "torque") -> dict[str, tuple[Plant, Wiring]]:
    """Amplifier and mechanics at rest; the first sample of the delay passes on the way to them."""
    if mode != "torque":
        return {"": led_machine(spec, mode)}
    built, lines = build_cascade(spec), wiring(spec)
    params, state = CascadeMachineParams(plant=built.plant), CascadeMachine()
    params.plant.source.delay -= 1
    stand_masses(state.plant.machine, spec.mechanics.start_position)
    state.plant.brake.closed = spec.brake is not None
    latch_both(params.plant, state.plant.machine, state.lines)
    advance(params, state, 0, *NO_ROWS)  # compiles
    ticks_of_sample = built.controller.sample_ticks

    def sample() -> None:
        state.lines.sync = 1
        advance(params, state, ticks_of_sample, *NO_ROWS)

    return {"": (Plant(params, state, sample), lines)}
