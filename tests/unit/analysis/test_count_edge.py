"""A loop across the edge of a count, against the relay simulated sample by sample."""

import numpy as np
import pytest

from detent.analysis.count_edge import edge_cycle

PERIOD = 1e-3


def loop(gain: float, drag: float, late: int):
    """A mass with drag under a gain on its place and one on the difference, the command so many samples late."""
    slow = np.exp(-drag * PERIOD)
    size = 3 + late
    a, b = np.zeros((size, size)), np.zeros(size)
    a[0, :2], a[1, 1] = (1.0, (1.0 - slow) / drag), slow  # place, speed
    driven = np.array([(PERIOD - (1.0 - slow) / drag) / drag, (1.0 - slow) / drag])
    command = np.zeros(size)  # -gain q - damping (q - q before)
    damping, through = 0.02 * gain / PERIOD, -gain - 0.02 * gain / PERIOD
    command[2] = damping
    b[2] = 1.0  # what was read before
    a[3, :], b[3] = command, through
    for k in range(4, size):
        a[k, k - 1] = 1.0
    a[:2, size - 1] = driven
    place = np.zeros(size)
    place[0] = 1.0
    return a, b, place, command, through


def simulated(a, b, place, command, through, first: float, samples: int = 2000):
    """Half cycles, swings of place and command of the relay from a first place, once it repeats."""
    state, places, commands = np.zeros(len(a)), [], []
    state[0] = first
    for _ in range(samples):
        read = 0.5 if place @ state > 0.0 else -0.5
        places.append(place @ state)
        commands.append(command @ state + through * read)
        state = a @ state + b * read
    tail = np.array(places[samples // 2 :])
    turns = np.flatnonzero(np.signbit(tail[1:]) != np.signbit(tail[:-1]))
    return set(np.diff(turns).tolist()), np.ptp(tail), np.ptp(commands[samples // 2 :])


@pytest.mark.parametrize(("gain", "late", "half"), [(2e3, 1, 4), (5e3, 2, 6), (2e3, 4, 9)])
def test_the_cycle_is_that_of_the_relay(gain, late, half):
    made = loop(gain, 100.0, late)
    found = edge_cycle(*made)
    halves, swing, command = simulated(*made, first=0.3)
    assert (found.half, halves) == (half, {half})
    assert found.swing == pytest.approx(swing, rel=1e-6)
    assert found.command == pytest.approx(command, rel=1e-6)


def test_of_several_cycles_the_longest_is_told():
    made = loop(5e3, 100.0, 2)
    assert simulated(*made, first=0.01)[0] == {5}
    assert edge_cycle(*made).half == 6


def test_a_lag_that_is_pushed_away_from_the_edge_has_none():
    assert edge_cycle(np.array([[0.9]]), np.array([0.1]), np.ones(1), np.ones(1), 0.0) is None
