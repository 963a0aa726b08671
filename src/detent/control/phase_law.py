"""Control law of the phase servo: corrector, integrator, arithmetic (specification 3.8, 3.9; blocks 650, 150, 200)."""

from detent.control.phase_sequencer import SPEED_MODE
from detent.kernel.registers import Registers, i2, i4, i8, register, u1
from detent.kernel.step import step


class LawParams(Registers):
    """Gains of both modes, dead band, limits."""

    speed_k1: i4 = register("KS1: of the shaped setpoint in speed mode")
    speed_k2: i4 = register("KS2: of the speed word in speed mode")
    speed_k3: i4 = register("KS3: of the sum in speed mode")
    position_k1: i4 = register("KP1: of the shaped setpoint in position mode")
    position_k2: i4 = register("KP2: of the speed word in position mode")
    position_k3: i4 = register("KP3: of the sum in position mode")
    dead_band: i4 = register("half width D of the dead band at stop", unit="count", range=(0, 0xFFFF))
    integral_limit: i4 = register("largest magnitude of the integral", unit="count", range=(0, 0xFFFF))
    corrector: u1 = register("1: corrector in use", option=True)
    integrator: u1 = register("1: integrator in use", option=True)
    word_limit: i8 = register("half the range of the drive word, 2^(M-1)", unit="count", range=(1, 1 << 15))


class Law(Registers):
    """Words between the blocks."""

    setpoint: i4 = register("word 100c: reference velocity or position error", unit="count")
    shaped: i4 = register("word 650a: setpoint after the corrector", unit="count")
    integral: i4 = register("word 150a: integral of the error at stop", unit="count")
    word: i2 = register("drive word 200a", unit="count")


@step
def shape(error: int, half_width: int) -> int:
    """Corrector F_D: dead band -D .. D-1, the first levels outside it are 1 and -1; with D = 0 no error gives zero."""
    if error >= half_width:
        return error - half_width + 1
    if error < -half_width:
        return error + half_width
    return 0


@step
def integrate(p: LawParams, r: Law, error: int) -> None:
    """One integration clock at stop: count towards the error, hold inside the dead band and at the limit."""
    if error >= p.dead_band and r.integral < p.integral_limit:
        r.integral += 1
    elif error < -p.dead_band and r.integral > -p.integral_limit:
        r.integral -= 1


@step
def drive_word(p: LawParams, r: Law, mode: int, stop: int, speed: int) -> None:
    """Words 650a and 200a from 100c, the integral and the speed word."""
    r.shaped = r.setpoint
    if mode == SPEED_MODE:
        u = p.speed_k3 * (p.speed_k1 * r.shaped + r.integral - p.speed_k2 * speed)
    else:
        if p.corrector:
            r.shaped = shape(r.setpoint, p.dead_band if stop else 0)
        u = p.position_k3 * (p.position_k1 * r.shaped + r.integral - p.position_k2 * speed)
    r.word = min(max(u, -p.word_limit), p.word_limit - 1)
