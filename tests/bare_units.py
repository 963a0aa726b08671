"""Control units as section 4 of the firmware specification lists them, of today's blocks: what its sizes are of.

Today's controllers hold more than those figures count: protection, homing, arrival and its faults, noise on the lines,
clocks that are skipped where nothing happens. Here stand the entries of the specification's table, of the very blocks.
"""

from collections.abc import Callable
from typing import Any

import detent
from detent.control import table_positioner
from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference, control_cascade, coulomb_part
from detent.control.clocks import count_clock, count_sawtooth, integrate_strobe, next_period, sample_strobe
from detent.control.deviation_counter import count_deviation, drive_word
from detent.control.phase_sequencer import count_pulses, hear_tracker
from detent.control.pulse_generator import clock_generator, steer_rate
from detent.control.step_rule import STEP, next_entry, next_step
from detent.control.step_timer import load_period, pulse
from detent.export.unit import ControlUnit, folded
from detent.kernel.loop import i2_signal
from detent.kernel.registers import Registers, i8, u1
from detent.kernel.step import step
from detent.methods.cascade import controller as cascade
from detent.methods.filtered_servo import controller as filtered
from detent.methods.phase_servo import controller as phase
from detent.methods.print_head import controller as head
from detent.methods.rotary_table import controller as table
from detent.methods.stepper_envelope import controller as stepper
from detent.sensing.counted_speed import add_pulses, close_window, filter_speed
from detent.sensing.phase_converters import convert, count_carrier
from detent.sensing.position_sensor import read_word, stand_sensor
from detent.sensing.quadrature import clock_decoder
from detent.translate.program import Program
from detent.translate.text import code_text, signals_text, struct_texts

# ---- cascade


@step
def cascade_power_on(
    p: cascade.CascadeControllerParams, c: cascade.CascadeController, lines: cascade.CascadeLines
) -> None:
    """At rest, where the lines show."""
    stand_sensor(p.motor_sensor, c.motor_sensor, lines.motor)
    stand_sensor(p.load_sensor, c.load_sensor, lines.load)


@step
def refer(c: cascade.CascadeController, position: float, velocity: float, acceleration: float) -> None:
    """What the axis should do."""
    c.reference.position, c.reference.velocity, c.reference.acceleration = position, velocity, acceleration


@step
def law(p: CascadeLawParams, r: CascadeLaw, ref: CascadeReference, position: float, velocity: float) -> None:
    """The law without what came later: a dead band at rest, a hanging load."""
    f = p.feed_forward
    r.position_error = ref.position - position
    r.feed_forward = f.acceleration * ref.acceleration + f.viscous * ref.velocity + coulomb_part(f, ref.velocity)
    demand = p.cascade.position_gain * r.position_error + f.velocity * ref.velocity
    control_cascade(p, r, demand, velocity, 1)


@step
def sample(
    p: cascade.CascadeControllerParams, c: cascade.CascadeController, lines: cascade.CascadeLines, motor: i8, load: i8
) -> None:
    """Both encoders, and the law."""
    lines.motor.count, lines.load.count = motor, load
    read_word(p.motor_sensor, c.motor_sensor, lines.motor)
    read_word(p.load_sensor, c.load_sensor, lines.load)
    law(p.law, c.law, c.reference, c.motor_sensor.position, c.motor_sensor.velocity)
    lines.command = c.law.command


# ---- filtered servo


@step
def prepare(p: filtered.FilteredControllerParams, c: filtered.FilteredController) -> None:
    """Rate of the command."""
    steer_rate(p.generator, c.generator)


@step
def clock(p: filtered.FilteredControllerParams, c: filtered.FilteredController, a: u1, b: u1) -> None:
    """One clock of the decoder: strobe, pulses, flip-flops."""
    c.channel_a, c.channel_b = a, b
    if count_clock(c.clock):
        close_window(c.speed)
        filter_speed(p.filter, c.filter, c.speed.word)
    moved, commanded = c.decoder.forward - c.decoder.reverse, clock_generator(c.generator, 1)
    if commanded or moved:
        count_deviation(c.deviation, commanded, moved)
        add_pulses(p.speed, c.speed, moved)
    clock_decoder(c.decoder, a, b)


@step
def decide(p: filtered.FilteredControllerParams, c: filtered.FilteredController, lines: filtered.FilteredLines) -> None:
    """The drive word."""
    lines.word = drive_word(p.deviation, c.deviation, c.filter.output)


# ---- phase servo


@step
def tick(p: phase.PhaseControllerParams, c: phase.PhaseController, lines: phase.PhaseLines, ps: u1) -> None:
    """One period of the reference clocks."""
    k = c.converters
    next_period(c.clocks)
    count_carrier(p.converters.carrier, k.carrier)
    convert(p.converters, k, ps)
    next_period(c.clocks)
    plus, minus = k.tracking.plus, k.tracking.minus
    if plus + minus:
        hear_tracker(c.sequencer, plus - minus, phase.reference_period(c.clocks))
        count_pulses(c.sequencer, plus, minus)
        add_pulses(p.speed, c.speed, plus - minus)
        c.changed = 1
    c.changed |= k.absolute.latched | c.sequencer.strobe
    if integrate_strobe(p.clocks, c.clocks):
        phase.tick_integrator(p, c)
    if sample_strobe(p.clocks, c.clocks):
        close_window(c.speed)
        c.changed = 1
    if c.changed > 0 or phase.reference_period(c.clocks) >= c.wake:
        phase.decide(p, c)
    lines.first_request = count_sawtooth(p.pwm, c.pwm, c.law.word)
    lines.request = count_sawtooth(p.pwm, c.pwm, c.law.word)


# ---- stepper


@step
def next_(p: stepper.StepperControllerParams, c: stepper.StepperController, up: i2_signal, down: i2_signal) -> int:
    """The running period is over."""
    outcome = next_step(p.rule, c.rule, next_entry(c.rule, up, down))
    if outcome == STEP:
        load_period(p.timer, c.timer, c.rule.word)
        pulse(c.timer, c.rule.direction)
    return outcome


JOBS = {
    "cascade": "slide_moves.toml",
    "single": "slide_moves.toml",
    "filtered_servo": "slide_moves.toml",
    "phase_servo": "moves.csv",
    "rotary_table": "index_sequence.toml",
    "zoom": "zoom_sequence.toml",
    "print_head": "letter.txt",
}
"""Packaged axes, one of them in single precision too, and their jobs."""
MOTORS = {"zoom": "group_a"}


def axis_named(unit: str) -> detent.Axis:
    """The axis of a unit of `JOBS`."""
    if unit == "single":
        return detent.load(detent.example("cascade.toml")).replace({"controller.arithmetic": "single"})
    return detent.load(detent.example(f"{unit}.toml"))


ENTRIES: dict[str, dict[str, Callable[..., Any]]] = {
    "cascade": {"power_on": cascade_power_on, "refer": refer, "sample": sample},
    "filtered_servo": {
        "prepare": prepare, "clock": clock, "decide": decide, "power_on": filtered.power_on, "go_to": filtered.go_to,
        "reset": filtered.reset, "set_period": filtered.set_period,
    },
    "print_head": {
        name: getattr(head, name)
        for name in (
            "power_on", "write_command", "read_status", "ink_columns", "begin", "emitter", "reverse", "fired", "decide",
        )
    },
    "phase_servo": {"tick": tick, "power_on": phase.power_on, "command": phase.command},
    "zoom": {
        "next": next_, "place": stepper.place, "start": stepper.start, "deflect": stepper.deflect,
        "release": stepper.release, "reset": stepper.reset,
    },
    "rotary_table": {
        "begin_task": table_positioner.begin_task, "interrupt": table_positioner.interrupt,
        "end_task": table_positioner.end_task, "press": table.press, "release": table.release, "dial": table.dial,
        "position": table.position,
    },
}  # fmt: skip
"""Of each method: entries by their names."""
ENTRIES["single"] = ENTRIES["cascade"]


def bare_program(method: str, unit: ControlUnit, params: Registers) -> Program:
    """Such a unit, translated."""
    roots = {unit.params: "params", unit.controller: "controller", unit.lines: "lines"}
    entries = {f"bare_{name}": entry for name, entry in ENTRIES[method].items()}
    return Program("bare", entries, unit.params, folded(params), roots)


def bare_header(program: Program, unit: ControlUnit) -> str:
    """Its structures, and prototypes of its entries."""
    structs = struct_texts(program, (unit.params, unit.controller, unit.lines)) + signals_text(program)
    prototypes = "".join(f"{program.signature(f)};\n" for f in program.steps.values() if f.entry)
    return f"#include <stdbool.h>\n#include <stdint.h>\n{structs}{prototypes}"


def bare_code(method: str, unit: ControlUnit, params: Registers) -> str:
    """The C of such a unit, as one file."""
    program = bare_program(method, unit, params)
    return bare_header(program, unit) + code_text(program)
