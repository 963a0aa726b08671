"""Warnings about a phase-servo axis that can be built; each value that a remedy names ends its warning."""

import numpy as np
import pytest
from tests.phase_servo_rig import Rig
from tests.remedies import check_caution

from detent.methods.phase_servo.checks import find_cautions
from detent.methods.phase_servo.derive import PhaseFigures

BURST = '[disturbance.lines.burst]\nkind = "{}"\n{}\n'


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


@pytest.mark.parametrize("order", ["robust", "literal"])
def test_the_default_plant_has_nothing_to_warn_about(load_text, good_text, order):
    assert cautions(load_text, good_text, f"clock.order={order}") == {}


CASES = [
    (["motor.inductance=0.2 mH"], "PWM frequency"),
    (["motor.inductance=40 uH"], "current within a tick"),
    (["drive.supply=11 V"], "stall current"),
    (["motor.max_current=4 A"], "current limit"),
    (["motor.max_current=4 A", "drive.supply=10 V"], "current limit"),
    (["method.table_acceleration=40 m/s^2"], "force at the current limit"),
    (["limits.effort=0.1 A"], "force at the current limit"),
    (["mechanics.carriage_mass=1.6 kg"], "deceleration from the change of mode"),
    (["method.ready_time=1 ms"], "method.ready_time"),
    (["clock.oscillator=12 MHz", "clock.sample_tap=13"], "method.ready_time"),
    (["clock.oscillator=16 MHz", "clock.sample_tap=14", "method.position_gains=[4, 12, 1]"], "carriage after ready"),
    (["drive.supply=2.4 V", "limits.effort=1.2 A"], "supply"),
    (["drive.supply=0.2 V", "limits.effort=0.1 A"], "supply"),
    (["limits.speed=0.37 m/s"], "speed above the table, slew limit of the tracker"),
    (
        ["method.speed_bits=6", "clock.sample_tap=13", "clock.oscillator=16 MHz", "limits.speed=0.38 m/s"],
        "speed above the table, range of the speed word",
    ),
    (
        ["method.position_gains=[4, 16, 3]", "drive.pwm_bits=9", "drive.supply=240 V"],
        "gain margin of the position loop",
    ),
    (["clock.oscillator=16 MHz"], "overshoot of a move"),
    (["clock.oscillator=12 MHz"], "overshoot of a move"),
    (["clock.oscillator=16 MHz", "method.position_gains=[4, 32, 1]"], "overshoot of a move"),
    (["mechanics.friction.right.static=5 N"], "breakaway drive"),
    (["clock.integrate_tap=11"], "rate of the integral"),
    (["method.dead_band=0"], "method.dead_band"),
    (["method.integral_limit=2"], "method.integral_limit"),
    (["detector.lag_counts=20"], "detector.lag_counts"),
    (["detector.lag_counts=12"], "detector.lag_counts"),
    (["detector.lag_counts=40"], "detector.lag_counts"),
    (["detector.jitter=60 ns"], "detector.jitter"),
    (["disturbance.lines.inserted=20 Hz"], "pulses of disturbance.lines"),
]


@pytest.mark.parametrize(("overrides", "name"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, golden, overrides, name):
    found = cautions(load_text, good_text, *overrides)
    golden(f"{name}, {' '.join(overrides)}", found[name])
    check_caution(lambda *more: cautions(load_text, good_text, *more), overrides, name, found[name])


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("+", 'at = "5 ms"\ncount = 22'),
        ("-", 'at = "5 ms"\ncount = 30'),
        ("remove", f"ticks = {list(range(20000, 20031))}"),
    ],
)
def test_a_burst_beyond_what_is_expected(load_text, good_text, golden, kind, more):
    name, text = "pulses of disturbance.lines.burst", good_text + BURST.format(kind, more)
    found = cautions(load_text, text)[name]
    golden(f"{name}, {kind}", found)
    check_caution(lambda *overrides: cautions(load_text, text, *overrides), [], name, found)


def test_what_a_burst_may_do_without_a_word(load_text, good_text):
    assert cautions(load_text, good_text + BURST.format("+", 'at = "5 ms"\ncount = 20')) == {}
    assert cautions(load_text, good_text + BURST.format("lose sample", 'at = "5 ms"\ncount = 64')) == {}


def test_what_is_switched_off_is_not_warned_about(load_text, good_text):
    hunting = ["clock.integrate_tap=11", "method.dead_band=0"]
    assert cautions(load_text, good_text, *hunting, "method.integrator=false") == {}
    assert cautions(load_text, good_text, *hunting, "method.stop_always_off=true") == {}


def test_a_little_jitter_is_harmless_even_at_the_boundary_of_two_steps(load_text, good_text):
    assert cautions(load_text, good_text, "detector.jitter=20 ns") == {}


def after_ready(rig, pitches):
    """How far off its target a move ends, at the worst, from ready on for 15 ms [steps]."""
    rig.command(pitches)
    rig.run(0.1e-3)
    while rig.r.controller.sequencer.ready == 0:
        rig.run(0.1e-3)
    way = rig.record(15e-3, ["plant.train.position"], every=50)["plant.train.position"]
    return float(np.abs(way - rig.target).max()) / rig.step


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("oscillator", "tap", "told"),
    [(8, 12, None), (16, 13, None), (12, 13, "method.ready_time"), (20, 14, "method.ready_time"),
     (24, 14, "method.ready_time"), (12, 12, "overshoot of a move"), (20, 13, "overshoot of a move"),
     (8, 11, "overshoot of a move"), (12, 14, "gain margin of the position loop")],
)  # fmt: skip
def test_what_other_oscillators_and_taps_do_to_a_move_is_told(load_text, good_text, oscillator, tap, told):
    """At 12 MHz with tap 13 a move stood 3.2 steps off when the axis said that it was ready, and nothing was told.

    A count of the speed word is worth four steps of error. The longer sample makes the damping 0.8, the carriage comes
    within 3 steps at once and needs 4.7 ms for the last two, of which ready leaves it 3.
    """
    overrides = (f"clock.oscillator={oscillator} MHz", f"clock.sample_tap={tap}")
    found = cautions(load_text, good_text, *overrides)
    assert (told in found) if told else not found
    rig = Rig(*overrides, locked=True)
    worst = max(after_ready(rig, pitches) for pitches in (2, 6, -6, 3))
    assert (worst > 2) == (told is not None)
    figures = PhaseFigures(load_text(good_text, *overrides).spec)
    if told == "method.ready_time":
        assert worst == pytest.approx(figures.approach.off_at_ready, rel=0.4)
        late = Rig(*overrides, f"method.ready_time={1.15 * figures.approach.settling} s", locked=True)
        assert max(after_ready(late, pitches) for pitches in (2, 6, -6, 3)) <= 2.2
    elif told == "overshoot of a move":
        assert worst == pytest.approx(figures.approach.overshoot, rel=0.25)


@pytest.mark.compiled
@pytest.mark.parametrize(("lag", "steps"), [(20, 5), (12, -3)])
def test_a_misaligned_detector_stops_the_axis_where_the_warning_says(lag, steps):
    rig = Rig(f"detector.lag_counts={lag}", locked=True).move(1, 0.2)
    assert rig.error == pytest.approx(-steps, abs=1)
