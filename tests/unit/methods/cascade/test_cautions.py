"""Warnings about a cascade axis that can be built; each value that a remedy names ends its warning."""

from functools import partial

import pytest
from tests.remedies import check_caution

from detent.methods.cascade.checks import find_cautions

TUNED = ("method.position_gain=90.4", "method.velocity_gain=59.3 V*s/m", "method.velocity_integral=5.75 kV/m")
PID = (
    "method.structure=pid",
    "method.proportional=4 kV/m",
    "method.integral=20 kV/(m*s)",
    "method.derivative=100 V*s/m",
    "method.derivative_filter=0.2 ms",
)
FROM_ABOVE = [f"disturbance.push.{key}" for key in ("force=-80 N", "at=1 s", "duration=1 s")]


@pytest.fixture
def cautions(load_text, good_text, rotary_text):
    """Warnings of an example with overrides, by name."""

    def look(name, *overrides):
        text = {"cascade": good_text, "turntable": rotary_text}[name]
        return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}

    return look


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("cascade", TUNED),
        ("turntable", ()),
        ("cascade", (*PID, "method.derivative=60 V*s/m")),
        ("cascade", (*TUNED, "method.velocity_integral=0 V/m")),
        ("cascade", (*TUNED, "brake.force=150 N", "mechanics.weight=150 N")),
        ("turntable", ("mechanics.coupling.backlash=0.1 deg", "method.feedback.position=motor")),
    ],
)
def test_axes_with_nothing_to_warn_about(cautions, name, overrides):
    assert cautions(name, *overrides) == {}


CASES = [
    ("cascade", ["method.velocity_gain=300 V*s/m"], "stability of the loops"),
    ("cascade", ["method.velocity_gain=400 V*s/m", "method.velocity_integral=0 V/m"], "stability of the loops"),
    ("cascade", [*PID, "method.derivative=400 V*s/m"], "stability of the loops"),
    ("cascade", ["method.velocity_integral=10 MV/m", "method.position_gain=100000"], "stability of the loops"),
    (
        "cascade",
        ["method.velocity_gain=30 V*s/m", "method.velocity_integral=10 kV/m"],
        "phase margin of the velocity loop",
    ),
    ("cascade", [], "Ms at the command"),
    ("cascade", [*PID, "method.derivative=10 V*s/m"], "phase margin of the position loop"),
    ("cascade", ["method.position_gain=400"], "peak of the position loop"),
    ("cascade", ["mechanics.coupling.stiffness=5 N/um"], "bandwidth of the velocity loop"),
    ("turntable", ["encoder.resolution=0.01 deg"], "command noise from velocity quantization"),
    ("cascade", ["encoder.resolution=1 mm"], "command noise from velocity quantization"),
    (
        "cascade",
        [*PID, "encoder.resolution=10 um", "method.in_position=100 um"],
        "command noise from velocity quantization",
    ),
    ("cascade", ["method.in_position=0.5 um"], "method.in_position"),
    ("cascade", ["mechanics.friction.positive.static=700 N"], "friction and weight"),
    ("cascade", ["mechanics.weight=-700 N"], "friction and weight"),
    ("turntable", ["mechanics.pendulum=4 N*m"], "friction and weight"),
    (
        "cascade",
        ["mechanics.friction.positive.coulomb=550 N", "mechanics.friction.positive.static=550 N"],
        "force at limits.speed",
    ),
    ("turntable", ["drive.voltage_gain=0.3"], "force at limits.speed"),
    ("cascade", ["limits.acceleration=9 m/s^2"], "acceleration force"),
    ("cascade", ["limits.effort=6 kN"], "limits.effort"),
    ("turntable", ["limits.effort=5 N*m"], "limits.effort"),
    ("cascade", ["motor.max_current=0.3 A"], "current at limits.speed"),
    ("cascade", ["method.feed_forward.velocity=0", "method.following_error=10 mm"], "following error at limits.speed"),
    (
        "cascade",
        ["method.velocity_integral=0 V/m", "method.feed_forward.viscous=0", "method.velocity_limit=0.5 m/s"],
        "velocity demand at limits.speed",
    ),
    ("cascade", ["method.velocity_integral=0 V/m", "method.in_position=20 um"], "error at rest"),
    ("cascade", [*PID, "method.integral=0 V/(m*s)", "method.in_position=20 um"], "error at rest"),
    ("cascade", ["brake.force=20 N", "mechanics.weight=-150 N"], "brake.force"),
    (
        "cascade",
        ["brake.force=20 N", "mechanics.weight=150 N", *FROM_ABOVE],
        "brake.force",
    ),
    ("turntable", ["brake.force=10 mN*m", "mechanics.pendulum=0.1 N*m"], "brake.force"),
]


@pytest.mark.parametrize(("name", "overrides", "about"), CASES)
def test_caution(cautions, golden, name, overrides, about):
    caution = cautions(name, *overrides)[about]
    golden(f"{name}: {about}, {' '.join(overrides)}", caution)
    at_bound = about != "following error at limits.speed"  # the value named leaves half as much again
    check_caution(partial(cautions, name), overrides, about, caution, at_bound=at_bound)
