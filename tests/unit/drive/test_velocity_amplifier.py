import pytest

from detent.drive.velocity_amplifier import VelocityAmplifier, VelocityAmplifierParams, drive_torque

P = VelocityAmplifierParams(speed_per_count=0.1, stiffness=0.05, max_torque=1.0)


@pytest.mark.parametrize(
    ("word", "velocity", "standstill", "torque", "limited"),
    [
        (0, 0.0, 0.0, 0.0, 0),
        (100, 0.0, 0.5, 0.5, 0),
        (100, 10.0, 0.5, 0.0, 0),
        (100, 12.0, 0.5, -0.1, 0),
        (200, 0.0, 1.0, 1.0, 0),  # just within
        (201, 0.0, 1.0, 1.0, 1),
        (-2047, 0.0, -1.0, -1.0, 1),
        (-2047, -200.0, -10.235, -0.235, 0),  # fast already: within the limit again
        (0, 21.0, -1.0, -1.0, 1),
    ],
)
def test_torque_in_proportion_to_the_speed_error_up_to_the_limit(word, velocity, standstill, torque, limited):
    r = VelocityAmplifier()
    assert drive_torque(P, r, word, velocity) == pytest.approx(standstill)
    assert (r.torque, r.limited) == (pytest.approx(torque, abs=1e-12), limited)
