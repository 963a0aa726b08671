"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: the axis jogs over
the boundary and goes to four positions twice, without and with the value, and its registers must come out different.
"""

import math
from functools import cache
from hashlib import blake2b
from importlib.resources import files
from typing import Any

import pytest
from tests.face_rig import FACE_KEYS
from tests.reference import reference_rows

from detent.control.table_positioner import (
    AS_COMMANDED,
    ATOMIC,
    BY_ACTUAL,
    FLAG,
    FLAG_FIRST,
    HOLD,
    NEGATIVE,
    POSITIVE,
    RAW,
    REMAINING_FIRST,
    SHORTEST,
    TURN_COUNTER,
)
from detent.methods.load import load_spec
from detent.methods.rotary_table.build import build_rotary_table, start_turns
from detent.methods.rotary_table.schema import TableProtectionTable

pytestmark = pytest.mark.compiled

EXAMPLE = files("detent").joinpath("examples/rotary_table.toml")
COMMANDED = tuple(f"position.{number}.direction=as commanded" for number in range(5))
AT_THE_BOUNDARY = ("mechanics.start_angle=0.5 deg",)
ECCENTRIC = ("mechanics.eccentricity=0.1 deg",)
COARSELY = ("detector.coarse.eccentricity=0.2 deg",)
NOISY = ("detector.fine.noise=1 deg",)
LOAD = ("disturbance.load.torque=20 N*m", "disturbance.load.at=1 s", "disturbance.load.duration=2 s")
# 64 counts in an interrupt: a turn is 576 passes of the task exactly.
EVENLY = ("limits.speed=31.25 deg/s", "limits.acceleration=15625 deg/s^2", "limits.effort=100 N*m")

# Key: the value, and what must hold for it to matter.
CHANGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "limits.speed": ("50 deg/s", ()),
    "limits.acceleration": ("200 deg/s^2", ()),
    "limits.effort": ("0.4 N*m", ()),
    "motor.rotor_inertia": ("10 kg*cm^2", ()),
    "motor.max_speed": ("2500 rpm", ()),
    "drive.word_bits": ("14", ()),
    "drive.full_speed": ("2500 rpm", ()),
    "drive.time_constant": ("15 ms", ()),
    "drive.droop": ("1 %", ()),
    "mechanics.gear_ratio": ("80", ()),
    "mechanics.table_inertia": ("1 kg*m^2", ()),
    "mechanics.gear_inertia": ("1 kg*cm^2", ()),
    "mechanics.backlash": ("0.1 deg", ()),
    "mechanics.eccentricity": ("0.1 deg", ()),
    "mechanics.eccentricity_angle": ("90 deg", ECCENTRIC),
    "mechanics.coulomb": ("0.05 N*m", ()),
    "mechanics.static": ("0.2 N*m", ("mechanics.coulomb=0.1 N*m",)),
    "mechanics.start_angle": ("11 deg", ()),
    "detector.composition": ("truncated", ("detector.coarse.alignment_error=0.3 deg",)),
    "detector.fine.counts": ("2048", ()),
    "detector.fine.gain_error": ("5 %", ()),
    "detector.fine.quadrature_error": ("2 deg", ()),
    "detector.fine.offset_error": ("3 %", ()),
    "detector.fine.noise": ("1 deg", ()),
    "detector.fine.mounting": ("10 deg", ()),
    "detector.coarse.counts": ("8192", ()),
    "detector.coarse.gain_error": ("1 %", ()),
    "detector.coarse.quadrature_error": ("1 deg", ()),
    "detector.coarse.offset_error": ("1 %", ()),
    "detector.coarse.noise": ("1 deg", ()),
    "detector.coarse.mounting": ("10 deg", ()),
    "detector.coarse.backlash": ("0.4 deg", ()),
    "detector.coarse.eccentricity": ("0.2 deg", ()),
    "detector.coarse.eccentricity_angle": ("90 deg", COARSELY),
    "detector.coarse.alignment_error": ("-1 deg", ()),
    "detector.seed": ("2", NOISY),
    "method.strobe_period": ("4 ms", ()),
    "method.interrupt_delay": ("0.5 ms", ()),
    "method.task_period": ("10 ms", ()),
    "method.task_phase": ("1 ms", ()),
    "method.position_gain": ("20", ()),
    "method.position_control": ("false", ()),
    "method.form": ("flag", (*COMMANDED, *AT_THE_BOUNDARY)),
    "method.judge": ("actual", ()),
    "method.inclusive": ("true", EVENLY),
    "method.guarded": ("true", AT_THE_BOUNDARY),
    "method.update": ("flag first", ("method.task_phase=0.2 ms",)),
    "method.signed_remaining": ("false", ()),
    "method.fraction_bits": ("12", ()),
    "method.in_position": ("20", ()),
    "method.in_position_time": ("40 ms", ()),
    "method.short_way": ("100 deg", ("position.1.direction=positive",)),
    "position.1.angle": ("91 deg", ()),
    "position.1.speed": ("20 deg/s", ()),
    "position.1.direction": ("positive", ()),
    "disturbance.load.torque": ("-20 N*m", LOAD),
    "disturbance.load.at": ("1.1 s", LOAD),
    "disturbance.load.duration": ("1 s", LOAD),
}  # fmt: skip

# Keys that are no matter of the machine, and where they are held.
ELSEWHERE = {
    "axis.name": "test_the_machine_does_not_know",
    "axis.creep": "test_live.py, test 21",
    "axis.method": "tests/unit/methods/test_registry.py",
    "detector.clock": "test_rules.py: clock; test_derive.py: conversions",
    "hardware.id": "test_live.py, tests 29 and 32",
    "detector.coarse.reduction": "test_rules.py: it has one value that is right",
} | dict.fromkeys(
    (f"protection.{key}" for key in TableProtectionTable.model_fields), "test_guard.py: what each of them sees"
)


def test_each_key_of_the_schema_is_tried() -> None:
    keys = {row.key for row in reference_rows("rotary_table")}
    assert {key.replace(".1.", ".NUMBER.") for key in CHANGES} | set(ELSEWHERE) | FACE_KEYS == keys


@cache
def registers_after(bench_of: Any, overrides: tuple[str, ...]) -> bytes:
    """Digest of the registers every 10 ms: a jog of more than a turn, and positions 2, 1, 3 and 4 after it."""
    bench, states = bench_of(overrides), blake2b()

    def watch(seconds: float) -> None:
        for _ in range(round(seconds / 10e-3)):
            states.update(bytes(bench.run(10e-3).r))

    watch(0.1)
    bench.jog(1)
    watch(math.tau / bench.spec.limits.speed + 1)
    bench.jog(0)
    watch(1)
    for number in (2, 1, 3, 4):
        bench.go(number)
        watch(6)
    return states.digest()


@pytest.mark.parametrize("key", CHANGES)
def test_a_key_changes_what_the_axis_does(bench_of: Any, key: str) -> None:
    value, context = CHANGES[key]
    others = tuple(text for text in context if not text.startswith(f"{key}="))
    assert registers_after(bench_of, (*others, f"{key}={value}")) != registers_after(bench_of, context)


@pytest.mark.parametrize("text", ["axis.name=left table", "detector.clock=40 MHz", "detector.coarse.reduction=90"])
def test_the_machine_does_not_know(text: str) -> None:
    assert bytes(build_rotary_table(load_spec(EXAMPLE, [text]))) == bytes(build_rotary_table(load_spec(EXAMPLE)))


def test_the_example_goes_where_it_is_sent(bench_of: Any) -> None:
    bench = bench_of(()).run(0.1)
    for number, angle in ((1, 90), (2, 180), (3, 350), (4, 370)):
        bench.go(number).run(8)
        assert bench.r.controller.positioner.state == HOLD
        assert 10 + bench.travel == pytest.approx(angle, abs=2 * 360 / bench.spec.period)


def test_the_parameters_of_the_default_axis() -> None:
    spec = load_spec(EXAMPLE)
    p = build_rotary_table(spec)
    clocks = p.controller.clocks
    assert (clocks.strobe_ticks, clocks.delay_ticks, clocks.task_ticks) == (20, 2, 200)
    c, q = p.controller.composition, p.controller.positioner
    assert (c.ratio, c.fine, c.coarse, c.fine_zero, c.coarse_zero, c.truncating) == (90, 4096, 4096, 0, 0, 0)
    assert (p.plant.fine.errors.used, p.plant.fine.noise) == (0, 0)
    assert (q.angle.period, q.angle.form, q.judge, q.update) == (368_640, TURN_COUNTER, 0, ATOMIC)
    # 60 deg/s are 122.88 counts in 2 ms; 300 deg/s^2 are 1.2288 counts more in each (7).
    assert (q.interpolator.fraction, q.interpolator.max_speed) == (16, round(122.88 * 65536))
    assert q.interpolator.acceleration == round(1.2288 * 65536)
    # 30 1/s on a count of 0.000977 deg, in words of 0.0651 deg/s; a count per 2 ms is 0.488 deg/s.
    word = 400 / 3 / 2047
    assert q.gain * 65536 == pytest.approx(30 * 360 / 368_640 / word)
    assert q.speed_gain * 65536 == pytest.approx(360 / 368_640 / 2e-3 / word)
    assert (q.max_word, q.window, q.window_interrupts) == (2047, 2, 10)
    assert (q.unsigned_remaining, q.open_loop, q.inclusive, q.guarded) == (0, 0, 0, 0)
    assert p.plant.amplifier.speed_per_count == pytest.approx(2000 / 60 * 2 * math.pi / 2047)
    assert (p.plant.amplifier.max_torque, p.plant.train.gear.ratio, p.plant.train.reduction.ratio) == (3.0, 90, 90)
    assert (p.plant.train.load.torque, p.plant.train.load.end) == (0, 0)


def test_the_velocity_loop_is_a_first_order_lag_with_droop() -> None:
    p = build_rotary_table(load_spec(EXAMPLE))
    motor, stiffness = p.plant.train.motor, p.plant.amplifier.stiffness
    assert motor.inertia == pytest.approx(9e-4 + 0.8 / 90**2)
    assert motor.inertia / (stiffness + motor.viscous) == pytest.approx(20e-3)
    assert stiffness / (stiffness + motor.viscous) == pytest.approx(0.95)


def test_the_position_table() -> None:
    p = build_rotary_table(
        load_spec(
            EXAMPLE, ["position.7.angle=-90 deg", "position.7.direction=as commanded", "position.1.speed=30 deg/s"]
        )
    ).controller.positioner.pdt
    assert p.entries == 8
    assert [p.angle[k] for k in range(8)] == [0, 92_160, 184_320, 358_400, 10_240, 0, 0, -92_160]
    sixty, thirty = round(122.88 * 65536), round(61.44 * 65536)
    assert [p.speed[k] for k in range(8)] == [sixty, thirty, sixty, sixty, sixty, 0, 0, sixty]
    assert [p.policy[k] for k in (0, 2, 7)] == [SHORTEST, POSITIVE, AS_COMMANDED]
    assert p.tolerance == 10
    p = build_rotary_table(load_spec(EXAMPLE, ["position.2.direction=negative"])).controller.positioner.pdt
    assert p.policy[2] == NEGATIVE


@pytest.mark.parametrize(
    ("form", "update", "found"),
    [("flag", "flag first", (FLAG, FLAG_FIRST)), ("raw", "remaining first", (RAW, REMAINING_FIRST))],
)
def test_forms(form: str, update: str, found: tuple[int, int]) -> None:
    more = [f"method.form={form}", f"method.update={update}", "method.judge=actual", "method.signed_remaining=false"]
    q = build_rotary_table(load_spec(EXAMPLE, [*COMMANDED, *more])).controller.positioner
    assert (q.angle.form, q.update) == found
    assert (q.judge, q.unsigned_remaining) == (BY_ACTUAL, 1)


@pytest.mark.parametrize("angle", [0.0, 10.0, 359.9999, -5.0, 123.456])
def test_the_start_lies_in_the_middle_of_a_count(bench_of: Any, angle: float) -> None:
    spec = load_spec(EXAMPLE, [f"mechanics.start_angle={angle} deg"])
    counts = start_turns(spec) * spec.detector.fine.counts
    assert counts % 1 == pytest.approx(0.5)
    assert counts - 0.5 == pytest.approx(angle / 360 * spec.period, abs=1)
    bench = bench_of((f"mechanics.start_angle={angle} deg",)).run(0.01)
    assert bench.r.controller.positioner.angle.dar == math.floor(counts) % spec.period


@pytest.mark.parametrize("mounting", ["0 deg", "37 deg", "-120 deg"])
def test_mounting_is_calibrated_out_and_alignment_is_not(bench_of: Any, mounting: str) -> None:
    zeros = (f"detector.fine.mounting={mounting}", f"detector.coarse.mounting={mounting}")
    angle = bench_of((*zeros, "mechanics.start_angle=200 deg")).run(0.01).r.controller.positioner.angle.dar
    # A zero in the middle of a count leaves a count of doubt.
    assert abs(angle - 204_800) <= 1
    shifted = bench_of((*zeros, "mechanics.start_angle=200 deg", "detector.coarse.alignment_error=4 deg"))
    assert abs(shifted.run(0.01).r.controller.positioner.angle.dar - 204_800 - 4096) <= 1


def test_gears_are_stated_at_the_table() -> None:
    p = build_rotary_table(
        load_spec(EXAMPLE, ["mechanics.backlash=0.1 deg", "detector.coarse.backlash=0.2 deg"])
    ).plant.train
    # Half of 0.1 deg at the table is 4.5 deg of the motor.
    assert p.gear.half_backlash == pytest.approx(math.radians(4.5))
    assert p.reduction.half_backlash == pytest.approx(math.radians(9))


def test_a_load_is_seen_through_the_gear_and_counts_in_base_ticks() -> None:
    p = build_rotary_table(load_spec(EXAMPLE, LOAD)).plant.train.load
    assert (p.torque, p.begin, p.end) == (pytest.approx(20 / 90), 10_000, 30_000)
    short = [LOAD[0], "disturbance.load.at=150 us", "disturbance.load.duration=100 us"]
    p = build_rotary_table(load_spec(EXAMPLE, short)).plant.train.load
    assert p.end - p.begin == 1


@pytest.mark.parametrize(("time", "interrupts"), [("20 ms", 10), ("0.1 ms", 1), ("21.2 ms", 11)])
def test_time_in_position_is_a_number_of_interrupts(time: str, interrupts: int) -> None:
    q = build_rotary_table(load_spec(EXAMPLE, [f"method.in_position_time={time}"])).controller.positioner
    assert q.window_interrupts == interrupts
