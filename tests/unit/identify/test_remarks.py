"""What to know about constants that would be read wrongly."""

import numpy as np
import pytest
from tests.log_rig import make_log

from detent.identify.fit.estimate import estimate
from detent.identify.remarks import early, friction_remarks


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
