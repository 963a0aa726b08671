"""Sequencer of the phase servo: command counter, velocity table, mode, timers (specification 3.7 and 4; block 100).

A move is a distance in steps. While the command counter is above the threshold the reference is a velocity from a
table; from then on, until the next command, it is the absolute error within the pitch.
"""

from detent.kernel.registers import Registers, i1, i2, i2_array, i4, i8, register, u1, u2
from detent.kernel.step import step

ACQUIRE, SPEED, SETTLE_BUSY, SETTLE_READY, HOLD = 0, 1, 2, 3, 4  # states of specification 4
SPEED_MODE, POSITION_MODE = 0, 1
TABLE = 4096  # entries of the velocity table at most; a larger distance takes the last one in use
NEVER = 1 << 62


class SequencerParams(Registers):
    """Table, threshold and times."""

    threshold: i8 = register("distance at which the mode changes", unit="count", range=(0, 0xFFFF))
    last: i8 = register("last entry of the table in use", unit="count", range=(0, TABLE - 1))
    table: i2_array = register(
        "reference velocity against distance [pulses per sample]", unit="count", length=TABLE, table=True
    )
    ready_ticks: i8 = register("one-shot 108: from position mode to ready", unit="tick")
    stop_ticks: i8 = register("one-shot 109: from position mode to stop", unit="tick")
    quiet_ticks: i8 = register("silence of the tracker that ends the acquisition", unit="tick", range=(0, 1 << 30))
    incremental: u1 = register(
        "1: final approach by counted pulses, the servo the method is compared with", option=True
    )


class Sequencer(Registers):
    """Registers of the sequencer and the lines from and to the host."""

    strobe: u1 = register("set strobe 4a, written by the host, cleared when taken")
    command: u2 = register("distance word 4c, written by the host", unit="count")
    backward: u1 = register("direction bit 4b, written by the host: 1 moves to smaller positions")
    refused: i8 = register("set strobes that came before ready", unit="count")
    event: u1 = register("1 when ready has risen; the host clears it")
    state: u1 = register("0 acquire, 1 speed, 2 settle busy, 3 settle ready, 4 hold", unit="code")
    mode: u1 = register("mode flip-flop 105: 0 speed, 1 position")
    ready: u1 = register("ready 1e: the host may print and command")
    stop: u1 = register("stop 100b: dead band and integrator are in use")
    distance: u2 = register("down counter 102: pulses of either sign still to come", unit="count")
    direction: i1 = register("direction register 101: 1 or -1")
    remaining: i4 = register("signed pulses still to come: position error of the incremental servo", unit="count")
    position: i8 = register("pulses since the bridge was enabled, forward less backward", unit="count")
    ceiling: i2 = register("largest velocity, written by the host; 0: that of the table", unit="count")
    switched: i8 = register("tick in which position mode was entered", unit="tick")
    ready_at: i8 = register("end of one-shot 108", unit="tick")
    stop_at: i8 = register("end of one-shot 109", unit="tick")
    last_sign: i1 = register("sign of the tracker's last pulse: 1 or -1, 0 before the first")
    last_pulse: i8 = register(
        "tick of the tracker's last pulse, but for one that took back the one before", unit="tick"
    )


@step
def count_pulses(r: Sequencer, plus: int, minus: int) -> None:
    """Pulses of this tick: the down counter takes either sign, the others count by sign."""
    r.distance -= plus + minus
    r.remaining -= plus - minus
    r.position += plus - minus


@step
def hear_tracker(r: Sequencer, sign: int, tick: int) -> None:
    """Note a pulse of the tracker, which may still be acquiring.

    Noise makes pairs of opposite pulses where the carriage stands at the boundary of two steps (trap 5). Such a pair
    says that the tracker is locked, so a pulse that takes back the one before does not break the silence.
    """
    if sign != -r.last_sign:
        r.last_pulse = tick
    r.last_sign = sign


@step
def take_command(r: Sequencer) -> bool:
    """Set strobe: load distance and direction, speed mode; True when it was taken. Before ready it passes unheard."""
    if r.strobe == 0:
        return False
    r.strobe = 0
    if r.state < SETTLE_READY:
        r.refused += 1
        return False
    r.distance = r.command
    r.direction = -1 if r.backward else 1
    r.remaining += r.command * r.direction
    r.mode = SPEED_MODE
    r.ready = r.stop = 0
    r.state = SPEED
    return True


@step
def enter_position(p: SequencerParams, r: Sequencer, tick: int) -> None:
    """The threshold is reached, or the axis was just enabled: position mode, both one-shots begin again."""
    r.mode = POSITION_MODE
    r.state = SETTLE_BUSY
    r.switched = tick
    r.ready_at = tick + p.ready_ticks
    r.stop_at = tick + p.stop_ticks


@step
def run_timers(r: Sequencer, tick: int) -> None:
    """Ready and stop rise when their one-shots have run out."""
    if r.state == SETTLE_BUSY and tick >= r.ready_at:
        r.ready = 1
        r.event = 1
        r.state = SETTLE_READY
    if r.state == SETTLE_READY and tick >= r.stop_at:
        r.stop = 1
        r.state = HOLD


@step
def next_timer(r: Sequencer) -> int:
    """Tick at which a one-shot runs out next."""
    if r.state == SETTLE_BUSY:
        return r.ready_at
    return r.stop_at if r.state == SETTLE_READY else NEVER


@step
def setpoint(p: SequencerParams, r: Sequencer, absolute_error: int) -> int:
    """Word 100c: signed table velocity in speed mode, position error in position mode."""
    if r.mode == SPEED_MODE:
        velocity = p.table[min(r.distance, p.last)]
        return (min(velocity, r.ceiling) if r.ceiling > 0 else velocity) * r.direction
    return r.remaining if p.incremental else absolute_error
