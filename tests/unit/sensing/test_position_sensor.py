import math

import numpy as np
import pytest

from detent.sensing.position_sensor import (
    MEMORY,
    EncoderWord,
    PositionSensor,
    PositionSensorParams,
    read_word,
    stand_sensor,
)

T = 1e-3
COUNT = 1e-5


def sensor(**changes: float) -> PositionSensorParams:
    p = PositionSensorParams(period=T, span=1, smoothing=1.0)
    for name, value in changes.items():
        setattr(p, name, value)
    return p


def word_of(p: PositionSensorParams, position: float) -> EncoderWord:
    if p.resolution == 0.0:
        return EncoderWord(place=position)
    return EncoderWord(count=math.floor(position / p.resolution + 0.5))


def standing(p: PositionSensorParams, position: float = 0.0) -> PositionSensor:
    r = PositionSensor()
    stand_sensor(p, r, word_of(p, position))
    return r


def read_position(p: PositionSensorParams, r: PositionSensor, position: float) -> None:
    read_word(p, r, word_of(p, position))


@pytest.mark.parametrize("delay", [0, 1, 5, MEMORY - 2])
def test_a_position_is_read_after_the_delay(delay):
    p = sensor(delay=delay)
    r = standing(p, -1.0)
    read = []
    for k in range(200):
        read_position(p, r, float(k))
        read.append(r.position)
    assert read == [-1.0] * delay + [float(k) for k in range(200 - delay)]


def test_a_count_stands_for_its_place():
    p = sensor(resolution=COUNT)
    r = standing(p)
    read_word(p, r, EncoderWord(count=-8, place=0.3))
    assert r.position == -8 * COUNT


def test_an_ideal_encoder_shows_the_position_itself():
    p = sensor()
    r = standing(p)
    read_word(p, r, EncoderWord(count=5, place=math.pi))
    assert r.position == math.pi


@pytest.mark.parametrize("span", [1, 2, 4, 10])
def test_the_velocity_lags_by_half_its_span_and_the_delay(span):
    p = sensor(span=span, delay=3)
    r = standing(p)
    acceleration = 7.0
    for k in range(40):
        read_position(p, r, 0.5 * acceleration * (k * T) ** 2)
    assert r.velocity == pytest.approx(acceleration * (39 - 3 - span / 2) * T, rel=1e-9)


def test_a_longer_span_makes_the_noise_of_a_count_smaller():
    noise = []
    for span in (1, 8):
        p = sensor(span=span, resolution=COUNT)
        r = standing(p)
        velocity = []
        for k in range(1000):
            read_position(p, r, k * 0.37 * COUNT)
            velocity.append(r.velocity)
        assert np.mean(velocity[100:]) == pytest.approx(0.37 * COUNT / T, rel=0.01)
        noise.append(max(velocity[100:]) - min(velocity[100:]))
    assert noise == pytest.approx([COUNT / T, COUNT / T / 8], rel=1e-6)


def test_the_filter_is_of_first_order():
    p = sensor(smoothing=0.2)
    r = standing(p)
    for k in range(1, 30):
        read_position(p, r, k * 0.001)
        assert r.velocity == pytest.approx(1.0 - 0.8**k, rel=1e-12)


def test_after_power_on_it_has_stood_there_for_long():
    p = sensor(resolution=COUNT, span=30, delay=20)
    r = standing(p, 0.1234567)
    for _ in range(3 * MEMORY):
        read_position(p, r, 0.1234567)
        assert (r.position, r.velocity) == (12346 * COUNT, 0.0)


def test_a_word_that_is_none_leaves_the_position_where_it_was():
    p = sensor(resolution=COUNT)
    r = standing(p, 5 * COUNT)
    read_word(p, r, EncoderWord(count=900, lost=1))
    assert (r.position, r.velocity) == (5 * COUNT, 0.0)
    read_word(p, r, EncoderWord(count=7))
    assert r.position == 7 * COUNT
