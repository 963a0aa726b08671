"""Entries of the table of tolerances: what is found of a constant, and what somebody wrote."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.identify_files import AXIS, write_log

from detent.files.source import parse_source
from detent.identify.fit.constants import Constants
from detent.identify.fit.identification import Identification, identify
from detent.identify.fit.verdict import Refusal
from detent.identify.write.file_numbers import Number
from detent.identify.write.intervals import tolerance_values
from detent.identify.write.outputs import axis_toml
from detent.logs.read_log import read_log
from detent.methods.load import AxisFile, axis_of

MASS, VISCOUS = "mechanics.motor_mass", "mechanics.friction.positive.viscous"
COULOMB = "mechanics.friction.positive.coulomb"


def entries(*numbers: Number, constants: Constants | None = None, text: str = "", held=(MASS, VISCOUS)):
    return {one.key.removeprefix("tolerance."): one.text for one in tolerance_values(numbers, constants, text, held)}


def mass(low: float = 3.9, high: float = 4.1, **more) -> Number:
    return replace(Number(MASS, 4.0, "kg", "95 %: 3.9 kg to 4.1 kg, run.csv", True, "mass", low, high), **more)


def viscous(value: float, half: float) -> Number:
    note = "95 %: so much, run.csv"
    return Number(VISCOUS, value, "N*s/m", note, True, "viscous.positive", value - half, value + half)


def test_a_trusted_constant_is_normal_in_its_interval():
    assert entries(mass()) == {MASS: '{ interval = ["3.9 kg", "4.1 kg"], distribution = "normal" }'}


def test_an_interval_holds_the_value_as_it_is_written():
    assert entries(mass(4.0 - 1e-9, 4.0 + 1e-9))[MASS].startswith('{ interval = ["3.99996 kg", "4.00004 kg"]')


def test_near_what_a_key_may_be_it_is_uniform_and_cut():
    """A normal one would leave the key's bounds: such machines cannot be, and would count as bad."""
    assert entries(viscous(2.0, 1.5))[VISCOUS] == '{ interval = ["500 mN*s/m", "3.5 N*s/m"] }'
    assert entries(viscous(1.0, 1.5))[VISCOUS] == '{ interval = ["10 uN*s/m", "2.5 N*s/m"] }'
    assert "normal" in entries(viscous(4.0, 1.5))[VISCOUS]


def test_a_delay_is_whole_samples_or_none():
    delay = Number("drive.delay", 2.0, "", "95 %: a, run.csv", True, "delay", 1.4, 2.6)
    assert entries(delay) == {"drive.delay": "{ interval = [1, 3] }"}
    assert entries(replace(delay, low=1.9, high=2.1)) == {}


def test_static_friction_near_coulombs_follows_it():
    coulomb = Number(COULOMB, 5.0, "N", "95 %: a, b", True, "coulomb.positive", 4.9, 5.1)
    static = replace(coulomb, key=COULOMB.replace("coulomb", "static"), name="static.positive", value=6.0)
    near, far = replace(static, low=5.4, high=6.6), replace(static, low=5.9, high=6.1)
    assert list(entries(coulomb, near)) == [COULOMB]
    assert list(entries(coulomb, far)) == [COULOMB, static.key]


def test_what_is_not_trusted_is_marked_where_the_file_has_it():
    assert entries(mass(trusted=False)) == {MASS: '"not trusted"'}
    assert entries(mass(trusted=False), held=()) == {}


@pytest.mark.parametrize(
    ("entry", "kept"),
    [
        (f'"{MASS}" = "10 %"', True),
        (f'"{MASS}" = ["3 kg", "5 kg"]', True),
        ('mechanics.motor_mass = { interval = "10 %", distribution = "normal" }', True),
        (f'"{MASS}" = ["3 kg", "3.5 kg"]', False),
        (f'"{MASS}" = ["3 s", "5 kg"]', False),
        (f'"{MASS}" = 3', False),
        (f'"{MASS}" = "not trusted"', False),
        (f'"{MASS}" = ["3 kg", "5 kg"]  # identified: 95 %, old.csv', False),
    ],
)
def test_what_somebody_wrote_stays_where_it_holds(entry, kept):
    assert (entries(mass(), text=f"[tolerance]\n{entry}\n") == {}) == kept


def test_what_errs_together_is_drawn_jointly():
    names = ("mass", "coulomb.positive", "viscous.positive")
    table = np.array([[1.0, 0.4, 0.1], [0.4, 1.0, -0.9], [0.1, -0.9, 1.0]])
    constants = Constants(names, np.array([4.0, 5.0, 4.0]), table, np.full(3, np.inf), "")
    coulomb = Number(COULOMB, 5.0, "N", "95 %: a, b", True, "coulomb.positive", 4.9, 5.1)
    found = entries(mass(), coulomb, viscous(4.0, 0.5), constants=constants)
    assert "correlation" not in found[MASS]
    assert f'correlation = {{ "{MASS}" = 0.4 }}' in found[COULOMB]
    assert re.search(rf'correlation = {{ "{COULOMB}" = -0.\d+ }}', found[VISCOUS])
    assert MASS not in found[VISCOUS]  # 0.1 is below what counts


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    return identify([read_log(write_log(tmp_path_factory.mktemp("logs") / "bench.csv"))])


def read(text: str) -> AxisFile:
    return axis_of(parse_source("slide.toml", text))


@pytest.mark.compiled
@pytest.mark.parametrize("base", [None, AXIS], ids=["a new file", "a file that is there"])
def test_a_written_file_has_the_interval_of_every_trusted_constant(found, base):
    file = read(axis_toml(found, base, "slide.toml"))
    known = {one.name: one for one in found.trusted}
    for name, key in (("mass", MASS), ("viscous.positive", VISCOUS)):
        one = file.tolerance[key]
        assert one.normal
        assert (one.low, one.high) == pytest.approx((known[name].low, known[name].high), rel=1e-7)
    assert file.untrusted == ()


@pytest.mark.compiled
def test_a_constant_that_is_refused_is_asked_for_until_somebody_states_it(found):
    refused = (Refusal("not determined by the data", "wide", "record more", ("viscous.positive",)),)
    partly = replace(found, refusals=refused)
    text = axis_toml(partly, AXIS, "slide.toml")
    assert read(text).untrusted == (VISCOUS,)
    stated = text.replace(f'"{VISCOUS}" = "not trusted"', f'"{VISCOUS}" = "30 %"')
    assert read(stated).untrusted == ()
    assert read(axis_toml(partly, stated, "slide.toml")).untrusted == ()
    assert read(axis_toml(found, text, "slide.toml")).untrusted == ()
