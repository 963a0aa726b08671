"""Warnings about a phase-servo axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.phase_servo_rig import Rig
from tests.remedies import alternatives

from detent.methods.phase_servo.cautions import find_cautions

BURST = '[disturbance.lines.burst]\nkind = "{}"\n{}\n'


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


@pytest.mark.parametrize("order", ["robust", "literal"])
def test_the_default_plant_has_nothing_to_warn_about(load_text, good_text, order):
    assert cautions(load_text, good_text, f"clock.order={order}") == {}


CASES = [
    (
        ["motor.inductance=0.2 mH"],
        "PWM frequency",
        ["31.25 kHz, 19.6 x", "above 20 x", 'set motor.inductance = "203.8 uH"'],
    ),
    (
        ["motor.inductance=40 uH"],
        "current within a tick",
        ["163.5 mA", "2 % of limits.effort, 120 mA", "raise clock.oscillator"],
    ),
    (["drive.supply=11 V"], "stall current", ["5.5 A", "above limits.effort, 6 A", 'set limits.effort = "5.5 A"']),
    (["motor.max_current=4 A"], "current limit", ["6 A", "up to motor.max_current, 4 A", 'limits.effort = "4 A"']),
    (
        ["motor.max_current=4 A", "drive.supply=10 V"],
        "current limit",
        ["5 A", "up to motor.max_current, 4 A", "overheats"],
    ),
    (
        ["method.table_acceleration=40 m/s^2"],
        "force at the current limit",
        ["37.11 N, for 33.6 m/s^2", "a m + friction, 43.97 N", 'set method.table_acceleration = "33.61 m/s^2"'],
    ),
    (
        ["limits.effort=0.1 A"],
        "force at the current limit",
        ["for 0 m/s^2 against friction", "raise limits.effort"],
    ),
    (
        ["mechanics.carriage_mass=1.6 kg"],
        "deceleration from the change of mode",
        ["19.32 m/s^2 from 45.22 mm/s within 52.92 um", "17.41 m/s^2", "raise method.threshold"],
    ),
    (
        ["method.ready_time=2 ms"],
        "method.ready_time",
        ["2 ms", "the time of an even stop from the change of mode, 2.341 ms", 'set method.ready_time = "2.341 ms"'],
    ),
    (
        ["drive.supply=2.4 V", "limits.effort=1.2 A"],
        "supply",
        ["enough for 335.8 mm/s", "348.8 mm/s", 'set limits.speed = "335.7 mm/s"'],
    ),
    (
        ["drive.supply=0.2 V", "limits.effort=0.1 A"],
        "supply",
        ["enough for 0 m/s", "raise drive.supply"],
    ),
    (
        ["limits.speed=0.37 m/s"],
        "speed above the table, slew limit of the tracker",
        ["28 + 4 counts", "up to 31.51 counts", "pulses are lost", 'set limits.speed = "361.7 mm/s"'],
    ),
    (
        ["method.speed_bits=6", "clock.sample_tap=13", "clock.oscillator=16 MHz", "limits.speed=0.38 m/s"],
        "speed above the table, range of the speed word",
        ["29 + 4 counts", "up to 31 counts", "runs over", 'set limits.speed = "361.7 mm/s" or raise method.speed_bits'],
    ),
    (
        ["method.position_gains=[4, 16, 3]", "drive.pwm_bits=9", "drive.supply=240 V"],
        "gain margin of the position loop",
        ["0.325", "at least 1.5", "oscillates"],
    ),
    (
        ["mechanics.friction.right.static=5 N"],
        "drive that breaks the carriage loose",
        ["8.62 counts, 2.16 steps", "2 steps, 8 counts", "set method.position_gains = [5, 16, 1] or lower friction"],
    ),
    (
        ["clock.integrate_tap=11"],
        "pace of the integral",
        ["1.71 steps", "up to 1.5", "hunts for ever", "set clock.integrate_tap = 12"],
    ),
    (["method.dead_band=0"], "method.dead_band", ["hunts across the boundary", "set method.dead_band = 1"]),
    (
        ["method.integral_limit=2"],
        "method.integral_limit",
        ["2, worth 2 counts", "2.07 counts", "set method.integral_limit = 3"],
    ),
    (
        ["detector.lag_counts=20"],
        "detector.lag_counts",
        ["20, 5 steps from N/4 - 1", "stops 5 steps right", "set detector.lag_counts = 15"],
    ),
    (["detector.lag_counts=12"], "detector.lag_counts", ["stops 3 steps left"]),
    (["detector.lag_counts=40"], "detector.lag_counts", ["another place of the pitch"]),
    (
        ["detector.jitter=60 ns"],
        "detector.jitter",
        ["up to 0.72 steps", "up to 0.25 step", "pairs of opposite pulses", 'set detector.jitter = "20.83 ns"'],
    ),
    (
        ["disturbance.lines.inserted=20 Hz"],
        "pulses of disturbance.lines",
        ["21.1 in the longest move, 1.054 s", "method.expected_spurious, 20", '"18.96 Hz" together'],
    ),
]


@pytest.mark.parametrize(("overrides", "name", "words"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    found = cautions(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])
    for alternative in alternatives(found[name].remedy):
        assert name not in cautions(load_text, good_text, *overrides, *alternative), alternative


@pytest.mark.parametrize(
    ("kind", "more", "remedy"),
    [
        ("+", 'at = "5 ms"\ncount = 22', "set method.expected_spurious = 22"),
        ("-", 'at = "5 ms"\ncount = 30', "set disturbance.lines.burst.count = 20"),
        ("remove", f"ticks = {list(range(20000, 20031))}", "list fewer ticks"),
    ],
)
def test_a_burst_beyond_what_is_expected(load_text, good_text, kind, more, remedy):
    text = good_text + BURST.format(kind, more)
    found = cautions(load_text, text)["pulses of disturbance.lines.burst"]
    assert "up to method.expected_spurious, 20" in str(found)
    assert found.remedy == remedy
    for alternative in alternatives(remedy):
        assert cautions(load_text, text, *alternative) == {}


def test_what_a_burst_may_do_without_a_word(load_text, good_text):
    assert cautions(load_text, good_text + BURST.format("+", 'at = "5 ms"\ncount = 20')) == {}
    assert cautions(load_text, good_text + BURST.format("lose sample", 'at = "5 ms"\ncount = 64')) == {}


def test_what_is_switched_off_is_not_warned_about(load_text, good_text):
    hunting = ["clock.integrate_tap=11", "method.dead_band=0"]
    assert cautions(load_text, good_text, *hunting, "method.integrator=false") == {}
    assert cautions(load_text, good_text, *hunting, "method.stop_always_off=true") == {}


def test_a_little_jitter_is_harmless_even_at_the_boundary_of_two_steps(load_text, good_text):
    assert cautions(load_text, good_text, "detector.jitter=20 ns") == {}


@pytest.mark.compiled
@pytest.mark.parametrize(("lag", "steps"), [(20, 5), (12, -3)])
def test_a_misaligned_detector_stops_the_axis_where_the_warning_says(lag, steps):
    rig = Rig(f"detector.lag_counts={lag}", locked=True).move(1, 0.2)
    assert rig.error == pytest.approx(-steps, abs=1)
