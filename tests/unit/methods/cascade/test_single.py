"""A cascade axis whose controller computes in single precision: another law, in whatever runs it."""

import ctypes
import math

import numpy as np
import pytest
from tests.cascade_rig import MASS, Rig, in_single, make_params
from tests.tolerance_rig import asked, machine, quick

import detent
from detent.control import operation as ops
from detent.control.operation import MOVE_BY
from detent.errors import InputError
from detent.kernel.registers import declared_of, single
from detent.kernel.single import Single
from detent.methods.cascade.batch import build_many
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.led import led
from detent.methods.cascade.loop import LinearLoop
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.standstill import CascadeEnsemble
from detent.methods.cascade.system import CascadeParams
from detent.methods.cascade.wired import wired
from detent.methods.load import load_spec
from detent.methods.moves.job import one_move
from detent.methods.registry import METHODS
from detent.operate.faults import injection_of
from detent.operate.host import Host
from detent.planning.profile import MotionLimits, plan_move
from detent.tune.batch import run_chunk

FILE = detent.example("cascade.toml")
SINGLE = ("controller.arithmetic=single",)


def spec_in(arithmetic: str, *changes: str) -> CascadeSpec:
    return load_spec(FILE, (f"controller.arithmetic={arithmetic}", *changes))


def following(arithmetic: str, *changes: str):
    """Following error sample by sample of half a metre per second."""
    host = CascadeHost(spec_in(arithmetic, *changes))
    move = plan_move(host.spec.mechanics.start_position, 0.3, MotionLimits(0.5, 5.0, 200.0), host.period)
    host.follow(move)
    return host.watch(move.count)["controller.law.position_error"].astype(np.float64)


# ---- the file


def test_the_key_stands_among_those_in_effect_and_double_is_usual():
    assert load_spec(FILE).controller.arithmetic == "double"
    assert spec_in("single").controller.arithmetic == "single"
    rotary = load_spec(detent.example("turntable.toml"), SINGLE)
    assert {type(build_cascade(one)) for one in (rotary, spec_in("single"))} == {single(CascadeParams)}
    assert type(build_cascade(load_spec(FILE))) is CascadeParams


def test_another_word_is_refused_with_those_that_are_allowed():
    with pytest.raises(InputError, match=r'controller\.arithmetic: got half; expected: "double" or "single"'):
        spec_in("half")


@pytest.mark.parametrize("name", ["filtered_servo", "phase_servo", "print_head", "rotary_table", "zoom"])
def test_other_methods_do_not_know_the_key(name):
    with pytest.raises(InputError, match="controller"):
        load_spec(detent.example(f"{name}.toml"), SINGLE)


# ---- the law


def test_everything_behind_the_position_error_is_single():
    rig = Rig(in_single(make_params()))
    c, p = rig.r.controller, rig.p.controller
    p.law.cascade.integral_gain, p.law.feed_forward.acceleration = 5e3, MASS
    c.reference.position = 0.1 + 1e-9
    rig.run(200)
    assert c.law.position_error == Single(c.reference.position - c.motor_sensor.position)
    assert isinstance(c.law.position_error, Single)
    assert isinstance(c.motor_sensor.position, float)
    assert not isinstance(c.motor_sensor.position, Single)
    assert c.law.command == Single(rig.r.lines.command)
    codes = {leaf.path: leaf.width.code for leaf in type(c).leaves()}
    doubles = {path for path, code in codes.items() if code == "f8"}
    assert doubles == {
        "reference.position", *(f"{one}_sensor.{name}" for one in ("motor", "load")
                                for name in ("zero", "position", "memory")),
    }  # fmt: skip


def test_the_errors_differ_by_far_less_than_a_count_and_not_by_nothing():
    """A velocity of 0.5 m/s is off by 2^-25 of it, which the position loop takes for 0.5 / 2^25 / 90.4 = 1.6e-10 m.

    So much is between both where nothing has steps; a converter, or counts, may take theirs a sample earlier.
    """
    ideal = ("encoder.resolution=0 m", "drive.command_step=0 V")
    for changes, most in ((ideal, 1e-9), (ideal[:1], 2e-7), ((), 3.1e-6)):
        double, other = (following(one, *changes) for one in ("double", "single"))
        assert 0.0 < np.abs(double - other).max() < most
        assert np.abs(double).max() == pytest.approx(np.abs(other).max(), rel=1e-4, abs=1e-8)
        assert 1e-5 < np.abs(double).max() < 1e-4


def test_an_integral_takes_no_increment_below_half_of_its_last_bit():
    """What single precision costs: of 4 V a bit is 2^-21 V, and what comes in smaller steps is lost."""
    for p, wanted in ((make_params(), True), (in_single(make_params()), False)):
        rig = Rig(p)
        law = rig.r.controller.law
        rig.p.controller.law.cascade.integral_gain = 1.0
        law.integral = 4.0
        rig.r.controller.motor_sensor.zero -= 1e-7  # it lies behind by so much: an increment of 6e-9 V
        before = law.integral
        rig.p.plant.machine.motor.mass = 1e30  # and stays there
        rig.run(20)
        assert (law.integral != before) == wanted


# ---- whatever runs it


def test_a_batch_has_the_bits_of_each_run(tmp_path):
    text = quick() + '\n[controller]\narithmetic = "single"\n'
    question = asked(tmp_path, '\n[tolerance]\n"mechanics.load_mass" = "10 %"\n', one_move("one", 0.0004, 0.0), text)
    chunk = run_chunk(question, 0, 3)
    for k in range(3):
        spec = machine(question, chunk.values, k).spec
        assert spec.controller.arithmetic == "single"
        told = question.method.run(spec, question.job).figures()
        for name, each in chunk.results.items():
            assert each[k] == told[name] or (math.isnan(each[k]) and math.isnan(told[name])), name
    made = build_many(spec, {}, 1)
    assert bytes(made[0]) == bytes(build_cascade(spec))


def operated(*changes: str) -> Host:
    host = Host(METHODS["cascade"], load_spec(FILE, changes), wall=False)
    host.run(1)
    for order in (ops.ENABLE, ops.CONFIRM):
        host.ask(order)
    host.run(2)
    assert host.state == "operation enabled"
    return host


def test_it_is_led_live():
    places, integrals = [], []
    for changes in ((), SINGLE):
        host = operated(*changes)
        controller = host.axis.state.controller
        assert (declared_of(type(controller)) is not type(controller)) == bool(changes)
        host.ask(MOVE_BY, 0.01)
        host.run(1000)
        assert host.board.operation.answer.rests
        places.append(host.axis.state.plant.machine.load.position)
        integrals.append(float(controller.law.integral))
    assert places[0] == pytest.approx(0.03, abs=2e-6)
    assert places[1] == pytest.approx(places[0], abs=2e-6)
    assert integrals[1] == pytest.approx(integrals[0], rel=1e-3)
    assert integrals[1] != integrals[0]


@pytest.mark.compiled
def test_a_fault_that_is_injected_has_the_code_that_it_has_in_double():
    codes = []
    for changes in ((), SINGLE):
        found = {}
        for text in ("drive wrong", "drive garbage", "encoder stuck", "load blocked"):
            host = operated(*changes)
            host.ask(MOVE_BY, 0.2)
            host.run(300)
            host.ask(*injection_of(host.axis.places, text))
            for _ in range(2000):
                host.run(1)
                if host.board.operation.fault:
                    break
            found[text] = host.board.operation.fault
        codes.append(found)
    assert codes[0] == codes[1]
    assert 0 not in codes[0].values()


def test_on_a_drive_and_leading_one_it_is_the_same():
    def operation(*_given):
        return ops.OperationParams()

    for arithmetic in ("double", "single"):
        spec = spec_in(arithmetic)
        for live, wiring in (wired(spec, operation)[""], led(spec, operation, "velocity")):
            assert type(live.params.controller) is type(build_cascade(spec).controller)
            assert (type(live.state.controller.law) is single(type(live.state.controller.law))) == (
                arithmetic == "single"
            )
            assert live.params.controller.law.max_command == (Single if arithmetic == "single" else float)(
                spec.largest_command
            )
            assert len(wiring.firmware) in (0, ctypes.sizeof(live.params.controller))


def test_margins_and_the_forecast_at_rest_are_those_of_the_numbers_not_of_their_rounding():
    double, other = (spec_in(one) for one in ("double", "single"))
    assert LinearLoop(double).margins == LinearLoop(other).margins
    assert bytes(CascadeEnsemble(double).params) == bytes(CascadeEnsemble(other).params)
