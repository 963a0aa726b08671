"""Remedies that name a value: with it the finding is gone, a little short of it the finding is back."""

import re
from copy import copy
from functools import wraps

from detent.errors import InputError
from detent.methods.registry import METHODS
from detent.units import format_quantity
from tests.bad_files import check_bad_file

VALUE = r'"[^"]*"|\[[^\]]*\]|[\w.+-]*\w'
NAMED = re.compile(rf"set ([a-z0-9_.]+) = ({VALUE})(?: and ([a-z0-9_.]+) = ({VALUE}))?")
NUMBER = re.compile(r'"([\d.e+-]+) (.+)"')


def named_value(remedy):
    """What a remedy names, as overrides; nothing where it is a sentence."""
    found = NAMED.search(remedy)
    entry = found.groups() if found else ()
    return [f"{key}={value}" for key, value in zip(entry[::2], entry[1::2], strict=True) if key]


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


def check_rule(bad, good_text, load_text, golden):
    """Load the bad file: the problem expected, gone with the value named, there again a little beside it."""
    text, problem = bad.make(good_text), check_bad_file(bad, good_text, load_text, golden)
    named = named_value(problem.remedy)
    assert problem.remedy
    if named:
        load_text(text, *bad.overrides, *named)
        near = [override for one in named for override in neighbours(one)]
        assert not near or any(is_refused(load_text, text, [*bad.overrides, one]) for one in near)


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
    monkeypatch.setitem(METHODS.known, method, watched)
    for bad in entries:
        is_refused(load_text, bad.make(good_text), bad.overrides)
    return broken


def check_caution(look, overrides, name, finding, *, at_bound=True):
    """A caution is gone with the value it names, and there again a little beside it; `look` gives cautions by name."""
    named = named_value(finding.remedy)
    assert finding.remedy
    if named:
        assert name not in look(*overrides, *named)
        near = [override for one in named for override in neighbours(one)]
        assert not near or not at_bound or any(_found(look, name, [*overrides, one]) for one in near)


def _found(look, name, overrides):
    try:
        return name in look(*overrides)
    except InputError:
        return True
