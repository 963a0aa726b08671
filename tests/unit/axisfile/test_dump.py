"""From a specification back to an axis file."""

import pytest
from tests.dump import dump_spec


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("encoder.jitter=5 deg", "encoder.missing_edges=0.001", "method.trim=false", "motor.max_current=2 A"),
        ("disturbance.motor_constant=+10 %", "disturbance.friction_left=-7.3 %", "disturbance.supply=35.5 V"),
        ("disturbance.obstacle.position=7 in",),
        ("disturbance.push.force=-3 N", "disturbance.push.at=2 s", "disturbance.push.duration=60 ms"),
        ('axis.name="a \\ and b"', "method.max_print_speed=33 in/s"),
        ("motor.catalogue=Faulhaber 2657W048CXR",),
    ],
)
def test_loading_what_was_dumped_gives_the_same_specification(load_text, good_text, overrides):
    spec = load_text(good_text, *overrides).spec
    assert load_text(dump_spec(spec)).spec == spec


def test_the_text_is_an_axis_file_with_everything_stated(load_text, good_text):
    text = dump_spec(load_text(good_text).spec)
    assert text.startswith('[axis]\nname = "print head"\n')
    assert 'travel = "0.3683 m"' in text
    assert "[mechanics.friction.left]" in text
    assert "[print]" in text
    assert "obstacle" not in text
    origins = load_text(text).origins
    assert all(origin.startswith("line ") for origin in origins.values())


def test_quotes_and_foreign_letters_in_a_name(load_text, good_text):
    text = good_text.replace('"print head"', "'Käfer \"7\" \U0001f5a8'")
    spec = load_text(text).spec
    assert spec.axis.name == 'Käfer "7" \U0001f5a8'
    assert load_text(dump_spec(spec)).spec == spec
