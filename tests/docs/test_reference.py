"""Everything a person can look up is documented: registers, keys, options, status bits, motors, the Python API."""

import inspect
import re

import pytest
from tests.docs.pages import ROOT
from tests.reference import reference_rows

import detent
from detent.cli import docs
from detent.control import head_computer
from detent.errors import SB1_TEXT
from detent.methods.registry import METHODS
from detent.record.trace import Trace

LEAVES = [
    (f"{name}: {leaf.path}", leaf)
    for name, method in METHODS.items()
    for declared in (method.registers(), method.parameters())
    for leaf in declared.leaves()
]
KEYS = [(f"{name}: {row.key}", row) for name in METHODS for row in reference_rows(name)]

# Registers without a unit are flags, lines of a circuit, directions, indices, or pure numbers; their text says so in
# one of these ways.
PURE = re.compile(
    r"\b[01]:? |\b[01],|direction|level|line\b|quarter cycles|probability|column|bank"
    r"|from (current|velocity)|pulse responses|K[SP]?[123]: |multiplier|2\^-|bits after"
    r"|flip-flop|clock|pulse|gate\b|top bit|position signal|which edge|strobe|ready 1e|stop 100b|comparator|channel"
    r"|[Ll]eave a fault"
)
# Classes that a script works with.
DOCUMENTED = {
    "Axis": detent.Axis,
    "Run": detent.Run,
    "Trace": Trace,
}


OPTIONS = [(name, option) for name, command in docs.commands().items() for option in command.params]


@pytest.mark.parametrize("leaf", [pytest.param(leaf, id=name) for name, leaf in LEAVES])
def test_register_has_a_meaning_and_a_unit(leaf):
    assert len(leaf.doc) > 3
    assert leaf.unit or PURE.search(leaf.doc), f"{leaf.path}: no unit, and {leaf.doc!r} is no pure number or flag"


@pytest.mark.parametrize("row", [pytest.param(row, id=name) for name, row in KEYS])
def test_key_of_the_axis_file_has_a_meaning_and_a_range(row):
    assert len(row.doc) > 3
    assert row.allowed
    assert bool(row.example) == row.required


@pytest.mark.parametrize(("command", "option"), OPTIONS, ids=lambda value: getattr(value, "name", value))
def test_option_of_a_command_has_help(command, option):
    assert option.help, f"detent {command}: {option.name} has no help"


def test_every_command_says_what_it_does():
    assert all(command.help for command in docs.commands().values())


def test_every_status_bit_of_the_axis_computer_has_a_text():
    names = ("ILLEGAL", "OUT_OF_RANGE", "NOT_CALIBRATED", "OBSTRUCTION", "IMPLAUSIBLE", "OVERRUN")
    assert {getattr(head_computer, name) for name in names} == set(SB1_TEXT)


@pytest.mark.parametrize("name", list(docs.PAGES))
def test_a_page_includes_each_generated_part(name):
    (page,) = (file.read_text(encoding="utf-8") for file in (ROOT / "docs").glob(f"*/{name}.md"))
    assert f"{{include}} ../_build/generated/{name}.md" in page
    assert docs.PAGES[name]().count("\n|") >= 3 or name == "command-line"


def test_generated_parts_hold_every_register_key_command_and_motor():
    registers, keys = docs.registers(), docs.axis_file()
    assert all(f"`{leaf.path}`" in registers for _, leaf in LEAVES)
    assert all(f"`{row.key.rpartition('.')[2]}`" in keys for _, row in KEYS)
    for page in (registers, keys):
        sections = [line for line in page.splitlines() if line.startswith("## ")]
        assert [line.lower() for line in sections] == [f"## {method.title.lower()}" for method in METHODS.values()]
    text = docs.command_line()
    assert all(f"\n## {name}\n" in "\n" + text for name in docs.commands())
    assert all(
        f"`{option}" in text or f" {option}" in text for _, p in OPTIONS for option in p.opts if option[0] == "-"
    )


@pytest.mark.parametrize("name", [name for name in detent.__all__ if not name.startswith("__")])
def test_api_page_holds_the_whole_api(name):
    page = (ROOT / "docs" / "reference" / "api.rst").read_text(encoding="utf-8")
    assert f":: detent.{name}\n" in page
    assert inspect.getdoc(getattr(detent, name))


@pytest.mark.parametrize("owner", DOCUMENTED.values(), ids=DOCUMENTED.keys())
def test_public_methods_of_the_api_are_documented(owner):
    bare = [
        name
        for name, member in vars(owner).items()
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property))
        if not inspect.getdoc(member)
    ]
    assert not bare


def test_every_example_is_mentioned():
    pages = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts)
    assert all(f"examples/{script.name}" in pages for script in (ROOT / "examples").glob("*.py"))
