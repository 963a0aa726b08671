"""The examples in docstrings are true: every module of the package is imported and its doctests run."""

import doctest
import importlib
import inspect

import pytest
from tests.docs.pages import ROOT

SOURCES = ROOT / "src"
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def module_names():
    """Every module below src, as it is imported; `__main__` would start the program."""
    for path in sorted(SOURCES.rglob("*.py")):
        parts = path.relative_to(SOURCES).with_suffix("").parts
        if parts[-1] != "__main__":
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def examples_of(module):
    """The doctests of a module, those of compiled steps (which hide their Python function) included."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = {test.name: test for test in finder.find(module)}
    for name, value in vars(module).items():
        function = getattr(value, "py_func", None)
        if inspect.isfunction(function) and function.__module__ == module.__name__:
            for test in finder.find(function, f"{module.__name__}.{name}", module, vars(module)):
                found.setdefault(test.name, test)
    return found.values()


@pytest.mark.parametrize("name", list(module_names()))
def test_examples_in_docstrings(name, tmp_path, monkeypatch):
    module = importlib.import_module(name)
    monkeypatch.chdir(tmp_path)
    report = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for test in examples_of(module):
        runner.run(test, out=report.append)
    assert not runner.failures, "".join(report)
