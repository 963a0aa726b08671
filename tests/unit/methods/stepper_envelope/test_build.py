"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: a motor runs up to
its turn and down to its stop twice, without and with the value, and its registers must come out different.
"""

import math
import subprocess
import sys
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from tests.bad_files import example_text
from tests.face_rig import FACE_KEYS
from tests.reference import reference_rows
from tests.stepper_rig import COARSE_FINE, FINE_HZ, LOAD, MAX_HZ, MOTOR, RAMP, rotor_params

from detent.axisfile.tables import HomeTable
from detent.control.step_rule import start_move
from detent.files.source import parse_source
from detent.kernel.loop import advance
from detent.methods.load import axis_of
from detent.methods.stepper_envelope.build import (
    build_stepper,
    instant,
    make_step_ramp,
    make_tables,
    start_hz,
    stepper_motor,
    zone_maps,
)
from detent.methods.stepper_envelope.system import Stepper, switch_on
from detent.methods.stepper_envelope.system import tables as feed
from detent.planning.step_envelope import Zone
from detent.planning.step_ramp import FirstOrderPullOut, MeasuredPullOut, WindingPullOut

A, X = "stepper.group_a", "stepper.x"
SHORT = ("limits.travel=6 mm", "zone.near.begin=1 mm", "zone.near.end=2 mm", "zone.far.begin=4 mm", "zone.far.end=5 mm")
WINDING = (
    "motor.pull_out=winding", "motor.resistance=5.6 ohm", "motor.inductance=3.4 mH", "motor.rated_current=670 mA",
    "drive.supply=7 V", "limits.speed=12 mm/s",
)  # fmt: skip
CATALOGUE = ("motor.pull_out=winding", "motor.catalogue=Trinamic QSH2818-32-07-006", *WINDING[-2:])
POINTS = (
    "motor.pull_out=points", 'motor.curve_frequency=["500 Hz", "5 kHz"]', 'motor.curve_torque=["45 mN*m", "15 mN*m"]',
)  # fmt: skip

# Key of the motor or of the controller: the value, and what must hold for it to matter.
CHANGES = {
    "controller.timer": ("2 MHz", ()),
    "controller.words": ("frequency", ()),
    "controller.tolerance": ("0.3", ()),
    "limits.travel": ("5.9 mm", ()),
    "limits.speed": ("19 mm/s", ()),
    "limits.acceleration": ("0.19 m/s^2", ()),
    "motor.catalogue": ("Trinamic QSH2818-51-07-012", CATALOGUE),
    "motor.steps_per_turn": ("100", ()),
    "motor.holding_torque": ("61 mN*m", ()),
    "motor.rotor_inertia": ("8.9 g*cm^2", ()),
    "motor.resistance": ("5.5 ohm", WINDING),
    "motor.inductance": ("3.3 mH", WINDING),
    "motor.rated_current": ("700 mA", WINDING),
    "motor.start_frequency": ("880 Hz", ()),
    "motor.pull_out": ("first order", WINDING),
    "motor.pull_out_torque": ("46 mN*m", ()),
    "motor.corner_frequency": ("1250 Hz", ()),
    "motor.curve_frequency": ('["500 Hz", "5.1 kHz"]', POINTS),
    "motor.curve_torque": ('["45 mN*m", "16 mN*m"]', POINTS),
    "drive.supply": ("7.1 V", WINDING),
    "drive.current": ("600 mA", WINDING),
    "drive.bridge_resistance": ("200 mohm", WINDING),
    "drive.torque_safety": ("2.05", ()),
    "drive.start_safety": ("2.2", ()),
    "drive.reversal_pause": ("2", ()),
    "drive.microsteps": ("2", ()),
    "mechanics.travel_per_revolution": ("1.1 mm", ()),
    "mechanics.moving_mass": ("1 kg", ()),
    "mechanics.screw_inertia": ("0.7 g*cm^2", ()),
    "mechanics.coupling_inertia": ("0.6 g*cm^2", ()),
    "mechanics.friction_torque": ("5 mN*m", ()),
    "mechanics.lower_end": ("0.5 mm", ()),
    "mechanics.start_position": ("0.1 mm", ()),
    "extremes.start": ("0.5 mm", ()),
    "extremes.turn": ("5.5 mm", ()),
    "extremes.stop": ("0.5 mm", ()),
    "zone.near.begin": ("1.1 mm", ()),
    "zone.near.end": ("2.1 mm", ()),
    "zone.near.speed": ("6 mm/s", ()),
    "zone.near.direction": ("down", ()),
    "method.rule": ("literal", ("mechanics.start_position=0.3 mm",)),
}

# Keys that are no matter of one motor, and where they are held.
ELSEWHERE = {
    "axis.name": "test_the_motor_does_not_know",
    "axis.creep": "test_live.py, test 21",
    "axis.method": "tests/unit/methods/test_registry.py",
    "motion": "test_rotary.py",
    **dict.fromkeys((f"home.{key}" for key in HomeTable.model_fields), "tests/unit/methods/test_homing.py"),
    "controller.settle_time": "test_the_motor_does_not_know; tests of the stage's runs",
}


def key_of(name):
    return name if name.startswith(("controller.", "axis.")) else f"{A}.{name}"


def load(*overrides, name="zoom"):
    return axis_of(parse_source("axis.toml", example_text(name)), overrides).spec


def test_each_key_of_the_schema_is_tried():
    keys = {row.key.removeprefix("stepper.NAME.").replace("ZONE", "near") for row in reference_rows("stepper_envelope")}
    assert set(CHANGES) | set(ELSEWHERE) | FACE_KEYS == keys


@cache
def registers_after(*overrides):
    """Registers every 5 ms while the motor goes up to its turn and down to its stop."""
    spec = load(*(key_of(text) for text in (*SHORT, *overrides)))
    table = spec.stepper["group_a"]
    tables = make_tables(table)
    p, r = build_stepper(spec, "group_a", tables), Stepper()
    switch_on(r, table.step_at(table.mechanics.start_position), p.plant.rotor.step_angle)
    start_move(r.controller.rule, 1, 1)
    states = []
    for _ in range(400):
        advance(p, r, 2500, *NO_TRACE, *feed(tables.up.entries, tables.down.entries))
        states.append(bytes(r))
        if r.controller.rule.event:
            break
    assert r.controller.rule.event
    assert r.controller.rule.position == tables.down.stop
    return tuple(states)


NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)


@pytest.mark.compiled
@pytest.mark.parametrize("name", CHANGES)
def test_a_key_changes_what_the_motor_does(name):
    value, context = CHANGES[name]
    others = tuple(text for text in context if not text.startswith(f"{name}="))
    assert registers_after(*others, f"{name}={value}") != registers_after(*context)


@pytest.mark.parametrize(
    "text", ["axis.name=left group", "controller.settle_time=1 s", "stepper.group_b.limits.speed=10 mm/s"]
)
def test_the_motor_does_not_know(text):
    changed, plain = (build("group_a", *more) for more in ((text,), ()))
    assert bytes(changed) == bytes(plain)


def build(name, *overrides, example="zoom"):
    spec = load(*overrides, name=example)
    return build_stepper(spec, name, make_tables(spec.stepper[name]))


def test_the_motor_of_the_zoom_is_that_of_the_specification():
    table = load().stepper["group_a"]
    motor = stepper_motor(table)
    assert (motor.steps_per_turn, motor.rotor_inertia, motor.holding_torque) == (
        MOTOR.steps_per_turn,
        pytest.approx(MOTOR.rotor_inertia),
        MOTOR.holding_torque,
    )
    assert isinstance(motor.pull_out, FirstOrderPullOut)
    assert motor.pull_out(2000.0) == pytest.approx(MOTOR.pull_out(2000.0))
    assert motor.load_inertia == pytest.approx(LOAD.inertia)
    ramp = make_step_ramp(table)
    assert len(ramp) == len(RAMP)
    assert ramp.hz == pytest.approx(RAMP.hz, abs=0.5)
    assert start_hz(table) == pytest.approx(400, abs=0.1)


def test_the_zones_of_the_zoom_are_coarse_and_fine():
    up, down = zone_maps(load().stepper["group_a"])
    assert up.zones == down.zones == COARSE_FINE
    assert up.limits == down.limits == (MAX_HZ, FINE_HZ)


def test_the_registers_of_the_zoom():
    p = build("group_a")
    c = p.controller
    assert (c.rule.reload, c.timer.reload, c.rule.literal, c.pause) == (1, 1, 0, 1)
    assert (c.timer.clock_hz, c.rule.ramp[0], c.rule.ramp[227], c.rule.limit[1]) == (1_000_000, 2500, 250, 1000)
    assert (c.instant_ticks, p.plant.clock_hz, p.plant.tolerance) == (2, 1_000_000, 0.5)
    rotor = rotor_params()
    for field in ("dt", "teeth", "step_angle", "inertia", "torque", "damping", "friction", "intervals_per_hz"):
        assert getattr(p.plant.rotor, field) == pytest.approx(getattr(rotor, field)), field
    assert list(p.plant.rotor.curve) == pytest.approx(list(rotor.curve))


def test_words_may_be_frequencies():
    c = build("group_a", "controller.words=frequency", "controller.timer=100 MHz").controller
    assert (c.rule.reload, c.rule.ramp[0], c.rule.ramp[227], c.rule.limit[1]) == (0, 400, 4000, 1000)
    assert c.instant_ticks == 200


@pytest.mark.parametrize(
    ("timer", "seconds"), [("1 MHz", 2e-6), ("1.6 MHz", 3 / 1.6e6), ("250 kHz", 4e-6), ("1 GHz", 2e-6)]
)
def test_a_time_step_is_whole_ticks_of_the_timer(timer, seconds):
    spec = load(f"controller.timer={timer}")
    assert instant(spec) == pytest.approx(seconds)
    assert build("group_a", f"controller.timer={timer}").plant.rotor.dt == instant(spec)


def test_a_catalogue_motor_is_driven_by_its_supply():
    table = load(name="stage").stepper["x"]
    curve = stepper_motor(table).pull_out
    assert isinstance(curve, WindingPullOut)
    assert (curve.resistance, curve.inductance, curve.current, curve.teeth) == (5.3, pytest.approx(6.6e-3), 1.0, 50)
    softer = load(f"{X}.drive.bridge_resistance=700 mohm", f"{X}.drive.current=500 mA", name="stage").stepper["x"]
    assert stepper_motor(softer).pull_out.resistance == 6.0
    assert stepper_motor(softer).holding_torque == pytest.approx(0.135)
    assert stepper_motor(softer).pull_out(0.0) == pytest.approx(curve(0.0) / 2)


def test_the_current_of_the_drive_is_that_of_the_rotor_too():
    full, half = (build("x", *more, example="stage").plant.rotor for more in ((), (f"{X}.drive.current=500 mA",)))
    assert half.torque == pytest.approx(full.torque / 2)
    assert half.damping == pytest.approx(full.damping / math.sqrt(2))


def test_points_are_a_curve():
    table = load(*(f"{A}.{text}" for text in POINTS)).stepper["group_a"]
    curve = stepper_motor(table).pull_out
    assert isinstance(curve, MeasuredPullOut)
    assert (curve(100.0), curve(2750.0), curve(5001.0)) == (pytest.approx(0.045), pytest.approx(0.030), 0.0)


def test_the_tables_run_between_the_extremes():
    places = ("extremes.start=1 mm", "extremes.turn=30 mm", "extremes.stop=7.5 mm")
    tables = make_tables(load(*(f"{A}.{text}" for text in places)).stepper["group_a"])
    assert (tables.up.start, tables.up.stop) == (200, 6000)
    assert (tables.down.start, tables.down.stop) == (6000, 1500)


def test_an_extreme_at_the_end_of_a_travel_that_is_no_whole_number_is_its_last_step():
    table = load(f"{A}.limits.travel=40.003 mm", f"{A}.extremes.turn=40.003 mm").stepper["group_a"]
    assert (table.steps, make_tables(table).up.stop) == (8000, 8000)


def maps_of(*zones):
    """Zone maps of the first group, upwards and downwards, for pairs of name and overrides."""
    texts = [f"{A}.zone.{name}.{key}={value}" for name, keys in zones for key, value in keys.items()]
    return zone_maps(load(*texts).stepper["group_a"])


def test_a_zone_may_hold_for_one_direction():
    up, down = maps_of(("near", {"direction": "up"}), ("far", {"direction": "down"}))
    assert (up.zones, down.zones) == (COARSE_FINE[:1], COARSE_FINE[1:])


def test_both_directions_number_their_limits_alike():
    table = load(f"{A}.zone.near.direction=up", f"{A}.zone.far.direction=down", f"{A}.zone.far.speed=6 mm/s")
    up, down = zone_maps(table.stepper["group_a"])
    assert up.limits == down.limits == (4000.0, 1200.0, 1000.0)


def test_a_zone_holds_for_every_step_that_it_touches():
    up, _ = maps_of(("near", {"begin": "10.0024 mm", "end": "12.9976 mm"}))
    assert up.zones[0] == Zone(2000, 2600, FINE_HZ)


def stretches_of(*zones: tuple[str, dict[str, str]]) -> list[tuple[int, int, float]]:
    """Begin, end and limit of each stretch upwards that is slower than the motor."""
    hz = maps_of(*zones)[0].hz
    edges = [0, *(np.flatnonzero(np.diff(hz)) + 1).tolist(), len(hz)]
    return [(begin, end, float(hz[begin])) for begin, end in pairwise(edges) if hz[begin] < 4000.0]


@pytest.mark.parametrize(
    ("near", "far", "stretches"),
    # The step from 3000 to 3001 is touched by both: the slower one has it.
    [
        ("5 mm/s", "6 mm/s", [(2000, 3001, 1000.0), (3001, 6000, 1200.0)]),
        ("6 mm/s", "5 mm/s", [(2000, 3000, 1200.0), (3000, 6000, 1000.0)]),
        ("5 mm/s", "5 mm/s", [(2000, 6000, 1000.0)]),
    ],
)
def test_zones_that_meet_inside_a_step_share_it(near, far, stretches):
    found = stretches_of(("near", {"end": "15.002 mm", "speed": near}), ("far", {"begin": "15.002 mm", "speed": far}))
    assert found == stretches


def test_a_zone_between_two_others_in_one_step_leaves_it_to_the_slowest():
    between = {"begin": "15.001 mm", "end": "15.003 mm", "direction": "both"}
    fast, slow = {**between, "speed": "9 mm/s"}, {**between, "speed": "4 mm/s"}
    sides = ("near", {"end": "15.001 mm"}), ("far", {"begin": "15.003 mm"})
    assert stretches_of(*sides, ("mid", fast)) == [(2000, 6000, 1000.0)]
    assert stretches_of(*sides, ("mid", slow)) == [(2000, 3000, 1000.0), (3000, 3001, 800.0), (3001, 6000, 1000.0)]


def test_a_zone_shorter_than_a_step_yields_to_a_slower_one_in_it():
    fast = {"begin": "15.0005 mm", "end": "15.002 mm", "speed": "9 mm/s"}
    assert stretches_of(("near", fast), ("far", {"begin": "15.002 mm"})) == [(3000, 6000, 1000.0)]


def test_as_many_zones_as_may_be_have_room_for_their_limits():
    texts = [
        f"{A}.zone.z{k}.{key}={value}"
        for k in range(12)
        for key, value in {
            "begin": f"{30 + k * 0.1!r} mm",
            "end": f"{30.1 + k * 0.1!r} mm",
            "speed": f"{6 + k} mm/s",
        }.items()
    ]
    spec = load(*texts, f"{A}.zone.far.speed=5.5 mm/s")
    tables = make_tables(spec.stepper["group_a"])
    assert len(spec.stepper["group_a"].zone) == 14
    assert len(tables.up.zones.limits) == 15
    assert build_stepper(spec, "group_a", tables).controller.rule.limit[14] == 1000


@pytest.mark.process
def test_tables_are_made_without_compiled_blocks():
    program = (
        "import sys; from importlib.resources import files; from detent.methods.check import check_spec;"
        "from detent.methods.load import read_axis;"
        "check_spec(read_axis(files('detent').joinpath('examples/zoom.toml')));"
        "assert not {'numba', 'detent.methods.stepper_envelope.system'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
