import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from detent.kernel.step import step
from detent.kernel.turn_table import FRACTION, POINTS, TURN, at_phase
from detent.sensing.phase_detector import (
    JITTER_LIMIT,
    Detector,
    DetectorParams,
    compare,
    fill_errors,
)

COUNTS = 64
PITCH = 0.5e-3


def params(counts: int = COUNTS, **changes: float) -> DetectorParams:
    """A perfect detector of half a millimetre pitch."""
    p = DetectorParams(turns_per_metre=TURN / PITCH, carrier_shift=32 - (counts.bit_length() - 1))
    for name, value in changes.items():
        setattr(p, name, value)
    return p


def cycle(p: DetectorParams, x: float, counts: int = COUNTS) -> np.ndarray:
    """PS at each count of a carrier cycle; the cycle before it has let the noise settle."""
    r = Detector()
    return np.array([compare(p, r, n % counts, x) for n in range(2 * counts)][counts:])


@pytest.mark.parametrize("x", [0.0, 0.1, 0.25, 0.5, 0.77, 1.0, -0.3, 12345.6])
@pytest.mark.parametrize("offset", [0.0, 0.125, -0.75])
def test_the_square_wave_is_high_in_the_second_half_of_a_turn(x, offset):
    p = params(offset=round(offset * TURN))
    turn = (np.arange(COUNTS) / COUNTS + x + offset) % 1.0
    clear = np.minimum(np.abs(turn - 0.5), np.minimum(turn, 1 - turn)) > 1e-6
    assert (cycle(p, x * PITCH) == (turn >= 0.5))[clear].all()


def test_the_phase_is_the_fraction_of_the_pitch_and_leads_for_plus_x():
    p, r = params(offset=-(TURN // 4)), Detector()
    for x, phase in ((0.0, 0.75), (0.3, 0.05), (-0.1, 0.65), (1000.25, 0.0)):
        compare(p, r, 0, x * PITCH)
        assert r.phase / TURN == pytest.approx(phase, abs=1e-9)
    rises = [int(np.argmax(np.diff(cycle(params(), x * PITCH)) == 1)) for x in (0.1, 0.2)]
    assert rises[0] > rises[1]  # farther right: earlier


@pytest.mark.parametrize("jitter", [0.0, 1e-12])
@pytest.mark.parametrize("x", [0.0, 0.25, 0.375, 0.999])
def test_both_ways_of_comparing_agree_where_there_is_nothing_to_displace(x, jitter):
    p = params()
    fill_errors(p, 0.0, 0.0, 0.0)
    assert p.rise.used == 0
    imperfect = params(jitter=jitter)
    imperfect.rise.used = 1
    assert (cycle(p, x * PITCH) == cycle(imperfect, x * PITCH)).all()


@step
def rise_at(p: DetectorParams, phase: int) -> int:
    """Entry of a table: only a step can hand one to a step."""
    return at_phase(p.rise, phase)


def test_an_entry_of_the_table_is_interpolated():
    p = params()
    for k in range(POINTS + 1):
        p.rise.value[k] = 1000 * k * k
    spacing = TURN // POINTS
    assert rise_at(p, 0) == 0
    assert rise_at(p, 7 * spacing) == 49_000
    assert rise_at(p, 7 * spacing + spacing // 4) == 49_000 + (64 - 49) * 250
    assert rise_at(p, TURN - 1) == pytest.approx(256 * 256_000, abs=2)


def voltage(gain: float, quadrature: float, carrier: np.ndarray, x: float) -> np.ndarray:
    """Secondary's voltage at electrical angle `x` along a carrier cycle [rad]."""
    return (1 + gain) * np.sin(carrier) * math.cos(x) + np.cos(carrier + quadrature) * math.sin(x)


errors = {
    "gain": st.floats(-0.5, 0.5),
    "quadrature": st.floats(-math.pi / 6, math.pi / 6),
    "offset": st.floats(-0.3, 0.3),
    "x": st.floats(0, 2 * math.pi, exclude_max=True),
}


@settings(max_examples=60)
@example(gain=0.3, quadrature=0.3, offset=0.3, x=2.0)
@example(gain=-0.3, quadrature=-0.3, offset=-0.3, x=5.0)
@example(gain=0.0, quadrature=0.0, offset=0.25, x=0.0)
@given(**errors)
def test_displaced_edges_are_those_of_the_voltage(gain, quadrature, offset, x):
    counts = 512
    p, r = params(counts), Detector()
    fill_errors(p, gain, quadrature, offset)
    turn = np.arange(counts) / counts
    v = voltage(gain, quadrature, 2 * np.pi * turn, x) - offset
    # Between two of the 256 points the table is linear, and off by an eighth of its second difference at most: an edge
    # so near to a count may fall on either side of it.
    bend = max(np.abs(np.diff(list(table), 2)).max() for table in (p.rise.value, p.fall.value)) / 8 / TURN * 1.2 + 1e-6
    near = np.zeros(counts, bool)
    for shift in (-bend, bend):
        near |= np.sign(voltage(gain, quadrature, 2 * np.pi * (turn + shift), x) - offset) != np.sign(v)
    levels = [compare(p, r, n, x / (2 * math.pi) * PITCH) for n in range(counts)]
    wrong = (np.array(levels) == 1) != (v < 0)
    assert not (wrong & ~near).any()
    assert bend < 1 / counts


@given(**errors)
def test_at_a_point_of_the_table_both_crossings_are_exact(gain, quadrature, offset, x):
    p = params()
    fill_errors(p, gain, quadrature, offset)
    k = int(x / (2 * math.pi) * POINTS)
    angle = 2 * math.pi * k / POINTS
    # PS rises where the voltage falls through the offset: half a turn from the start of the carrier, less the place.
    rise = math.pi - angle - 2 * math.pi * p.rise.value[k] / TURN
    fall = -angle - 2 * math.pi * p.fall.value[k] / TURN
    for carrier, slope in ((rise, -1), (fall, 1)):
        assert voltage(gain, quadrature, carrier, angle) == pytest.approx(offset, abs=1e-8)
        later = voltage(gain, quadrature, carrier + 1e-4, angle)
        assert (later - offset) * slope > 0


def test_the_ends_of_the_table_meet():
    p = params()
    fill_errors(p, 0.1, -0.2, 0.3)
    assert p.rise.used == 1
    assert abs(p.rise.value[0] - p.rise.value[POINTS]) <= 1
    assert abs(p.fall.value[0] - p.fall.value[POINTS]) <= 1


def test_each_fault_has_its_own_signature():
    p = params()
    angle = np.arange(POINTS + 1) * 2 * np.pi / POINTS
    tables = {}
    for name, faults in (("gain", (0.01, 0, 0)), ("quadrature", (0, 0.01, 0)), ("offset", (0, 0, 0.01))):
        fill_errors(p, *faults)
        tables[name] = np.array(list(p.rise.value)) / TURN * 2 * np.pi, np.array(list(p.fall.value)) / TURN * 2 * np.pi
    # First order: unequal windings err twice per pitch, so do windings off the right angle; an offset is the same
    # everywhere and of opposite sign at the two edges.
    for rise_or_fall in (0, 1):
        assert tables["gain"][rise_or_fall] == pytest.approx(-0.005 * np.sin(2 * angle), abs=1e-4)
        assert tables["quadrature"][rise_or_fall] == pytest.approx(0.005 * (1 - np.cos(2 * angle)), abs=1e-4)
    assert tables["offset"][0] == pytest.approx(np.full(POINTS + 1, 0.01), abs=1e-4)
    assert tables["offset"][1] == pytest.approx(np.full(POINTS + 1, -0.01), abs=1e-4)


def edges(p: DetectorParams, cycles: int, counts: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of every rising and falling edge at position 0 [turn], early is positive."""
    r = Detector()
    r.noise.state = 7
    levels = [compare(p, r, n % counts, 0.0) for n in range(cycles * counts)]
    first = counts // 4  # in the middle of a low half
    change = np.diff(np.array(levels[first:]))
    at = {sign: np.flatnonzero(change == sign) + first + 1 for sign in (1, -1)}
    # Undisturbed, PS rises in the middle of the carrier cycle and falls at its end.
    return tuple((counts // 2 - (at[sign] + late) % counts) / counts for sign, late in ((1, 0), (-1, counts // 2)))


def test_jitter_has_its_rms_on_both_edges():
    counts, cycles = 64, 600
    p = params(counts, jitter=0.03 * TURN)
    rising, falling = edges(p, cycles, counts)
    assert abs(len(rising) - cycles) <= 1
    assert abs(len(falling) - cycles) <= 1
    for displacement in (rising, falling):
        # four standard deviations of mean and rms of so many edges; a count of 1/64 turn adds half a count of delay
        assert displacement.mean() + 0.5 / counts == pytest.approx(0.0, abs=4 * 0.03 / math.sqrt(cycles))
        assert displacement.std() == pytest.approx(
            math.hypot(0.03, 1 / 64 / math.sqrt(12)), rel=4 / math.sqrt(2 * cycles)
        )
    both = np.corrcoef(rising[: cycles - 1], falling[: cycles - 1])[0, 1]
    assert abs(both) < 4 / math.sqrt(cycles)  # each edge has its own


def test_jitter_never_lets_two_edges_meet():
    counts, cycles = 64, 300
    p = params(counts, jitter=float(TURN))
    rising, falling = edges(p, cycles, counts)
    assert abs(len(rising) - cycles) <= 1  # one of each per cycle, none lost
    assert abs(len(falling) - cycles) <= 1
    for displacement in (rising, falling):
        assert np.abs(displacement).max() <= JITTER_LIMIT + 1 / counts
        assert np.abs(displacement).max() > JITTER_LIMIT - 2 / counts
    r = Detector()
    r.noise.state = 7
    shakes = set()
    for n in range(100 * counts):
        compare(p, r, n % counts, 0.0)
        shakes.add(r.shake)
    assert max(abs(shake) for shake in shakes) == int(JITTER_LIMIT * TURN)


def test_the_same_seed_shakes_the_same():
    p = params(jitter=0.01 * TURN)
    waves = []
    for seed in (7, 7, 8):
        r = Detector()
        r.noise.state = seed
        shakes = []
        for n in range(20 * COUNTS):
            compare(p, r, n % COUNTS, 0.0)
            shakes.append(r.shake)
        waves.append(shakes)
    assert waves[0] == waves[1] != waves[2]
    assert max(waves[0]) <= FRACTION
