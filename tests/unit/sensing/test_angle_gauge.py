import pytest

from detent.sensing.gauge import AngleGauge, read_angle_gauge, set_angle_gauge


@pytest.mark.parametrize("sign", [1, -1])
def test_the_peaks_are_the_largest_of_both_directions(sign):
    r = AngleGauge()
    for velocity, deviation in ((0.25, -3), (-0.75, 2), (0.5, 5), (0.0, -4)):
        read_angle_gauge(r, sign * velocity, sign * deviation)
    assert (r.peak_speed, r.peak_deviation) == (0.75, 5)


def test_setting_forgets_the_step_before():
    r = AngleGauge()
    read_angle_gauge(r, 3.0, -7)
    set_angle_gauge(r)
    assert bytes(r) == bytes(AngleGauge())
    read_angle_gauge(r, -0.5, 1)
    assert (r.peak_speed, r.peak_deviation) == (0.5, 1)
