"""Transfer function of a servo with filtered speed feedback (filtered-servo spec 3.6); its tables: tests/acceptance."""

from math import inf

import numpy as np
import pytest

from detent.analysis.sampled_loop import SampledLoop
from detent.analysis.transfer_function import ServoTransfer
from detent.errors import DetentError

SERVO = ServoTransfer(gain=1e5, speed_gain=0.03, filter_time=2e-3, position_gain=1.5)


def test_poles_and_response_for_any_position_gain():
    s = SERVO.poles()
    assert 1 / SERVO.gain * s**2 / 1.5 + 0.02 * s / (2e-3 * s + 1) + 1 == pytest.approx(0, abs=1e-9)
    s = 2j * np.pi * 3.0
    formula = 1 / (s**2 / (1.5 * 1e5) + 0.02 * s / (2e-3 * s + 1) + 1)
    assert complex(SERVO.response(3.0)) == pytest.approx(formula, rel=1e-12)


def test_response_keeps_the_shape_of_the_frequencies():
    frequency_hz = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    assert SERVO.response(frequency_hz).shape == SERVO.first_order_response(frequency_hz).shape == (2, 3)
    assert SERVO.response(0.0) == SERVO.first_order_response(0.0) == 1.0


def test_first_order_form():
    assert SERVO.lag == pytest.approx(0.02)
    assert SERVO.velocity_error_constant == pytest.approx(50)
    assert SERVO.first_order_pole == pytest.approx(-50)
    corner_hz = 50 / (2 * np.pi)
    assert complex(SERVO.first_order_response(corner_hz)) == pytest.approx(1 / (1 + 1j))


def test_next_order_pole_and_ratios():
    assert SERVO.next_order_pole == pytest.approx(-1 / 0.022)
    assert SERVO.filter_ratio == pytest.approx(0.1)
    assert SERVO.inertia_ratio == pytest.approx((1 / 1.5e5) ** 0.5 / 0.02)


def test_without_filter_the_loop_is_of_second_order():
    servo = ServoTransfer(gain=4000, speed_gain=0.02)
    natural, damping_ratio = 4000**0.5, 0.02 * 4000**0.5 / 2  # spec 7: 0.63
    assert damping_ratio == pytest.approx(0.63, abs=0.005)
    expected = natural * (-damping_ratio + 1j * (1 - damping_ratio**2) ** 0.5)
    assert servo.poles() == pytest.approx([expected, expected.conjugate()])


@pytest.mark.parametrize("sample_period", [2.5e-3, 5e-3, 10e-3])
def test_one_sample_clock_scales_lag_and_loop_together(sample_period):
    servo = ServoTransfer.of_window(gain=1500, sample_period=sample_period, scale=4, coefficient=0.25)
    assert servo.filter_time == pytest.approx(4 * sample_period)
    assert servo.velocity_error_constant == pytest.approx(0.25 / sample_period)  # 100, 50, 25 1/s
    assert servo.filter_ratio == pytest.approx(1)


def test_a_window_without_filter_has_no_lag():
    servo = ServoTransfer.of_window(gain=4000, sample_period=5e-3, scale=4, position_gain=2)
    assert (servo.filter_time, servo.speed_gain, servo.position_gain) == (0, 0.02, 2)


@pytest.mark.parametrize(("gain", "filter_time"), [(1e6, 1e-3), (1e6, 2e-3), (1e4, 1e-3), (1e4, 20e-3)])
def test_the_sampled_loop_tends_to_these_poles(gain, filter_time):
    """Spec, test 26, as a limit: fixed K2 and Tf, ever shorter windows; the difference shrinks with them."""
    poles = ServoTransfer(gain=gain, speed_gain=0.02, filter_time=filter_time).poles()
    errors = []
    for period in (2e-6, 1e-6):
        loop = SampledLoop(gain=gain, sample_period=period, scale=0.02 / period, coefficient=period / filter_time)
        errors.append(np.abs(loop.poles() / poles - 1).max())
    assert errors[1] < 0.01
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"gain": 0.0}, r"^ServoTransfer.gain: got 0 1/s\^2; expected: above 0 and finite; try: state K = "),
        ({"speed_gain": -0.02}, r"^ServoTransfer.speed_gain: got -0.02 s; expected: above 0 and finite; try: state K2"),
        ({"filter_time": -1e-3}, r"^ServoTransfer.filter_time: got -0.001 s; expected: 0 or above, finite; try: state"),
        ({"filter_time": inf}, r"^ServoTransfer.filter_time: got inf s"),
        ({"filter_time": float("nan")}, r"^ServoTransfer.filter_time: got nan s"),
        ({"position_gain": float("nan")}, r"^ServoTransfer.position_gain: got nan; expected: above 0 and finite"),
    ],
)
def test_constants_that_describe_no_servo_are_refused(wrong, message):
    with pytest.raises(DetentError, match=message):
        ServoTransfer(**({"gain": 1e6, "speed_gain": 0.02} | wrong))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"sample_period": 0.0}, r"^sample_period: got 0 s; expected: above 0 and finite"),
        ({"scale": inf}, r"^scale: got inf; expected: above 0 and finite"),
        ({"coefficient": 1.5}, r"^coefficient: got 1.5; expected: above 0, up to 1; try: state A"),
    ],
)
def test_windows_that_describe_no_servo_are_refused(wrong, message):
    with pytest.raises(DetentError, match=message):
        ServoTransfer.of_window(**({"gain": 4000, "sample_period": 5e-3, "scale": 4} | wrong))
