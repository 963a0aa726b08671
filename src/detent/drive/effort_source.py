"""Amplifier of a motor: takes a command at each sample, with its dead time, and puts out a voltage or a force.

The command, in the unit that the law computes in, is put on the steps of the converter and limited; some whole samples
later it stands at the output, times the gain, until the next sample. A gain of 1 V/V and a limit make a motor driven by
a voltage; a gain in N/V makes a current amplifier with its motor.
"""

import math

from detent.kernel.registers import Registers, f8, f8_array, i8, register
from detent.kernel.step import step

MEMORY = 64  # samples kept; the delay is shorter


class EffortSourceParams(Registers):
    """Converter and amplifier."""

    gain: f8 = register("output per command", unit="V/V, N/V")
    step: f8 = register("step of the converter; 0: none", unit="V")
    limit: f8 = register("largest magnitude of the command", unit="V")
    delay: i8 = register("samples until a command acts, 0..63; 0: in the tick of its sample", unit="count")


class EffortSource(Registers):
    """What is on its way, and what stands at the output."""

    command: f8 = register("last command taken, on the steps of the converter and within the limit", unit="V")
    output: f8 = register("output until the next sample", unit="V, N")
    place: i8 = register("place of the last command in the memory", unit="count")
    memory: f8_array = register("commands on their way", unit="V", length=MEMORY)


@step
def converted(p: EffortSourceParams, command: float) -> float:
    """The command on the steps of the converter and within the limit [V]."""
    if p.step > 0.0:
        command = p.step * math.floor(command / p.step + 0.5)
    return min(max(command, -p.limit), p.limit)


@step
def take_command(p: EffortSourceParams, r: EffortSource, command: float) -> None:
    """Sample: take `command` [V], put out the one whose delay is over."""
    r.command = converted(p, command)
    r.place = (r.place + 1) % MEMORY
    r.memory[r.place] = r.command
    r.output = p.gain * r.memory[(r.place - p.delay) % MEMORY]
