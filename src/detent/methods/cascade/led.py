"""A cascade axis whose loops are closed elsewhere: in a drive that takes positions or velocities, or on a board.

Here remain the course, the states, and a guard of its own. A board runs the controller of the file as firmware. What
goes over the wires is the mailbox of the controller; what comes back is what its encoder showed at a sample. A sample
that was not heard changes nothing but the patience of the wires.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from detent.control.brake_line import release
from detent.control.operation import STREAM_EFFORT, OperationParams
from detent.errors import DetentError
from detent.kernel.loop import HostArray, advance, lay_ready, ticks
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.controller import CascadeController, CascadeControllerParams, engage, look_after
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.live import live_of
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import rest_off
from detent.methods.method import Board, Live, Plant, Wiring
from detent.sensing.home_marks import HomeWires
from detent.sensing.position_sensor import EncoderWord, read_word

LATE = 4  # samples by which what closes the loops may hear of it later, and open the brake of its motor

NO_ROWS = np.zeros((1, 0), np.uint8), np.zeros(0, np.int64), 0


class LedLines(Registers):
    """Wires to what closes the loops."""

    motor: EncoderWord = block("encoder of the motor", by=PLANT)
    home: HomeWires = block("home switch and index", by=PLANT)
    command: f8 = register("command of the loops, where it is told", unit="V", by=PLANT)
    samples: i8 = register("samples that it has told of", unit="count", by=PLANT)
    enable: u1 = register("0: the loops are open, and the axis has no torque", by=CONTROLLER)
    known: u1 = register("1 while the position is known", by=CONTROLLER)
    zero: f8 = register("position of count 0", unit="m", by=CONTROLLER)
    place: f8 = register("position demand", unit="m", by=CONTROLLER)
    velocity: f8 = register("velocity demand", unit="m/s", by=CONTROLLER)
    acceleration: f8 = register("acceleration demand", unit="m/s2", by=CONTROLLER)


class LedParams(Registers):
    """What does not change while it leads."""

    controller: CascadeControllerParams = block("controller")
    on_velocity: u1 = register("1: the position loop is closed here, and a velocity is demanded")


class LedCascade(Registers):
    """What leads, and its lines."""

    tick: i8 = register("samples since power-on", unit="tick")
    controller: CascadeController = block("controller")
    lines: LedLines = block("wires to what closes the loops")


@step
def hear(p: CascadeControllerParams, c: CascadeController, lines: LedLines) -> None:
    """What was told since: where the axis is, and whether something is wrong with that."""
    told, count = lines.samples != c.samples, lines.motor.count
    if told:
        read_word(p.motor_sensor, c.motor_sensor, lines.motor)
        c.samples = lines.samples
        if p.brake.present:
            release(p.brake, c.brake, c.on)
    c.law.command = lines.command
    c.law.limited = 1 if abs(lines.command) >= p.law.max_command else 0
    if c.on:
        # What is told was so a sample ago. Until more is told the motor goes on as it did.
        c.law.position_error = c.reference.position - p.law.period * c.reference.velocity - c.motor_sensor.position
        look_after(p, c, count if told else c.count + c.weighing.moved)
    else:
        c.law.position_error, c.count = 0.0, count


@step
def tell(p: LedParams, c: CascadeController, lines: LedLines) -> None:
    """The reference of the next sample."""
    law, ref = p.controller.law, c.reference
    lines.enable, lines.known, lines.zero = c.on, c.known, c.motor_sensor.zero
    lines.place, lines.velocity, lines.acceleration = ref.position, ref.velocity, ref.acceleration
    if p.on_velocity:
        demand = law.feed_forward.velocity * ref.velocity + law.cascade.position_gain * c.law.position_error
        most = law.cascade.max_velocity
        lines.velocity = min(max(demand, -most), most) if c.on else 0.0


@ticks(LedParams)
@hot_step
def led_tick(p: LedParams, r: LedCascade, *_feed: HostArray) -> bool:
    """One sample."""
    hear(p.controller, r.controller, r.lines)
    tell(p, r.controller, r.lines)
    r.tick += 1
    return True


def led_wiring(spec: CascadeSpec, mode: str) -> Wiring:
    """Its lines, for what closes the loops; refused where that needs what is not told over the wires."""
    refusals = (
        (spec.load_encoder is not None, "an encoder on the load", "the encoder of the motor alone",
         "leave out [load_encoder]"),
        (spec.encoder.resolution == 0.0, "an encoder without counts", "one with counts", "write encoder.resolution"),
        (spec.limit_switches is not None, "limit switches", "none here: they are wired to the drive",
         "leave out [limit_switches]"),
        (mode == "velocity" and spec.method.structure == "pid", 'method.structure = "pid"',
         '"cascade": the drive closes the velocity loop, detent the position loop', "take the mode position"),
    )  # fmt: skip
    for met, got, allowed, remedy in refusals:
        if met:
            raise DetentError(f"{spec.axis.name}: got {got} and a drive; expected: {allowed}; try: {remedy}")
    motor = spec.motor if spec.drive.input == "current" else None
    torque = 0.0 if motor is None else motor.torque_constant * spec.drive.current_per_volt
    return Wiring(
        lines=LedLines, enable="enable", position="motor.count", demand="place" if mode == "position" else "velocity",
        count=spec.encoder.resolution, turn=2.0 * math.pi * spec.radius / spec.encoder.resolution, torque=torque,
        largest=spec.method.velocity_limit, sample=spec.method.sample_period,
        hardware=spec.hardware.id if spec.hardware else "", mode=mode, zero="zero" if mode == "position" else "",
        effort="command" if torque else "", samples="samples", firmware=bytes(build_cascade(spec).controller),
    )  # fmt: skip


def led(spec: CascadeSpec, operation: Callable[..., OperationParams], mode: str) -> tuple[Live, Wiring]:
    """What leads at power-on, the drive off, to be operated."""
    lines, host = led_wiring(spec, mode), CascadeHost(spec)
    made: Any = live_of(host, operation)
    state: Any = spec.registers_of(LedCascade)(controller=host.controller)
    host.controller = state.controller  # of which a fault is told
    params: Any = spec.registers_of(LedParams)(controller=host.params.controller, on_velocity=int(mode == "velocity"))
    if spec.brake is not None:
        params.controller.brake.open += LATE
        state.controller.brake.left = params.controller.brake.open
    made.live.look_ticks = 1
    made.live.operation.takes &= ~(1 << STREAM_EFFORT)  # what closes the loops does not open them
    return replace(made, params=params, state=state, tick=lines.sample, feed=()), lines


def led_machine(spec: CascadeSpec, mode: str) -> tuple[Plant, Wiring]:
    """The axis of the file with its loops, as a drive that is told a position or a velocity in each sample.

    It knows nothing else: what the axis takes to accelerate, and against friction, its integral finds.
    """
    host, lines = CascadeHost(spec), led_wiring(spec, mode)
    state: Any = LedCascade()
    c: Any = host.controller
    rest_off(host.params, host.state)
    c.known = c.guarded = 0  # it is its master that watches
    law = host.params.controller.law
    forward = law.feed_forward
    forward.acceleration = forward.viscous = forward.coulomb_positive = forward.coulomb_negative = 0.0
    if mode == "velocity":
        law.cascade.position_gain, forward.velocity = 0.0, 1.0
    feed, wires = (lay_ready(np.zeros(0)),) * 4, state.lines
    advance(host.params, host.state, 0, *NO_ROWS, *feed)  # compiles

    def sample() -> None:
        """The time between two samples, with what was told before it."""
        ref = c.reference
        if wires.enable and not c.on:
            engage(c)
            ref.position = wires.place
        c.on = wires.enable
        ref.velocity = wires.velocity if mode == "velocity" else (wires.place - ref.position) / lines.sample
        ref.position = wires.place
        advance(host.params, host.state, host.sample_ticks, *NO_ROWS, *feed)
        wires.command = host.state.lines.command
        wires.motor.count, wires.home = host.state.lines.motor.count, host.state.lines.home

    wires.motor.count = host.state.lines.motor.count
    return Plant(host.params, state, sample), lines


PATIENCE = 0.03  # time without a word after which a board comes to rest for good [s]
CATCH_UP = 0.1  # share of the largest speed at which it makes up for what the clocks are apart


def _of_board(spec: CascadeSpec) -> dict[str, float]:
    """Constants of the code of a board."""
    period, limits = spec.method.sample_period, spec.limits
    return {
        "period": period, "slowing": limits.acceleration, "catch_up": CATCH_UP * limits.speed,
        "lost": max(4, math.ceil(PATIENCE / period)),
    }  # fmt: skip


BOARD = Board(
    lines=LedLines,
    code="serial.c.in",
    places={
        "enable": "enable_", "known": "known_", "zero": "zero_", "place": "told_.position",
        "velocity": "told_.velocity", "acceleration": "told_.acceleration", "samples": "c->samples",
    },
    values=_of_board,
)  # fmt: skip
