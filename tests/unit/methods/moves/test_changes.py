"""Parameters that a job changes: in the file, and before which tick."""

from types import SimpleNamespace

import pytest

from detent.errors import InputError
from detent.kernel.registers import Registers, block, f8, i1, i2_array, i8, register, u1
from detent.methods.moves.changes import lay_changes
from detent.methods.moves.job import ParameterChange, load_moves
from detent.record.machine import Machine


class LawParams(Registers):
    """Some parameters."""

    gain: f8 = register("gain")
    delay: i8 = register("delay", range=(0, 63))
    small: i1 = register("a width that is its own range")
    kind: u1 = register("an option", option=True)
    table: i2_array = register("a table", length=3)


class Params(Registers):
    """Of a controller."""

    law: LawParams = block("law")


class Plain(Registers):
    """State of an axis."""

    tick: i8 = register("ticks")


def machine(recorder=None):
    """Of which every tick notes the gain that it has."""
    params, state, seen = SimpleNamespace(controller=Params()), Plain(), []

    def advance(p, r, ticks, *_):
        seen.extend([p.controller.law.gain] * ticks)
        r.tick += ticks
        return ticks

    return Machine(params, state, 0.5, recorder, advance=advance), seen


def test_a_parameter_has_its_value_from_its_tick_on():
    made, seen = machine()
    changes = [ParameterChange(4, 3.0, "law.gain", 7.0), ParameterChange(1, 1.5, "law.gain", 5.0)]
    lay_changes(made, changes, "job.toml")
    assert made.pass_ticks(10) == 10
    assert seen == [0.0] * 3 + [5.0] * 3 + [7.0] * 4
    assert made.changes == []


def test_a_change_at_power_on_is_there_in_the_first_tick():
    made, seen = machine()
    lay_changes(made, [ParameterChange(1, 0.0, "law.gain", 2.0)], "job.toml")
    made.pass_ticks(2)
    assert seen == [2.0, 2.0]


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("law.delay", 64.0, "law.delay = 64; expected: a whole number of i8 from 0 to 63"),
        ("law.delay", 1.5, "law.delay = 1.5; expected: a whole number of i8"),
        ("law.small", 128.0, "law.small = 128; expected: a whole number of i1"),
        ("law.kind", 1.0, "law.kind, an option"),
        ("law.table", 1.0, "law.table, a table"),
        ("law", 1.0, "law, which is none"),
        ("law.gain.more", 1.0, "law.gain.more, which is none"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_line_and_nothing_is_laid(name, value, told):
    made, _ = machine()
    with pytest.raises(InputError) as caught:
        lay_changes(made, [ParameterChange(9, 1.0, name, value), ParameterChange(1, 0.0, "law.gain", 2.0)], "job.toml")
    assert f"job.toml:9:1 {'value' if '=' in told else 'name'}: got {told}" in str(caught.value)
    assert made.changes == []


def test_a_file_tells_time_name_value_and_its_line(tmp_path):
    file = tmp_path / "job.toml"
    file.write_text('[[move]]\nby = "1 mm"\n\n[[parameter_change]]\ntime = "20 ms"\nname = "law.gain"\nvalue = 3\n')
    assert load_moves(file).changes == (ParameterChange(4, 0.02, "law.gain", 3.0),)
    file.write_text(file.read_text().replace("20 ms", "-1 s"))
    with pytest.raises(InputError, match="time"):
        load_moves(file)
