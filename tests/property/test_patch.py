"""Values put into files of every layout: the file says the same but for these, each other line stays to the byte."""

import tomllib
from collections.abc import Iterator
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from detent.files.patch import NewValue, patch
from detent.units import parse_quantity

KEYS = ["mass", "friction", "x", "y-1", '"a b"']
LEAVES = ['"850 g"', "'850 g'", '"1.5kg"', '"""\n2 kg"""', "3", "0.5", '["1 kg",  # both\n  "2 kg" ]', "true", "[1, 2]"]
COMMENTS = ["", "# weighed", "  # = [no]", "\t# from \u201cA\u201d; 3 kg"]
IN_LINE = "# in one line"
STYLES = ["header", "header", "dotted", "inline"]
Tree = dict[str, Any]

leaves = st.tuples(st.sampled_from(LEAVES), st.sampled_from(COMMENTS), st.sampled_from(["=", " = ", "   ="]))
trees: st.SearchStrategy[Tree] = st.recursive(
    st.dictionaries(st.sampled_from(KEYS), leaves, max_size=3),
    lambda below: st.dictionaries(
        st.sampled_from(KEYS), leaves | st.tuples(st.sampled_from(STYLES), below), min_size=1, max_size=4
    ),
    max_leaves=8,
)


def is_leaf(held: Any) -> bool:
    return len(held) == 3


def in_line(tree: Tree) -> str:
    """A table in one line."""
    parts = [
        f"{key} = {held[0] if chr(10) not in held[0] else '7'}" if is_leaf(held) else f"{key} = {in_line(held[1])}"
        for key, held in tree.items()
    ]
    return "{ " + ", ".join(parts) + " }" if parts else "{}"


def body(tree: Tree, prefix: str = "") -> Iterator[str]:
    """Lines of a table below its header, those of dotted tables too."""
    for key, held in tree.items():
        if is_leaf(held):
            yield f"{prefix}{key}{held[2]}{held[0]}{held[1]}"
        elif held[0] == "inline":
            yield f"{prefix}{key} = {in_line(held[1])}  {IN_LINE}"
        elif held[0] == "dotted" and held[1]:
            yield from body({k: v if is_leaf(v) or v[0] != "header" else ("dotted", v[1]) for k, v in held[1].items()},
                            f"{prefix}{key}.")  # fmt: skip


def headers(tree: Tree, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Tables with a header: name and text of each."""
    for key, held in tree.items():
        if not is_leaf(held) and held[0] == "header":
            name, lines = f"{prefix}{key}", list(body(held[1]))
            if lines or not list(headers(held[1])):  # else the tables inside say that it is there
                yield name, "\n".join(["", f"# about {name}", f"[{name}]", *lines])
            yield from headers(held[1], f"{name}.")


@st.composite
def texts(draw: st.DrawFn) -> str:
    """Files as people lay them out."""
    tree = draw(trees)
    # Tables in any order, but each before those inside it.
    left, parts = dict(draw(st.permutations(list(headers(tree))))), list(body(tree))
    while left:
        name = next(one for one in left if not any(one.startswith(f"{other}.") for other in left))
        parts.append(left.pop(name))
    text = "\n".join(["# my axis", *parts]) + draw(st.sampled_from(["", "\n", "\n\n# the end\n"]))
    text = text.replace("\n", draw(st.sampled_from(["\n", "\r\n"])))
    return draw(st.sampled_from(["", "\ufeff"])) + text


def paths(tables: Tree, prefix: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in tables.items():
        yield (*prefix, key), value
        if isinstance(value, dict):
            yield from paths(value, (*prefix, key))


def is_number(value: Any) -> bool:
    return type(value) in {int, float} or (isinstance(value, str) and value.strip()[0].isdigit())


@st.composite
def cases(draw: st.DrawFn) -> tuple[str, list[NewValue]]:
    """A file, numbers in place of some of its values, and some that are new to it."""
    text = draw(texts())
    known = dict(paths(tomllib.loads(text.removeprefix("\ufeff"))))
    plain = [path for path in known if all(part.replace("-", "").isalnum() for part in path)]
    old = [path for path in plain if is_number(known[path])]
    tables = [(), *(path for path in plain if isinstance(known[path], dict))]
    new = [(*table, *more) for table in tables for more in (("new",), ("news", "new"))]
    new = [path for path in new if path[:-1] != () or path == ("new",)]
    chosen = draw(st.lists(st.sampled_from([*old, *new]), unique=True, max_size=4))
    values = st.floats(1e-3, 1e3, allow_subnormal=False)
    return text, [
        NewValue(".".join(path), draw(values), "kg" if isinstance(known.get(path, ""), str) else "", "95 %, log.csv")
        for path in chosen
    ]


@given(cases())
def test_the_file_says_the_same_but_for_the_new_values(case: tuple[str, list[NewValue]]) -> None:
    text, values = case
    made, changes = patch(text, values, "axis.toml")
    found, wanted = (tomllib.loads(one.removeprefix("\ufeff")) for one in (made, text))
    for value in values:
        got: Any = found
        for part in value.key.split("."):
            got = got[part]
        assert abs((parse_quantity(got, "kg") if value.unit else got) / value.value - 1.0) < 1e-5
        put(wanted, value.key.split("."), None)
    for value in values:
        put(found, value.key.split("."), None)
    assert found == wanted
    assert {one.key for one in changes} <= {one.key for one in values}
    assert patch(made, values, "axis.toml") == (made, [])


def put(tables: Tree, path: list[str], value: Any) -> None:
    for part in path[:-1]:
        tables = tables.setdefault(part, {})
    tables[path[-1]] = value


@given(cases())
def test_every_line_of_others_stays_to_the_byte(case: tuple[str, list[NewValue]]) -> None:
    text, values = case
    assert patch(text, [], "axis.toml") == (text, [])
    made, changes = patch(text, values, "axis.toml")
    assert made.startswith("\ufeff") == text.startswith("\ufeff")
    assert ("\r" in made, made.count("\r\n")) == ("\r" in text, made.count("\n") if "\r" in text else 0)
    touched = {IN_LINE, *(value.key.rpartition(".")[2] for value in values)}
    left = iter(made.removeprefix("\ufeff").split("\n"))
    for line in text.removeprefix("\ufeff").split("\n"):
        if line.strip() and not any(key in line for key in touched) and not line.startswith("2 kg"):
            assert any(line.rstrip("\r") == one.rstrip("\r") for one in left), line
    for comment in (IN_LINE, *filter(None, COMMENTS)):
        assert made.count(comment) == text.count(comment)
    assert len(changes) <= len(values)
