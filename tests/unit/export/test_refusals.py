"""Every refusal of an export, FW01 to FW15: its sentence, and that nothing is written."""

import pytest
from tests import firmware_steps
from tests.firmware_steps import REFUSED, STEPS, Limits, library, no_step, recursion, unbounded, wild_index, wild_shift

import detent
from detent.cli.app import main
from detent.errors import DetentError
from detent.export.unit import outside_ranges, unit_of
from detent.export.vectors import Golden
from detent.export.write import export_firmware, refuse_other_files
from detent.kernel.step import step
from detent.methods.cascade.build import build_cascade
from detent.translate.program import Program
from detent.translate.values import RefusedError

BY_STEPS = {
    "FW02": (firmware_steps.a_list, "the expression List"),
    "FW03": (no_step, "a call of hash; expected: a step; try: make it one, or an input"),
    "FW04": (library, "sin of the C library; expected: sqrt, floor; try: a table, or a routine of our own"),
    "FW06": (recursion, "recursion: recursion -> recursion; expected: calls that end; try: write a loop"),
    "FW07": (unbounded, "a loop without a bound; expected: one with; try: state it: @bounded(turns, why)"),
    "FW08": (wild_shift, "expected: one by 0 to 62; try: declare a range of the register"),
    "FW09": (wild_index, "expected: one from 0 to below 8; try: declare a range of the register"),
    "FW10": (firmware_steps.effect_in_or, "split the expression into lines"),
}
"""Refusals by a step, each with what it tells."""


@pytest.fixture(scope="module")
def cascade():
    return detent.load(detent.example("cascade.toml"))


@pytest.mark.parametrize("code", BY_STEPS)
def test_a_step_is_refused_with_file_line_and_what_to_write(monkeypatch, code):
    for one in (*STEPS, recursion):
        monkeypatch.setattr(firmware_steps, one.__name__, step(one))
    refused, sentence = BY_STEPS[code]
    assert REFUSED[refused] == code
    with pytest.raises(RefusedError) as caught:
        Program("t", {"t_one": refused}, Limits)
    told = str(caught.value)
    assert told.startswith("firmware_steps.py:")
    assert int(told.split(":")[1]) >= refused.__code__.co_firstlineno
    assert f": {code}: got " in told
    assert told.endswith(sentence) or sentence in told
    assert (caught.value.code, caught.value.exit_status) == (code, 1)


def refused(code: str, sentence: str, call) -> None:
    with pytest.raises(RefusedError, match=rf"^{code}: got ") as caught:
        call()
    assert sentence in str(caught.value)
    assert (caught.value.code, caught.value.exit_status) == (code, 1)


def test_fw01_tells_which_methods_have_a_unit(cascade, monkeypatch):
    monkeypatch.setattr(type(cascade.method), "actions", property(lambda _: ()))
    refused("FW01", "an axis of the method cascade; expected: one of ", lambda: unit_of(cascade))


def test_fw05_tells_which_register_is_too_wide(cascade, tmp_path):
    place = tmp_path / "out"
    told = "params.motor_sensor.period, a number of 64 bits, for avr, whose double has 32"
    refused("FW05", told, lambda: export_firmware(cascade, place, target="avr"))
    assert not place.exists()


def test_fw11_is_an_axis_that_fails_its_check(tmp_path, monkeypatch, capsys):
    words = ["export", "firmware", str(detent.example("cascade.toml")), "--set", "limits.travel=-1 m"]
    monkeypatch.setattr("sys.argv", ["detent", *words, "--output", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    told = capsys.readouterr().err
    assert "FW11: got an axis that fails detent check" in told
    assert "limits.travel" in told
    assert not (tmp_path / "out").exists()


def test_fw12_tells_the_value_and_its_range(cascade, tmp_path, monkeypatch):
    monkeypatch.setattr("detent.export.write.outside_ranges", lambda *_: iter([("law.period", 7, (0, 5))]))
    place = tmp_path / "out"
    refused("FW12", "law.period = 7; expected: 0 to 5", lambda: export_firmware(cascade, place, ticks=10))
    assert not place.exists()


def test_fw12_finds_a_parameter_outside_its_range(cascade):
    params = build_cascade(cascade.spec).controller
    params.motor_sensor.delay = 64
    assert list(outside_ranges(params)) == [("motor_sensor.delay", 64, (0, 63))]


@pytest.mark.parametrize("prefix", ["while", "9lives", "a-b", "bool", "NULL"])
def test_fw13_is_a_prefix_that_is_no_name_in_c(cascade, prefix):
    refused("FW13", f"the prefix {prefix!r}; expected: a name in C", lambda: unit_of(cascade, prefix))


def test_fw13_is_two_functions_of_one_name(monkeypatch):
    entries = {"t_bump": firmware_steps.arithmetic, "t_firmware_steps_bump": firmware_steps.floats}
    monkeypatch.setattr(firmware_steps, "bump", step(firmware_steps.bump))
    with pytest.raises(RefusedError, match="FW13: got two functions t_firmware_steps_bump"):
        Program("t", entries | {"t_effects": firmware_steps.effects}, Limits)


def test_fw14_is_a_folder_of_somebody_else(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(DetentError, match=r"FW14: a folder with mine\.txt"):
        refuse_other_files(tmp_path)


def test_fw15_is_a_job_in_which_something_else_writes_the_controller(cascade):
    unit = unit_of(cascade)
    state = cascade.method.registers()()
    golden = Golden(unit, cascade.method.registers(), 10)
    state.controller.count = 5  # as a disturbance at a line of the controller would
    params = cascade.method.parameters()()
    refused("FW15", "c.count is written by a host from outside", lambda: golden.begin(params, state, ()))
