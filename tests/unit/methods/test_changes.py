"""Parameters that a job changes: in the file, and before which tick."""

from types import SimpleNamespace

import pytest

import detent
from detent.errors import InputError
from detent.kernel.registers import Registers, block, f8, i1, i2_array, i8, register, u1
from detent.methods.changes import ParameterChange, changes_of, lay_changes
from detent.methods.moves.job import load_moves
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


def lay(made, *changes: ParameterChange) -> None:
    lay_changes({"": made}, SimpleNamespace(name="job.toml", changes=changes))


def test_a_parameter_has_its_value_from_its_tick_on():
    made, seen = machine()
    changes = [ParameterChange(4, 3.0, "law.gain", 7.0), ParameterChange(1, 1.5, "law.gain", 5.0)]
    lay(made, *changes)
    assert made.pass_ticks(10) == 10
    assert seen == [0.0] * 3 + [5.0] * 3 + [7.0] * 4
    assert made.changes == []


def test_a_change_at_power_on_is_there_in_the_first_tick():
    made, seen = machine()
    lay(made, ParameterChange(1, 0.0, "law.gain", 2.0))
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
        lay(made, ParameterChange(9, 1.0, name, value), ParameterChange(1, 0.0, "law.gain", 2.0))
    assert f"job.toml:9:1 {'value' if '=' in told else 'name'}: got {told}" in str(caught.value)
    assert made.changes == []


def test_of_several_motors_each_has_its_own_changes():
    one, seen_by_one = machine()
    two, seen_by_two = machine()
    told = (ParameterChange(1, 1.0, "b.law.gain", 3.0), ParameterChange(5, 0.5, "b.law.gain", 2.0))
    job = SimpleNamespace(name="job.toml", changes=told)
    lay_changes({"a": one, "b": two}, job)
    assert [change.value for change in changes_of(job, "b")] == [2.0, 3.0]
    one.pass_ticks(3)
    two.pass_ticks(3)
    assert (seen_by_one, seen_by_two) == ([0.0] * 3, [0.0, 2.0, 3.0])
    wrong = SimpleNamespace(name="job.toml", changes=(ParameterChange(7, 0.0, "law.gain", 2.0),))
    with pytest.raises(
        InputError, match=r"job\.toml:7:1 name: got law\.gain, of no motor; expected: one of a, b and a"
    ):
        lay_changes({"a": one, "b": two}, wrong)


@pytest.mark.parametrize(
    ("method", "text"),
    [
        ("cascade", '[[move]]\nby = "1 mm"\n'),
        ("filtered_servo", '[[move]]\nby = "1 mm"\n'),
        ("phase_servo", '[[move]]\ntarget = "5.08 mm"\n'),
        ("rotary_table", "[[step]]\ngo = 1\n"),
        ("zoom", '[[move]]\ngroup_a = "5 mm"\n'),
        ("print_head", 'print = "line.txt"\n'),
    ],
)
def test_every_method_reads_them_from_its_job_and_refuses_a_name_that_is_none(method, text, tmp_path):
    (tmp_path / "line.txt").write_text("a line")
    file, motor = tmp_path / "job.toml", "group_a." if method == "zoom" else ""
    file.write_text(f'{text}\n[[parameter_change]]\ntime = "1 ms"\nname = "{motor}gone"\nvalue = 3\n')
    axis = detent.load(detent.example(f"{method}.toml"))
    job = axis.load_job(file)
    assert job.changes == (ParameterChange(text.count("\n") + 2, 0.001, f"{motor}gone", 3.0),)
    with pytest.raises(InputError, match=rf"job\.toml:{job.changes[0].row}:1 name: got {motor}gone, which is none"):
        axis.run(job)


def test_a_file_tells_time_name_value_and_its_line(tmp_path):
    file = tmp_path / "job.toml"
    file.write_text('[[move]]\nby = "1 mm"\n\n[[parameter_change]]\ntime = "20 ms"\nname = "law.gain"\nvalue = 3\n')
    assert load_moves(file).changes == (ParameterChange(4, 0.02, "law.gain", 3.0),)
    file.write_text(file.read_text().replace("20 ms", "-1 s"))
    with pytest.raises(InputError, match="time"):
        load_moves(file)
