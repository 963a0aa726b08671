"""Frames on a serial line, in Python and in C."""

import ctypes

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.live_frames import InC, counts, in_c, needs_cc, receive_all

from detent.operate.drivers.frames import LONGEST, NUMBERS, Frame, Receiver, decode, encode, stuffed, unstuffed


@pytest.fixture(scope="module")
def c(tmp_path_factory):
    return in_c(tmp_path_factory.mktemp("frames"))


@given(st.binary(max_size=254))
def test_what_is_stuffed_has_no_zero_and_comes_back(data):
    assert 0 not in stuffed(data)
    assert unstuffed(stuffed(data)) == data


@needs_cc
@given(st.integers(0, 255), st.integers(0, NUMBERS - 1), st.binary(max_size=LONGEST))
def test_both_languages_write_the_same_frame(c, kind, number, payload):
    line = ctypes.create_string_buffer(LONGEST + 8)
    count = c.encode(kind, number, payload, len(payload), line)
    assert line.raw[:count] == encode(kind, number, payload)
    assert decode(line.raw[: count - 1]) == Frame(kind, number, payload)


@needs_cc
@given(
    st.lists(
        st.one_of(st.binary(max_size=300), st.builds(encode, st.just(1), st.integers(0, 9), st.binary(max_size=9)))
    )
)
def test_whatever_comes_both_receivers_give_the_same(c, pieces):
    ours, theirs = Receiver(), InC(c)
    for piece in pieces:
        assert ours.feed(piece) == theirs.feed(piece)
        assert counts(ours) == theirs.counts


def test_a_payload_that_is_too_long_is_refused():
    with pytest.raises(ValueError, match="251 bytes"):
        encode(1, 0, bytes(LONGEST + 1))


def test_doubled_frames_are_given_out_once_and_gaps_are_counted():
    receiver = Receiver()
    line = [encode(1, number, bytes([number & 0xFF])) for number in range(65_530, 65_546)]
    sent = [*line[0:3], line[2], *line[5:], line[4]]
    found = [frame.number for frame in receiver.feed(b"".join(sent))]
    assert found == [65_530, 65_531, 65_532, 65_535, *range(10)]
    assert counts(receiver) == (14, 0, 2, 2)


@needs_cc
def test_a_disturbed_line_is_the_same_for_both(c):
    receive_all(c, 2_000, 1)
