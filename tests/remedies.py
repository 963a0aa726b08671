"""Remedies that name a value: what they name is accepted, and nothing nearer to what was refused would be."""

import re
from copy import copy
from functools import wraps

import pytest

from detent.errors import InputError
from detent.methods.registry import METHODS
from detent.units import format_quantity
from tests.bad_files import Bad, check_bad_file

VALUE = r'"[^"]*"|\[[^\]]*\]|[\w.+-]*\w'
NAMED = re.compile(rf"set ([a-z0-9_.]+) = ({VALUE})(?: and ([a-z0-9_.]+) = ({VALUE}))?")
NUMBER = re.compile(r'"([\d.e+-]+) (.+)"')


def alternatives(remedy):
    """What a remedy names, as overrides; each of them alone would do."""
    found = [match.groups() for match in NAMED.finditer(remedy)]
    return [[f"{key}={value}" for key, value in zip(entry[::2], entry[1::2], strict=True) if key] for entry in found]


def neighbours(override):
    """The same key a little lower and a little higher; none for a word, a list or nothing at all."""
    key, value = override.split("=", 1)
    quantity = NUMBER.fullmatch(value)
    if quantity:
        number, unit = quantity.groups()
        if float(number) == 0:
            return []
        return [f"{key}={format_quantity(float(number) * factor, '', 9)} {unit}" for factor in (0.997, 1.003)]
    if re.fullmatch(r"-?\d+", value):
        return [f"{key}={int(value) + step}" for step in (-1, 1)]
    return []


def is_refused(load_text, text, overrides):
    try:
        load_text(text, *overrides)
    except InputError:
        return True
    return False


def check_remedies(load_text, text, overrides, problem):
    """Each value that a problem's remedy names is accepted; of its two neighbours one is not. Returns how many."""
    named = alternatives(problem.remedy)
    for alternative in named:
        load_text(text, *overrides, *alternative)
        near = [n for override in alternative for n in neighbours(override)]
        refused = [is_refused(load_text, text, [*overrides, n]) for n in near]
        assert any(refused) or not near, f"{alternative}: a nearer value would do as well"
    return len(named)


def check_rule(bad, good_text, load_text):
    """Load the bad file: the problem expected, and a remedy that holds what it promises."""
    check_bad_file(bad, good_text, load_text)
    text = bad.make(good_text)
    with pytest.raises(InputError) as caught:
        load_text(text, *bad.overrides)
    count = check_remedies(load_text, text, bad.overrides, caught.value.problems[0])
    # A table of rules says how many values it expects a message to name.
    assert count == bad.remedy.count("set ")


def given(name, *overrides, key, came, allowed, remedy, others=0):
    """A bad axis made by overrides of the good file; the problem stands at the last that the rule looks at."""
    return Bad(name, "--set", key, came, allowed, remedy, overrides=overrides, others=others)


def broken_rules(method, entries, good_text, load_text, monkeypatch):
    """Names of the rules of a method that bad files break."""
    broken = set()

    def noting(rule):
        @wraps(rule)
        def run(spec):
            for contradiction in rule(spec):
                broken.add(rule.__name__)
                yield contradiction

        return run

    watched = copy(METHODS[method])
    watched.rules = tuple(noting(rule) for rule in watched.rules)
    monkeypatch.setitem(METHODS, method, watched)
    for bad in entries:
        is_refused(load_text, bad.make(good_text), bad.overrides)
    return broken
