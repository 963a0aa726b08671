import math

import numpy as np
import pytest

from detent.sensing.position_sensor import MEMORY, PositionSensor, PositionSensorParams, read_position, stand_sensor

T = 1e-3
COUNT = 1e-5


def sensor(**changes: float) -> PositionSensorParams:
    p = PositionSensorParams(period=T, span=1, smoothing=1.0)
    for name, value in changes.items():
        setattr(p, name, value)
    return p


def standing(p: PositionSensorParams, position: float = 0.0) -> PositionSensor:
    r = PositionSensor()
    stand_sensor(p, r, position)
    return r


@pytest.mark.parametrize("delay", [0, 1, 5, MEMORY - 2])
def test_a_position_is_read_after_the_delay(delay):
    p = sensor(delay=delay)
    r = standing(p, -1.0)
    read = []
    for k in range(200):
        read_position(p, r, float(k))
        read.append(r.position)
    assert read == [-1.0] * delay + [float(k) for k in range(200 - delay)]


@pytest.mark.parametrize(
    ("place", "count"), [(0.0, 0), (0.49, 0), (0.51, 1), (-0.49, 0), (-0.51, -1), (123456.4, 123456), (-7.6, -8)]
)
def test_the_nearest_count_is_read(place, count):
    p = sensor(resolution=COUNT)
    r = standing(p)
    read_position(p, r, place * COUNT)
    assert r.count == count
    assert r.position == count * COUNT


def test_without_a_resolution_the_position_itself_is_read():
    p = sensor()
    r = standing(p)
    read_position(p, r, math.pi)
    assert (r.position, r.count) == (math.pi, 0)


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
