"""The page of what was tried: its figures are of tests that there are, and of all that attack."""

import ast
import importlib.util
import tomllib

import pytest
from tests.docs.pages import ROOT


def generator():
    """The module that makes the tables of the page."""
    spec = importlib.util.spec_from_file_location("docs_generate", ROOT / "docs" / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GENERATE = generator()
ATTACKS = tomllib.loads((ROOT / "docs" / "tried.toml").read_text(encoding="utf-8"))["attack"]


def attacking_tests():
    """Names of the tests that take the fixture `tried`."""
    for file in sorted((ROOT / "tests").rglob("test_*.py")):
        text = file.read_text(encoding="utf-8")
        if "tried(" in text:
            for one in ast.walk(ast.parse(text)):
                if isinstance(one, ast.FunctionDef) and "tried" in [argument.arg for argument in one.args.args]:
                    yield f"{file.relative_to(ROOT)}::{one.name}"


def test_every_figure_is_of_a_test_and_every_attack_has_one():
    assert {attack["test"] for attack in ATTACKS} == set(attacking_tests()), "run `make tried`"


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack["what"])
def test_each_row_is_on_the_page(attack):
    page = GENERATE.tried()
    assert f"### {GENERATE.ATTACKS[attack['kind']]}\n" in page
    assert f"| {attack['what']} | {attack['times']:,} | {attack['outcome']} | `{attack['test']}` |" in page
    assert attack["times"] > 0
