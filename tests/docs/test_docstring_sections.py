"""numpydoc sections stand where the documentation publishes them; elsewhere one line says what a name is."""

import ast
import importlib
import inspect
import re

import pytest
from tests.docs.pages import ROOT

SOURCES = ROOT / "src"
PAGE = ROOT / "docs" / "reference" / "api.rst"
SECTION = re.compile(r"^(Parameters|Returns|Yields|Raises|Warns|See Also|Attributes)\n-{3,}$", re.MULTILINE)
DIRECTIVE = re.compile(r"^\.\. auto(module|class|function|exception):: ([\w.]+)\n(?:   :members:(.*)\n)?", re.MULTILINE)


def place(value):
    """Module and qualified name, by which a name of the page is found again in its source."""
    value = inspect.unwrap(getattr(value, "fget", None) or getattr(value, "__func__", None) or value)
    value = getattr(value, "py_func", value)
    return getattr(value, "__module__", ""), getattr(value, "__qualname__", "")


def named(path):
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def published():
    """Places of what the page of the API shows."""
    for kind, path, listed in (found.groups() for found in DIRECTIVE.finditer(PAGE.read_text(encoding="utf-8"))):
        owner = importlib.import_module(path) if kind == "module" else named(path)
        yield (owner.__name__, "") if kind == "module" else place(owner)
        names = [] if listed is None else [name.strip() for name in listed.split(",") if name.strip()] or vars(owner)
        yield from (place(inspect.getattr_static(owner, name, None)) for name in names if not name.startswith("_"))


PUBLISHED = set(published())


def sections(tree, prefix=""):
    """Qualified names of what has numpydoc sections."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            if SECTION.search(ast.get_docstring(node) or ""):
                yield prefix + node.name
            yield from sections(node, f"{prefix}{node.name}.")


@pytest.mark.parametrize("path", sorted(SOURCES.rglob("*.py")), ids=lambda path: path.relative_to(SOURCES).as_posix())
def test_sections_stand_only_where_they_are_published(path):
    parts = path.relative_to(SOURCES).with_suffix("").parts
    module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    found = [(module, name) for name in sections(ast.parse(path.read_text(encoding="utf-8")))]
    assert [name for name in found if name not in PUBLISHED] == []


BRIEF = 6
"""Lines of a function inside another one that the other one's docstring may speak for."""


@pytest.mark.parametrize("path", sorted(SOURCES.rglob("*.py")), ids=lambda path: path.stem)
def test_a_function_inside_another_has_a_docstring_too(path):
    """Ruff asks it only of what others can import."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)]
    without = [one for one in functions if not one.name.startswith("_") and ast.get_docstring(one) is None]
    assert [one.name for one in without if (one.end_lineno or one.lineno) - one.lineno >= BRIEF] == []
