"""What does not go together in a phase-servo axis, and the nearest value that would do: mechanics, detector and lines.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5.
"""

import pytest
from tests.bad_files import added, edit, given, params
from tests.remedies import broken_rules, check_rule

from detent.methods.phase_servo import checks

TRAVEL = 'travel = "14 in"'
BURST = "disturbance.lines.burst"

MACHINE = [
    edit("long way", TRAVEL, 'travel = "0.5 m"', "6:1", "limits.travel"),
    given(
        "fine detector",
        "detector.pitches_per_revolution=150",
        "limits.speed=0.3 m/s",
        key="detector.pitches_per_revolution",
    ),
    edit("short way", TRAVEL, 'travel = "0.4 mm"', "6:1", "limits.travel", overrides=("mechanics.start_position=0 m",)),
    edit("start", 'start_position = "0.1 in"', 'start_position = "15 in"', "24:1", "mechanics.start_position"),
    added("left margin", '[print]\nleft_margin = "400 mm"', "57:1", "print.left_margin"),
    added("character pitch", '[print]\ncharacter_pitch = "2.5 mm"', "57:1", "print.character_pitch"),
    added("small characters", '[print]\ncharacter_pitch = "0.1 mm"', "57:1", "print.character_pitch"),
    given(
        "another pulley",
        "mechanics.pulley_circumference=50 mm",
        "print.character_pitch=2.54 mm",
        key="print.character_pitch",
    ),
    given("winding", "motor.inductance=1 uH", key="motor.inductance"),
    given(
        "viscous",
        "mechanics.friction.right.viscous=1e5 N*s/m",
        "mechanics.carriage_mass=0.01 kg",
        "clock.oscillator=100 kHz",
        "clock.sample_tap=8",
        "limits.speed=5 mm/s",
        "mechanics.pulley_inertia=0 kg*m^2",
        "motor.rotor_inertia=0.001 g*cm^2",
        key="mechanics.friction.right.viscous",
    ),
    edit("stiction", 'static = "1.2 N"', 'static = "0.9 N"', "28:1", "mechanics.friction.right.static"),
]

DETECTOR = [
    given("lag", "detector.lag_counts=64", key="detector.lag_counts"),
    given("jitter", "detector.jitter=1.1 us", key="detector.jitter"),
    given("jitter with an offset", "detector.jitter=1 us", "detector.offset_error=30 %", key="detector.jitter"),
    given(
        "offset of a weak winding",
        "detector.offset_error=-44 %",
        "detector.gain_error=-50 %",
        "detector.quadrature_error=30 deg",
        key="detector.offset_error",
    ),
]

LINES = [
    added("burst without a moment", f'[{BURST}]\nkind = "+"', "56:1", f"{BURST}.at"),
    added("burst of both kinds", f'[{BURST}]\nkind = "+"\nat = "5 ms"\nticks = [20000]', "58:1", f"{BURST}.at"),
    added("count beside ticks", f'[{BURST}]\nkind = "+"\ncount = 3\nticks = [20000]', "58:1", f"{BURST}.count"),
    added("falling ticks", f'[{BURST}]\nkind = "-"\nticks = [20000, 10000, 10000]', "58:1", f"{BURST}.ticks"),
    added("negative ticks", f'[{BURST}]\nkind = "-"\nticks = [-1, 5]', "58:1", f"{BURST}.ticks"),
    added("many ticks", f'[{BURST}]\nkind = "-"\nticks = {list(range(65))}', "58:1", f"{BURST}.ticks"),
    added(
        "close burst", f'[{BURST}]\nkind = "+"\nat = "5 ms"\ncount = 8\nspacing = "0.2 us"', "60:1", f"{BURST}.spacing"
    ),
]


@pytest.mark.parametrize("bad", params(machine=MACHINE, detector=DETECTOR, lines=LINES))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    entries = [*MACHINE, *DETECTOR, *LINES]
    broken = broken_rules("phase_servo", entries, good_text, load_text, monkeypatch)
    assert broken >= {"_edges", "_machine", "_tracker", "_way"}


def test_a_burst_of_one_pulse_has_no_spacing(good_text, load_text):
    load_text(good_text + f'\n[{BURST}]\nkind = "+"\nat = "5 ms"\nspacing = "0 s"\n')


def test_the_constants_are_those_of_the_blocks():
    from detent.kernel.noise import NoiseSource, bell
    from detent.sensing.phase_detector import JITTER_LIMIT

    assert checks.EDGE_LIMIT == JITTER_LIMIT
    source = NoiseSource(state=1)
    assert max(abs(bell(source)) for _ in range(2000)) <= checks.JITTER_PEAK
