"""Position counter and error of a pulse-commanded servo (filtered-servo specification 3.2 and 3.5; blocks 1 and 2)."""

from detent.kernel.registers import Registers, f8, i4, i8, register, u1
from detent.kernel.step import step

RESET, RUN, FAULT = 0, 1, 2
# Causes of a fault; the texts of two stand in `errors.SERVO_FAULT_TEXT`, of the third in `errors.GUARD_TEXT`.
DEVIATION_RANGE, SPEED_RANGE, GUARDED = 1, 2, 3


class DeviationParams(Registers):
    """Gain and limits."""

    gain: f8 = register("K1: drive counts per pulse of deviation", unit="count/count")
    range: i4 = register("largest magnitude of the deviation", unit="count")
    word_limit: f8 = register("largest magnitude of the drive word", unit="count")
    whole_words: u1 = register("1 rounds the drive word to whole counts", option=True)


class Deviation(Registers):
    """Following error, and whether it drives."""

    state: u1 = register("0 reset, 1 run, 2 fault", unit="code")
    cause: u1 = register(
        "of the last fault: 1 deviation out of range, 2 speed counter about to wrap, 3 the guard", unit="code"
    )
    reset: u1 = register("leave a fault, written by the host, cleared when done")
    deviation: i4 = register("P: command pulses less movement pulses", unit="count")
    position: i8 = register("movement pulses since reset, forward less backward", unit="count")
    error: f8 = register("E = K1 P - y", unit="count")


@step
def count_deviation(r: Deviation, commanded: int, moved: int) -> None:
    """Pulses of one clock, both signed; equal ones leave P as it is."""
    r.deviation += commanded - moved
    r.position += moved


@step
def watch_ranges(p: DeviationParams, r: Deviation, speed_count: int, half: int) -> None:
    """Fault when the deviation leaves its range, or the speed counter (of +-`half` counts) is about to wrap.

    The first cause stays: what the coasting slide does afterwards is its consequence.
    """
    if r.state == FAULT:
        return
    if abs(r.deviation) > p.range:
        r.state = FAULT
        r.cause = DEVIATION_RANGE
    elif speed_count >= half - 1 or speed_count <= -half:
        r.state = FAULT
        r.cause = SPEED_RANGE


@step
def drive_word(p: DeviationParams, r: Deviation, speed: float) -> float:
    """E, and the drive word that it makes; no drive but in RUN."""
    r.error = p.gain * r.deviation - speed
    word = min(max(r.error, -p.word_limit), p.word_limit)
    if p.whole_words:
        word = round_half_away(word)
    return word if r.state == RUN else 0.0


@step
def round_half_away(value: float) -> float:
    """Nearest whole number; halves go away from zero, so that both directions are alike."""
    return float(int(value + 0.5)) if value >= 0.0 else float(int(value - 0.5))
