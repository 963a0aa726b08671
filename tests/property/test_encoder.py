"""Encoder and quadrature decoder for every motion."""

from hypothesis import given
from hypothesis import strategies as st

from detent.sensing.encoder import Encoder, EncoderParams, pass_left, pass_right, stand_at
from detent.sensing.quadrature import Quadrature, count_edge

PITCH = 84.667e-6 / 4

starts = st.floats(-10, 10)
motions = st.lists(st.floats(-30, 30), max_size=30)
"""Moves in quarter cycles."""
seeds = st.integers(0, 2**63 - 1)


def quarter(a: int, b: int) -> int:
    """Quarter of the cycle from the two levels: A leads B moving right."""
    return (0, 1)[b] if a else (3, 2)[b]


class Disc:
    """An encoder with its decoder, moved as the axis moves it: edges passed in order of place."""

    def __init__(self, start: float, *, jitter: float = 0.0, missing: float = 0.0, seed: int = 1) -> None:
        self.p = EncoderParams(edge_pitch=PITCH, jitter=jitter, missing=missing)
        self.r, self.q = Encoder(), Quadrature()
        self.x = start * PITCH
        stand_at(self.p, self.r, self.x, seed)
        self.q.count = self.r.edge
        self.q.channel_a, self.q.channel_b = self.r.channel_a, self.r.channel_b
        self.passed: list[float] = []
        """Places of the edges passed in the last move."""

    def move(self, quarters: float) -> None:
        self.x += quarters * PITCH
        self.passed = []
        while self.x >= self.r.next_right:
            self.passed.append(self.r.next_right)
            pass_right(self.p, self.r)
            self.count()
        while self.x < self.r.next_left:
            self.passed.append(self.r.next_left)
            pass_left(self.p, self.r)
            self.count()

    def count(self) -> None:
        count_edge(self.q, self.r.channel_a, self.r.channel_b)
        assert self.r.next_left < self.r.next_right
        assert self.q.illegal == 0


@given(start=starts, moves=motions)
def test_without_faults_the_count_is_the_floor_of_the_position(start, moves):
    disc = Disc(start)
    for quarters in moves:
        disc.move(quarters)
        assert disc.q.count == disc.r.edge
        assert disc.q.count * PITCH <= disc.x < (disc.q.count + 1) * PITCH


@given(start=starts, moves=motions, jitter=st.floats(0.01, 0.5), seed=seeds)
def test_jitter_never_makes_edges_overtake_and_never_loses_a_count(start, moves, jitter, seed):
    disc = Disc(start, jitter=jitter, seed=seed)
    for quarters in moves:
        disc.move(quarters)
        assert disc.passed == sorted(set(disc.passed), reverse=quarters < 0)
        assert disc.q.count == disc.r.edge
        assert disc.r.next_left <= disc.x < disc.r.next_right
        assert abs(disc.q.count + 0.5 - disc.x / PITCH) <= 0.5 + 0.45 + 1e-9  # an edge is within its own quarter


@given(start=starts, moves=motions, missing=st.floats(0.01, 1.0), jitter=st.sampled_from([0.0, 0.15]), seed=seeds)
def test_missing_pulses_lose_whole_cycles_only(start, moves, missing, jitter, seed):
    disc = Disc(start, missing=missing, jitter=jitter, seed=seed)
    # A start inside a missing pulse: the decoder's word for the present levels is not yet the disc's.
    disc.q.count += ((quarter(disc.q.channel_a, disc.q.channel_b) - disc.r.edge + 2) & 3) - 2
    for quarters in moves:
        disc.move(quarters)
        outside_pulse = disc.r.edge & 3 >= 2
        if outside_pulse:
            assert disc.r.channel_a == 0
            assert (disc.q.count - disc.r.edge) % 4 == 0
        assert abs(disc.q.count - disc.r.edge) <= 4 * (sum(abs(m) for m in moves) // 4 + 2)


@given(start=starts, there=st.floats(0, 40), seed=seeds)
def test_there_and_back_counts_to_zero_with_jitter(start, there, seed):
    disc = Disc(start, jitter=0.15, seed=seed)
    before = disc.q.count
    disc.move(there)
    assert disc.q.count >= before
    disc.move(-there - 2)
    disc.move(2)
    assert abs(disc.q.count - before) <= 1  # the edges met on the way back are the same but for their jitter
