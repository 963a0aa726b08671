"""What to know about constants that would be read wrongly."""

import numpy as np
import pytest
from scipy import signal
from tests.log_rig import make_log

from detent.identify.fit.estimate import estimate
from detent.identify.fit.identification import identify
from detent.identify.remarks import early, friction_remarks, two_masses
from detent.logs.log import Log


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        (2e-4, 1e-4, None),
        (0.0, 1e-4, None),
        (-1e-4, 2e-4, "not significantly different from 0"),
        (-7e-4, 1e-4, "negative, which is not causal"),
    ],
)
def test_a_delay_below_zero_is_said(value: float, error: float, told: str | None) -> None:
    found = list(early({"delay": estimate("delay", value, "s", error, "test")}))
    assert len(found) == (told is not None)
    assert told is None or told in found[0]


def test_friction_of_steady_speeds_that_differs_from_that_of_all_motion_is_said() -> None:
    rng = np.random.default_rng(4)
    speed = np.repeat([0.1, 0.2, -0.1, -0.2] * 2, 2000)
    force = np.sign(speed) * 3.0 + 20.0 * speed + 0.05 * rng.normal(size=len(speed))
    log = make_log(np.arange(len(speed)) * 1e-3, position=np.cumsum(speed) * 1e-3, force=force)
    same = {f"viscous.{way}": estimate(f"viscous.{way}", 20.0, "N*s/m", 0.2, "t") for way in ("positive", "negative")}
    assert list(friction_remarks(log, "force", same)) == []
    other = same | {"viscous.negative": estimate("viscous.negative", 30.0, "N*s/m", 0.2, "t")}
    (told,) = friction_remarks(log, "force", other)
    assert "negative direction" in told
    assert "0.1 to 0.2 m/s" in told
    # A constant in another unit is not compared.
    assert list(friction_remarks(log, "force", {"viscous.negative": estimate("v", 30.0, "V*s/m", 0.2, "t")})) == []


def _swung(coupling: float) -> Log:
    """A multisine of 0.5 to 40 Hz by voltage on two masses of 1 and 0.5 V s2/m, seen at the motor."""
    step, period, times = 1e-3, 4.0, 8
    rng = np.random.default_rng(7)
    t = np.arange(round(period / step)) * step
    lines = np.arange(2, 161) / period
    volts = np.tile(
        sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(lines, rng.uniform(0, 6.3, 159), strict=True)), times
    )
    a = np.array(
        [[0, 1, 0, 0], [-coupling, -4.0, coupling, 2.0], [0, 0, 0, 1], [2 * coupling, 4.0, -2 * coupling, -4.5]]
    )
    moved = signal.dlsim(signal.cont2discrete((a, np.array([[0], [1.0], [0], [0]]), np.eye(4)[:1], 0), step), volts)[1]
    position = moved[:, 0] + 1e-7 * rng.normal(size=len(volts))
    return make_log(np.arange(len(volts)) * step, position=position, voltage=volts)


@pytest.mark.compiled
def test_a_log_of_two_masses_says_so_and_one_of_a_stiff_axis_does_not() -> None:
    """k = 4000: 2 k over the load's 1 makes 14.2 Hz, and 3 k a resonance of 17.4 Hz."""
    (told,) = two_masses(identify([_swung(4000.0)]))
    assert "this is two masses" in told
    assert "anti-resonance at 14.2 Hz and a resonance at 17.4 Hz" in told
    assert "detent analyse" in told
    assert list(two_masses(identify([_swung(4e6)]))) == []
