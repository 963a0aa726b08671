"""Feedforward of the print head: drive values from the identified slope and friction, in integers.

Drive = IR part (while accelerating or braking) + Coulomb friction part + back-EMF part; print-head specification 2.5,
3.3, 3.5, 3.10. Speeds are speed values s = 6 v[in/s]; drive values are counts of 1/300 of the supply.
"""

from detent.kernel.step import step

TURN_AROUND_US = 133000  # turn-around time at 40 in/s: 2 x 40 / 600 s, rounded as in the patent


@step
def steady_drive(slope: int, friction: int, s: int) -> int:
    """Drive that holds speed s: (K s >> 8) + Vf, equations (1A) and (9)."""
    return ((slope * s) >> 8) + friction


@step
def ramp_interval_us(right: int, left: int, s: int) -> int:
    """Time per count of the ramp, equation (10): 0.133 s (s/240) / (VC1 + VC2), rounded to 1 us."""
    total = 240 * (right + left)
    if total <= 0:
        return TURN_AROUND_US
    return (2 * TURN_AROUND_US * s + total) // (2 * total)


@step
def stop_distance_up(s: int) -> int:
    """Stop distance s^2/144 in emitters, equation (7), rounded up."""
    return (s * s + 143) // 144


@step
def run_up(s: int) -> int:
    """Emitters needed before the first printed column: stop distance + 5 %, rounded up."""
    return (21 * s * s + 2879) // 2880


@step
def low_speed_start_emitters(s: int) -> int:
    """Length of the open-loop start: 3/4 of the stop distance, rounded up (3.6)."""
    return (3 * s * s + 575) // 576


@step
def window_reference(s: int) -> int:
    """Emitters per 16 ms at speed s, equation (11): 0.796 s, rounded."""
    return (204 * s + 128) >> 8
