"""The registry of control methods, and how a file chooses one of them."""

import inspect
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from typing import Literal

import pytest
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.axisfile.tables import AxisSpec, AxisTable, FacesTable
from detent.errors import DetentError, InputError
from detent.files.fields import leaf_fields, optional, options_of, required
from detent.files.findings import Caution, Contradiction, count_figure, quantity_figure
from detent.files.problems import dotted, field_at
from detent.files.quantities import Length
from detent.kernel.registers import Registers
from detent.methods.check import check_spec
from detent.methods.method import Method
from detent.methods.registry import METHODS

AXIS = ("axis.name", "axis.method", "axis.creep")  # keys of every method
FACES = [f"faces.{name}" for name in FacesTable.model_fields]  # the same


class SledAxisTable(AxisTable, frozen=True):
    """Name and method of the axis."""

    method: Literal["sled"] = required("control method", '"sled"')


class SledSpec(AxisSpec, frozen=True):
    """An axis of a method that knows no motor."""

    axis: SledAxisTable
    travel: Length = required("way of the sled", '"1 m"', gt=0.0)
    park: Length = optional("where the sled waits", 0.0, derived="half the travel")


PARKED_OUTSIDE = Contradiction(("park", "travel"), "up to travel", "lower park")


def park_inside(spec):
    if spec.park > spec.travel:
        yield PARKED_OUTSIDE


class Sled(Method[SledSpec]):
    name = "sled"
    title = "sled: goes downhill"
    jobs = "a slope"
    pace = "1 s, every one"
    spec = SledSpec
    rules = (park_inside,)

    def fill(self, spec):
        return spec if spec.park else spec.model_copy(update={"park": spec.travel / 2})

    def derive(self, spec):
        return (quantity_figure("way back", spec.travel, "m", "travel"),)

    def cautions(self, spec):
        if spec.travel > 9:
            yield Caution("travel", "long", "short", "it takes long", "walk")

    def registers(self):
        return Registers

    def parameters(self):
        return Registers


SLED_TEXT = 'travel = "2 m"\n[axis]\nname = "hill"\nmethod = "sled"\n'


@pytest.fixture(autouse=True)
def sled(monkeypatch):
    monkeypatch.setitem(METHODS.known, "sled", Sled())


def problem_of(load_text, key, text, *overrides):
    with pytest.raises(InputError) as caught:
        load_text(text, *overrides)
    (problem,) = [problem for problem in caught.value.problems if problem.key == key]
    return problem


@pytest.mark.parametrize("name", METHODS)
def test_a_method_is_complete(name):
    method = METHODS[name]
    assert method.name == name
    assert len(method.title) > len(name)
    assert options_of(field_at(method.spec, ("axis", "method"))) == (name,)
    assert [dotted(path) for path, _ in leaf_fields(method.spec)][:2] == ["axis.name", "axis.method"]
    assert method.rules
    assert all(leaf.doc for declared in (method.registers(), method.parameters()) for leaf in declared.leaves())


@pytest.mark.parametrize("name", METHODS)
def test_what_a_method_declares_is_there(name):
    method = METHODS[name]
    unused = "clock" if type(method).tick is not Method.tick else ""
    declared = [value for word, value in inspect.getmembers(method) if not word.startswith("_") and word != unused]
    texts = [text for value in declared for text in (value if isinstance(value, tuple) else (value,))]
    places = [text for text in texts if isinstance(text, str) and re.fullmatch(r"[\w.]+:\w+", text)]
    assert len(places) > 8
    assert all(method.brought(place) is not None for place in places)


def test_the_file_chooses_its_method(load_text, good_text):
    assert isinstance(load_text(SLED_TEXT).spec, SledSpec)
    assert type(load_text(good_text).spec) is METHODS["print_head"].spec


@pytest.mark.parametrize("override", ["axis.method=sled", 'axis.method="sled"'])
def test_an_override_chooses_the_method(load_text, override):
    assert isinstance(load_text(SLED_TEXT.replace('"sled"', '"print_head"'), override).spec, SledSpec)


def test_defaults_rules_and_reports_are_those_of_the_method(load_text):
    axis = load_text(SLED_TEXT)
    assert axis.spec.park == 1.0
    report = check_spec(axis)
    assert (report.method, [row.key for row in report.rows]) == ("sled", [*AXIS, "travel", "park"])
    assert [figure.text for figure in report.derived] == ["2 m"]
    assert report.warnings == ()
    assert [caution.name for caution in check_spec(load_text(SLED_TEXT, "travel=10 m")).warnings] == ["travel"]
    assert problem_of(load_text, "park", SLED_TEXT, "park=3 m").allowed == "up to travel"
    assert [row.key for row in reference_rows("sled")] == [*AXIS, *FACES, "travel", "park"]
    assert load_text(dump_spec(axis.spec)).spec == axis.spec


@pytest.mark.parametrize("edit", ['method = "sledge"', 'method = "Sled"', "method = 4", ""])
def test_a_message_about_the_method_lists_all_methods(load_text, edit):
    problem = problem_of(load_text, "axis.method", SLED_TEXT.replace('method = "sled"', edit))
    assert problem.allowed == " or ".join(f'"{name}"' for name in METHODS)
    assert '"sled"' in problem.allowed
    assert ("did you mean" in problem.remedy) == ("led" in edit)


def test_an_override_of_the_method_lists_all_methods(load_text, good_text):
    problem = problem_of(load_text, "axis.method", good_text, "axis.method=slid")
    assert (problem.file, problem.remedy) == ("--set", 'did you mean "sled"?')
    assert problem.allowed.endswith('or "sled"')


def test_a_catalogue_is_only_asked_where_the_method_has_one(load_text):
    problem = problem_of(load_text, "motor", f'{SLED_TEXT}[motor]\ncatalogue = "no such motor"\n')
    assert problem.got == "the unknown table [motor]"


@pytest.mark.process
def test_the_registry_loads_no_compiled_blocks():
    blocks = "{'numba', 'detent.methods.cascade.system'}"
    program = f"import sys; import detent.methods.registry; assert not {blocks} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


@pytest.fixture
def lost(monkeypatch):
    monkeypatch.setitem(METHODS.known, "lost", EntryPoint("lost", "nowhere.to_be_found:Lost", "detent.methods"))


@pytest.mark.usefixtures("lost")
def test_a_method_that_cannot_be_loaded_breaks_no_other(load_text, good_text):
    assert {method.name for method in METHODS.usable()} == set(METHODS) - {"lost"}
    (sentence,) = METHODS.refused
    assert sentence.startswith("method lost: nowhere.to_be_found:Lost")
    assert load_text(good_text).spec.axis.method == "print_head"
    assert problem_of(load_text, "axis.method", SLED_TEXT.replace('method = "sled"', "")).line


@pytest.mark.usefixtures("lost")
def test_a_method_that_cannot_be_loaded_is_refused_where_it_is_asked_for(load_text):
    with pytest.raises(DetentError, match="nowhere") as caught:
        load_text(SLED_TEXT.replace('"sled"', '"lost"'))
    assert caught.value.exit_status == 2


def test_figures_are_written_for_people():
    assert quantity_figure("mass", 0.06, "kg", "m").text == "60 g"
    assert count_figure("friction", 36.004, "f").text == "36 counts"
    assert count_figure("scale", 7.8947, "f", "count/V").text == "7.895 count/V"
