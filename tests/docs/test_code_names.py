"""Names of functions and registers on the pages that explain the code exist: `module.function`, `block.register`."""

import importlib
import re
from functools import cache

import pytest
from tests.docs.pages import ROOT, inline_code_of, page_name
from tests.reference import reference_rows

from detent.kernel.registers import Registers
from detent.methods.registry import METHODS

PAGES = [
    ROOT / "docs" / "explanation" / name
    for name in (
        "one-tick.md", "print-head.md", "phase-servo.md", "filtered-servo.md", "rotary-table.md", "stepper-envelope.md",
        "what-protects-an-axis.md",
    )
]  # fmt: skip
# `module.function`, `module.Class.method`, `block.register`; a file name such as `letter.txt` has a known ending.
DOTTED = re.compile(r"[a-z_]+(\.\w+)+")
FILE_ENDINGS = (".toml", ".txt", ".py", ".h5", ".md", ".prn", ".html")


@cache
def modules():
    """Every module of the package by its last name."""
    package = ROOT / "src" / "detent"
    found = {}
    for path in sorted(package.rglob("*.py")):
        if path.stem not in ("__init__", "__main__"):
            name = ".".join(path.relative_to(package.parent).with_suffix("").parts)
            found.setdefault(path.stem, []).append(name)
    return found


def is_register(name):
    """Tell whether `name` is a register, or a block of them, of the state or of the parameters."""
    declared = [registers for method in METHODS.values() for registers in (method.registers(), method.parameters())]
    leaves = [leaf.path for registers in declared for leaf in registers.leaves()]
    return any(path == name or path.startswith(name + ".") for path in leaves)


def is_code(name):
    """Tell whether `name` leads, from the last name of a module on, to something that exists."""
    first, *rest = name.split(".")
    for module in modules().get(first, []):
        found = importlib.import_module(module)
        for part in rest:
            if isinstance(found, type) and issubclass(found, Registers) and part in found.__fields__:
                found = found.__fields__[part]
            else:
                found = getattr(found, part, None)
        if found is not None:
            return True
    return False


def is_axis_key(name):
    """Tell whether `name` is a key, or a table, of the axis file."""
    return any(
        row.key == name or row.key.startswith(name + ".") for method in METHODS for row in reference_rows(method)
    )


def exists(name):
    """Tell whether `name` is any of these."""
    return is_code(name) or is_register(name) or is_axis_key(name)


def dotted_names(page):
    return [
        (line, text)
        for line, text in inline_code_of(page)
        if DOTTED.fullmatch(text) and not text.endswith(FILE_ENDINGS)
    ]


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_names_of_the_code_exist(page):
    wrong = [f"{page_name(page)}:{line}: {text}" for line, text in dotted_names(page) if not exists(text)]
    assert not wrong, "no such function, register or key:\n" + "\n".join(wrong)


def test_the_page_of_the_tick_names_functions_of_every_block_of_the_loop():
    rooms = {
        module.split(".")[1]
        for _, text in dotted_names(PAGES[0])
        for module in modules().get(text.split(".")[0], [])
        if is_code(text)
    }
    assert {"kernel", "methods", "control", "drive", "plant", "sensing", "record"} <= rooms


@pytest.mark.parametrize("name", ["head_motion.put_drives", "h_bridge.Bridge.pulses", "no_module.step", "head.outs"])
def test_a_wrong_name_is_noticed(name):
    assert not exists(name)
