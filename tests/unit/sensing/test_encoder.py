import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.sensing.encoder import JITTER_LIMIT, Encoder, EncoderParams, is_one_edge, pass_left, pass_right, stand_at
from detent.sensing.quadrature import Quadrature, count_edge

PITCH = 84.667e-6 / 4


def encoder(position: float = 0.0, *, jitter: float = 0.0, missing: float = 0.0, seed: int = 1):
    """An encoder at power-on."""
    p, r = EncoderParams(edge_pitch=PITCH, jitter=jitter, missing=missing), Encoder()
    stand_at(p, r, position, seed)
    return p, r


@pytest.mark.parametrize("quarters", [0.0, 0.5, 1.5, 2.5, 3.5, 4.2, 1001.7, -0.5, -3.7])
def test_power_on_between_the_two_edges_around_the_carriage(quarters):
    _, r = encoder(quarters * PITCH)
    assert r.edge == np.floor(quarters)
    assert r.next_left <= quarters * PITCH < r.next_right
    assert r.next_right - r.next_left == pytest.approx(PITCH)


def test_channel_a_leads_moving_right():
    p, r = encoder(0.5 * PITCH)
    levels = [(r.channel_a, r.channel_b)]
    for _ in range(4):
        pass_right(p, r)
        levels.append((r.channel_a, r.channel_b))
    assert levels == [(1, 0), (1, 1), (0, 1), (0, 0), (1, 0)]
    back = []
    for _ in range(4):
        pass_left(p, r)
        back.append((r.channel_a, r.channel_b))
    assert back == levels[-2::-1]


def test_edges_of_a_perfect_disc_are_equally_spaced():
    p, r = encoder()
    places = []
    for _ in range(100):
        places.append(r.next_right)
        pass_right(p, r)
    assert np.array(places) == pytest.approx(PITCH * np.arange(1, 101))


def test_jitter_has_its_rms_and_stays_within_a_quarter():
    p, r = encoder(jitter=0.15)
    shifts = []
    for _ in range(20_000):
        shifts.append(r.next_right / PITCH - (r.edge + 1))
        pass_right(p, r)
    assert np.std(shifts) == pytest.approx(0.15, rel=0.03)
    assert abs(np.mean(shifts)) < 0.01
    assert np.max(np.abs(shifts)) <= JITTER_LIMIT + 1e-12
    assert np.max(np.abs(shifts)) > 0.4  # three times the rms is reached


def test_an_edge_turned_back_from_stays_where_it_was():
    p, r = encoder(jitter=0.2)
    for _ in range(7):
        pass_right(p, r)
    edge = r.next_right
    pass_right(p, r)
    assert r.next_left == edge
    pass_left(p, r)
    assert r.next_right == edge


def test_one_seed_one_disc():
    def places(seed: int) -> list[float]:
        p, r = encoder(jitter=0.1, seed=seed)
        found = []
        for _ in range(50):
            pass_right(p, r)
            found.append(r.next_right)
        return found

    assert places(3) == places(3)
    assert places(3) != places(4)


def test_share_of_missing_pulses():
    p, r = encoder(missing=0.1)
    pulses = 20_000
    missed = 0
    for _ in range(4 * pulses):
        pass_right(p, r)
        missed += r.edge & 3 == 0 and r.masked
    assert missed / pulses == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / pulses))


@pytest.mark.parametrize("step", [pass_right, pass_left])
def test_a_missing_pulse_of_channel_a_loses_one_whole_cycle_and_is_never_illegal(step):
    p, r = encoder(2.5 * PITCH)
    q = Quadrature(count=2, channel_a=r.channel_a, channel_b=r.channel_b)
    p.missing = 1.0
    for _ in range(4):  # one cycle, its pulse missing
        step(p, r)
        assert r.channel_a == 0
        count_edge(q, r.channel_a, r.channel_b)
    assert q.count == 2
    p.missing = 0.0
    for _ in range(4):
        step(p, r)
        count_edge(q, r.channel_a, r.channel_b)
    assert q.count == 2 + (4 if step is pass_right else -4)
    assert q.illegal == 0


@pytest.mark.parametrize("origin", [0.0, -0.5 * PITCH])
def test_one_edge_is_promised_only_where_jitter_cannot_make_it_two(origin):
    p, r = encoder(1001.5 * PITCH)
    p.origin = origin
    stand_at(p, r, 1001.5 * PITCH + origin, 1)
    places = np.array([999.9, 1000.4, 1000.5, 1001.1, 1001.9, 1002.5, 1002.6, 1003.1]) * PITCH + origin
    assert [is_one_edge(p, r, x) for x in places] == [False, False, True, True, True, True, False, False]


@given(position=st.floats(-1.0, 1.0), pitch=st.floats(1e-7, 1e-3), origin=st.floats(-0.1, 0.1))
def test_disc_stands_between_its_edges_at_power_on(position, pitch, origin):
    p, r = EncoderParams(edge_pitch=pitch, origin=origin), Encoder()
    stand_at(p, r, position, 1)
    assert r.next_left <= position < r.next_right
