from dataclasses import replace
from pathlib import Path

import pytest

from detent.errors import DetentError
from detent.methods.load import load_spec
from detent.methods.method import Method
from detent.methods.position import Sensed
from detent.methods.registry import METHODS

EXAMPLES = Path(__file__).resolve().parents[3] / "src" / "detent" / "examples"
KINDS = {
    "print_head": (Sensed.INCREMENTAL, 25.4e-3 / 300),
    "phase_servo": (Sensed.BAND, None),
    "filtered_servo": (Sensed.INCREMENTAL, None),
    "rotary_table": (Sensed.ABSOLUTE, None),
    "stepper_envelope": (Sensed.INCREMENTAL, None),
    "cascade": (Sensed.INCREMENTAL, 1e-6),
}


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.toml")), ids=lambda file: file.stem)
def test_every_axis_says_what_counts_its_position(file):
    try:
        spec = load_spec(file)
    except DetentError:
        pytest.skip("no axis file")
    sensors = METHODS[spec.axis.method].sensors(spec)
    assert sensors
    for name, sensor in sensors.items():
        kind, scale = KINDS[spec.axis.method]
        assert sensor.kind is kind
        assert bool(name) == (spec.axis.method == "stepper_envelope")
        assert 1e-10 < sensor.scale < 1e-3
        assert scale is None or sensor.scale == pytest.approx(scale) or sensor.unit == "rad"
        assert (sensor.ends is None) == sensor.is_circle
        assert (sensor.band > 0) == (kind is not Sensed.INCREMENTAL)
        assert sensor.window >= 1
        for counts in (0, 1, 12_345, -7):
            assert sensor.counts(sensor.position(counts)) == counts


def test_a_turn_of_the_table_is_its_band():
    spec = load_spec(EXAMPLES / "rotary_table.toml")
    sensor = METHODS["rotary_table"].sensors(spec)[""]
    assert sensor.position(sensor.band) == pytest.approx(2 * 3.141592653589793)


def test_a_method_that_does_not_say_is_named():
    class Silent(Method):
        name = "silent"

    with pytest.raises(DetentError, match="silent"):
        Silent().sensors(load_spec(EXAMPLES / "cascade.toml"))


def test_a_circle_has_no_ends():
    sensor = METHODS["rotary_table"].sensors(load_spec(EXAMPLES / "rotary_table.toml"))[""]
    assert sensor.reach == (0, sensor.band - 1)
    assert replace(sensor, kind=Sensed.BAND).reach is None
