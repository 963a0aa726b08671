"""What does not go together in a phase-servo axis, and the nearest value that would do: mechanics, detector and lines.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

import pytest
from tests.bad_files import added, edit, params
from tests.remedies import broken_rules, check_rule, given

from detent.methods.phase_servo import detector

TRAVEL = 'travel = "14 in"'
BURST = "disturbance.lines.burst"

MACHINE = [
    edit(
        "long way",
        TRAVEL,
        'travel = "0.5 m"',
        "6:1",
        "limits.travel",
        '"0.5 m"',
        "up to 65535 steps, 433.5 mm: the command counter has 16 bits",
        'set limits.travel = "433.4 mm" or use a coarser detector',
    ),
    given(
        "fine detector",
        "detector.pitches_per_revolution=150",
        "limits.speed=0.3 m/s",
        key="detector.pitches_per_revolution",
        came="150",
        allowed='limits.travel ("14 in") up to 65535 steps, 346.8 mm',
        remedy='set limits.travel = "346.7 mm"',
    ),
    edit(
        "short way",
        TRAVEL,
        'travel = "0.4 mm"',
        "6:1",
        "limits.travel",
        '"0.4 mm"',
        "at least a pitch of the detector, 423.3 um: the axis stops at whole pitches",
        'set limits.travel = "423.4 um" or use a finer detector',
        overrides=("mechanics.start_position=0 m",),
    ),
    edit(
        "start",
        'start_position = "0.1 in"',
        'start_position = "15 in"',
        "24:1",
        "mechanics.start_position",
        '"15 in"',
        "up to limits.travel, 355.6 mm",
        'set mechanics.start_position = "355.6 mm" or correct limits.travel',
    ),
    added(
        "left margin",
        '[print]\nleft_margin = "400 mm"',
        "54:1",
        "print.left_margin",
        '"400 mm"',
        "up to limits.travel, 355.6 mm",
        'set print.left_margin = "355.6 mm"',
    ),
    added(
        "character pitch",
        '[print]\ncharacter_pitch = "2.5 mm"',
        "54:1",
        "print.character_pitch",
        '"2.5 mm"',
        "a whole number of pitches of the detector, 423.3 um: the axis stops there only; here 5.9055",
        'set print.character_pitch = "2.54 mm"',
    ),
    added(
        "small characters",
        '[print]\ncharacter_pitch = "0.1 mm"',
        "54:1",
        "print.character_pitch",
        '"0.1 mm"',
        "a whole number of pitches",
        'set print.character_pitch = "423.333333333 um"',
    ),
    given(
        "another pulley",
        "mechanics.pulley_circumference=50 mm",
        "print.character_pitch=2.54 mm",
        key="print.character_pitch",
        came="2.54 mm",
        allowed="a whole number of pitches of the detector, 416.7 um",
        remedy='set print.character_pitch = "2.5 mm"',
    ),
    given(
        "winding",
        "motor.inductance=1 uH",
        key="motor.inductance",
        came="1 uH",
        allowed="such that the rates of the machine add up to 1/1 us or less, here R / L",
        remedy='set motor.inductance = "2.009 uH" or lower motor.resistance',
    ),
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
        came="1e5 N*s/m",
        allowed="add up to 1/40 us or less, here viscous over mass",
        remedy='set mechanics.friction.right.viscous = "',
    ),
    edit(
        "stiction",
        'static = "1.2 N"',
        'static = "0.9 N"',
        "28:1",
        "mechanics.friction.right.static",
        '"0.9 N"',
        "at least the Coulomb friction, 1 N",
        'set mechanics.friction.right.static = "1 N" or leave it out',
    ),
]

DETECTOR = [
    given(
        "lag",
        "detector.lag_counts=64",
        key="detector.lag_counts",
        came="64",
        allowed="below detector.counts, 64",
        remedy="set detector.lag_counts = 63 or leave it out: it is then N/4 - 1 = 15",
    ),
    given(
        "jitter",
        "detector.jitter=1.1 us",
        key="detector.jitter",
        came="1.1 us",
        allowed="up to 1.067 us: its peak of 3 times that and the offset displace an edge by at most 0.2 turn",
        remedy='set detector.jitter = "1.066 us"',
    ),
    given(
        "jitter with an offset",
        "detector.jitter=1 us",
        "detector.offset_error=30 %",
        key="detector.jitter",
        came="1 us",
        allowed="up to 808 ns",
        remedy='set detector.jitter = "808 ns"',
    ),
    given(
        "offset of a weak winding",
        "detector.offset_error=-44 %",
        "detector.gain_error=-50 %",
        "detector.quadrature_error=30 deg",
        key="detector.offset_error",
        came="-44 %",
        allowed="an edge is displaced by at most 0.2 turn, here 0.",
        remedy='set detector.offset_error = "-',
    ),
]

LINES = [
    added(
        "burst without a moment",
        f'[{BURST}]\nkind = "+"',
        "53:1",
        f"{BURST}.at",
        "the default",
        "the first moment, or ticks in its place",
        'add at = "5 ms", or ticks',
    ),
    added(
        "burst of both kinds",
        f'[{BURST}]\nkind = "+"\nat = "5 ms"\nticks = [20000]',
        "55:1",
        f"{BURST}.at",
        '"5 ms"',
        "left out where ticks are listed, 1 of them here",
        "remove at, or remove ticks",
    ),
    added(
        "count beside ticks",
        f'[{BURST}]\nkind = "+"\ncount = 3\nticks = [20000]',
        "55:1",
        f"{BURST}.count",
        "3",
        "left out where ticks are listed",
        "remove count",
    ),
    added(
        "falling ticks",
        f'[{BURST}]\nkind = "-"\nticks = [20000, 10000, 10000]',
        "55:1",
        f"{BURST}.ticks",
        "[20000, 10000, 10000]",
        "whole numbers that rise, each once",
        f"set {BURST}.ticks = [10000, 20000]",
    ),
    added(
        "negative ticks",
        f'[{BURST}]\nkind = "-"\nticks = [-1, 5]',
        "55:1",
        f"{BURST}.ticks",
        "-1 as element 1",
        "up to 64 whole numbers from 0, rising",
        "every number of ticks",
    ),
    added(
        "many ticks",
        f'[{BURST}]\nkind = "-"\nticks = {list(range(65))}',
        "55:1",
        f"{BURST}.ticks",
        "65 numbers",
        "up to 64 whole numbers",
        "so many numbers",
    ),
    added(
        "close burst",
        f'[{BURST}]\nkind = "+"\nat = "5 ms"\ncount = 8\nspacing = "0.2 us"',
        "57:1",
        f"{BURST}.spacing",
        '"0.2 us"',
        "at least one base tick, 250 ns: a line carries one pulse at a time",
        f'set {BURST}.spacing = "250 ns" or set {BURST}.count = 1',
    ),
]


@pytest.mark.parametrize("bad", params(machine=MACHINE, detector=DETECTOR, lines=LINES))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    entries = [*MACHINE, *DETECTOR, *LINES]
    broken = broken_rules("phase_servo", entries, good_text, load_text, monkeypatch)
    assert broken >= {"_burst", "_character_pitch", "_edges", "_friction", "_lag", "_machine", "_places", "_way"}


def test_a_burst_of_one_pulse_has_no_spacing(good_text, load_text):
    load_text(good_text + f'\n[{BURST}]\nkind = "+"\nat = "5 ms"\nspacing = "0 s"\n')


def test_the_constants_are_those_of_the_blocks():
    from detent.kernel.noise import NoiseSource, bell
    from detent.sensing.phase_detector import JITTER_LIMIT

    assert detector.EDGE_LIMIT == JITTER_LIMIT
    source = NoiseSource(state=1)
    assert max(abs(bell(source)) for _ in range(2000)) <= detector.JITTER_PEAK
