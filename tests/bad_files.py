"""Bad axis files: edits of a good one, the key that each of them blames, and what its message says (a golden file)."""

from dataclasses import dataclass
from importlib.resources import files

import pytest

from detent.errors import InputError

EXAMPLES = {
    "print_head": "print_head",
    "phase_servo": "phase_servo",
    "filtered_servo": "filtered_servo",
    "rotary_table": "rotary_table",
    "stepper_envelope": "zoom",
    "cascade": "cascade",
}
"""Packaged example of each method."""


def example_text(name):
    """Text of a packaged example, without its head comment (line 1 is ``[axis]``)."""
    text = files("detent").joinpath(f"examples/{name}.toml").read_text(encoding="utf-8")
    return text[text.index("[axis]") :]


@dataclass(frozen=True)
class Bad:
    """One bad file: edits of the good one, or a text of its own; where its first problem stands, how many follow."""

    name: str
    place: str
    key: str
    edits: tuple[tuple[str, str], ...] = ()
    text: str | None = None
    append: str = ""
    overrides: tuple[str, ...] = ()
    others: int = 0

    def make(self, good):
        text = good if self.text is None else self.text
        for old, new in self.edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        return text + self.append


def edit(name, old, new, place, key, **more):
    return Bad(name, place, key, edits=((old, new),), **more)


def added(name, lines, place, key, **more):
    return Bad(name, place, key, append=f"\n{lines}\n", **more)


def given(name, *overrides, key, others=0):
    """A bad axis made by overrides of the good file; the problem stands at the last that is looked at."""
    return Bad(name, "--set", key, overrides=overrides, others=others)


def params(**groups):
    """Parameters of a test, named by their groups."""
    return [pytest.param(bad, id=f"{group}: {bad.name}") for group, bads in groups.items() for bad in bads]


def check_bad_file(bad, good_text, load_text, golden):
    """Load the bad file: its first problem has its place, key and message; as many follow as the entry says."""
    with pytest.raises(InputError) as caught:
        load_text(bad.make(good_text), *bad.overrides)
    first, *others = caught.value.problems
    expected = bad.place if bad.place == "--set" else f"axis.toml:{bad.place}"
    assert str(first).startswith(expected)
    assert first.key == bad.key
    assert len(others) == bad.others, others
    golden(bad.name, f"{first.key}: {first.got}; expected: {first.allowed}; try: {first.remedy}")
    return first
