"""Warnings about a cascade axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.remedies import alternatives

from detent.methods.cascade import cautions as module
from detent.methods.cascade.cautions import find_cautions

PID = (
    "method.structure=pid",
    "method.proportional=4 kV/m",
    "method.integral=20 kV/(m*s)",
    "method.derivative=100 V*s/m",
    "method.derivative_filter=0.2 ms",
)


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
        ("cascade", ()),
        ("turntable", ()),
        ("cascade", PID),
        ("cascade", ("method.velocity_integral=0 V/m",)),
        ("turntable", ("mechanics.coupling.backlash=0.1 deg", "method.feedback.position=motor")),
    ],
)
def test_axes_with_nothing_to_warn_about(cautions, name, overrides):
    assert cautions(name, *overrides) == {}


CASES = [
    (
        "cascade",
        ["method.velocity_gain=300 V*s/m"],
        "stability of the loops",
        ["gain margin 1.1", "a little more gain", "and method.velocity_integral ="],
    ),
    (
        "cascade",
        ["method.velocity_gain=400 V*s/m", "method.velocity_integral=0 V/m"],
        "stability of the loops",
        ["gain margin 0.8", "spectral radius 1.0", "the swing grows", "set method.velocity_gain ="],
    ),
    (
        "cascade",
        [*PID, "method.derivative=400 V*s/m"],
        "stability of the loops",
        ["gain margin 0.63", "lower method.proportional, method.integral and method.derivative to 42 %"],
    ),
    (
        "cascade",
        ["method.velocity_integral=10 MV/m", "method.position_gain=100000"],
        "stability of the loops",
        ["gain margin 0, ", "lower all gains, those of integrals and of the position first"],
    ),
    (
        "cascade",
        ["method.velocity_gain=30 V*s/m", "method.velocity_integral=10 kV/m"],
        "phase margin of the velocity loop",
        ["22.", "at least 30 deg", "dead time of 800 us"],
    ),
    ("cascade", [*PID, "method.derivative=10 V*s/m"], "phase margin of the position loop", ["it rings"]),
    (
        "cascade",
        ["method.position_gain=200"],
        "bandwidth of the position loop",
        ["32.", "up to half that of the velocity loop", "lower method.position_gain"],
    ),
    (
        "cascade",
        ["mechanics.coupling.stiffness=5 N/um"],
        "bandwidth of the velocity loop",
        ["up to half the anti-resonance, 32.49 Hz", "stiffen the coupling"],
    ),
    (
        "turntable",
        ["mechanics.coupling.backlash=0.1 deg"],
        "backlash in the position loop",
        ["0.1 deg", "hunts from flank to flank"],
    ),
    ("turntable", ["encoder.resolution=0.01 deg"], "command of one count of velocity", ["1.396 V", "1 V"]),
    (
        "cascade",
        ["encoder.resolution=1 mm"],
        "command of one count of velocity",
        ["do: set encoder.velocity_filter, or use a finer encoder"],
    ),
    (
        "cascade",
        [*PID, "encoder.resolution=10 um", "method.in_position=100 um"],
        "command of one count of velocity",
        ["a tenth of the largest command", "set encoder.velocity_span ="],
    ),
    ("cascade", ["method.in_position=0.5 um"], "method.in_position", ["a count of the encoder, 1 um"]),
    ("cascade", ["mechanics.friction.positive.static=700 N"], "friction and weight", ["709.2 N", "never breaks loose"]),
    ("cascade", ["mechanics.weight=-700 N"], "friction and weight", ["below the largest force, 600 N"]),
    (
        "turntable",
        ["mechanics.pendulum=4 N*m"],
        "friction and weight",
        ["4.23 N*m", "places where the axis never breaks loose"],
    ),
    (
        "cascade",
        ["mechanics.friction.positive.coulomb=550 N", "mechanics.friction.positive.static=550 N"],
        "force at limits.speed",
        ["618 N", "grows without end"],
    ),
    ("turntable", ["drive.voltage_gain=0.3"], "force at limits.speed", ["what the drive has at that speed, 0 N*m"]),
    ("cascade", ["limits.acceleration=9 m/s^2"], "force of an acceleration", ["637.2 N", "570 N"]),
    ("cascade", ["limits.effort=6 kN"], "limits.effort", ["what the drive gives at standstill, 1.759 kN"]),
    ("turntable", ["limits.effort=5 N*m"], "limits.effort", ["3.168 N*m", "the drive is weaker"]),
    ("cascade", ["motor.max_current=0.3 A"], "current at limits.speed", ["372.9 mA", "too hot"]),
    (
        "cascade",
        ["method.feed_forward.velocity=0", "method.following_error=10 mm"],
        "following error at limits.speed",
        ["12.5 mm", "the drive goes off"],
    ),
    (
        "cascade",
        ["method.velocity_integral=0 V/m", "method.feed_forward.viscous=0", "method.velocity_limit=0.5 m/s"],
        "velocity demand at limits.speed",
        ["503.", "state method.velocity_integral"],
    ),
    (
        "cascade",
        ["method.velocity_integral=0 V/m", "method.in_position=20 um"],
        "error at rest",
        ["up to method.in_position, 20 um", "state method.velocity_integral"],
    ),
    (
        "cascade",
        [*PID, "method.integral=0 V/(m*s)", "method.in_position=20 um"],
        "error at rest",
        ["do: state method.integral"],
    ),
]


@pytest.mark.parametrize(("name", "overrides", "about", "texts"), CASES)
def test_caution(cautions, name, overrides, about, texts):
    caution = cautions(name, *overrides)[about]
    for text in texts:
        assert text in str(caution)
    for alternative in alternatives(caution.remedy):
        assert about not in cautions(name, *overrides, *alternative), alternative


def test_every_look_finds_something(cautions, monkeypatch):
    found = set()

    def noting(look):
        def run(machine):
            for caution in look(machine):
                found.add(look.__name__)
                yield caution

        return run

    looks = module._LOOKS
    monkeypatch.setattr(module, "_LOOKS", tuple(noting(look) for look in looks))
    for name, overrides, _, _ in CASES:
        cautions(name, *overrides)
    assert found == {look.__name__ for look in looks}
