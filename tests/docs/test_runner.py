"""The harness notices what is wrong: a page that shows something untrue must fail."""

import textwrap

import pytest
from tests.docs.pages import Block, anchors_of, blocks_of, links_of
from tests.docs.runner import DocumentationError, PageRunner, matches, words_of


def run_page(folder, text):
    page = folder / "page.md"
    page.write_text(textwrap.dedent(text), encoding="utf-8")
    runner = PageRunner(folder)
    for block in blocks_of(page):
        runner.run(Block(page=page, line=block.line, language=block.language, text=block.text, marks=block.marks))


@pytest.fixture(autouse=True)
def pages_anywhere(monkeypatch, tmp_path):
    """Pages of these tests lie outside the project: let their place be told from there."""
    monkeypatch.setattr("tests.docs.pages.ROOT", tmp_path)


GOOD = [
    pytest.param("```console\n$ echo one two\none ...\n```\n", id="output with an ellipsis"),
    pytest.param("```console\n$ false\n$ echo $?\n1\n```\n", id="a status that the page shows"),
    pytest.param(
        "```console\n$ mkdir sub\n$ cd sub\n```\n\n```console\n$ pwd\n...sub\n```\n", id="folder kept between blocks"
    ),
    pytest.param("```console\n$ echo a \\\n> b\na b\n```\n", id="continued command"),
    pytest.param(
        "```console\n$ mkdir sub\n$ cd sub\n$ detent examples --copy .\n...\n$ ls cascade.toml\ncascade.toml\n```\n",
        id="detent in the folder of the shell",
    ),
    pytest.param(
        "```console\n$ detent check nowhere.toml\n...nowhere...\n$ echo $?\n2\n```\n", id="a refusal of detent"
    ),
    pytest.param("```python\nx = 2\n```\n\n```python\n>>> x + 1\n3\n```\n", id="one namespace for a page"),
    pytest.param("```python\nprint('six')\n```\n\n```output\nsix\n```\n", id="printed output"),
    pytest.param(
        "<!-- file: a/b.toml -->\n```toml\nx = 1\n```\n\n```console\n$ cat a/b.toml\nx = 1\n```\n", id="saved file"
    ),
    pytest.param(
        "```console\n$ echo hi > f\n```\n\n```python\n>>> import os\n>>> 'f' in os.listdir()\nTrue\n```\n",
        id="one folder for a page",
    ),
    pytest.param(
        "````{note}\n```python\ny = 1\n```\n````\n\n```python\n>>> y\n1\n```\n", id="block inside a directive"
    ),
]

BAD = [
    pytest.param("```console\n$ false\n```\n", "status 1", id="failing command"),
    pytest.param("```console\n$ echo one\ntwo\n```\n", "but it prints", id="wrong output"),
    pytest.param("```console\n$ echo one\n```\n", "but it prints", id="output left out"),
    pytest.param("```console\n$ true\n$ echo $?\n1\n```\n", "but it prints", id="wrong status shown"),
    pytest.param("```console\n$ detent check nowhere.toml\n...\n```\n", "status 2", id="failing detent"),
    pytest.param("```console\n$ detent --version\nnone\n```\n", "but it prints", id="wrong output of detent"),
    pytest.param("```console\necho one\n```\n", "begins with", id="command without a prompt"),
    pytest.param("```python\n>>> 1 + 1\n3\n```\n", "Expected", id="wrong doctest"),
    pytest.param("```python\nprint(1)\n```\n\n```output\n2\n```\n", "above prints", id="wrong printed output"),
    pytest.param("```output\n2\n```\n", "follows a Python block", id="output of nothing"),
    pytest.param("```toml\nx = \n```\n", "not valid toml", id="malformed TOML"),
    pytest.param(
        "````{note}\n```console\n$ false\n```\n````\n", "page.md:2", id="wrong block inside a directive, with its line"
    ),
]


@pytest.mark.parametrize("text", GOOD)
def test_true_pages_pass(text, tmp_path):
    run_page(tmp_path, text)


@pytest.mark.parametrize(("text", "words"), BAD)
def test_untrue_pages_fail(text, words, tmp_path):
    with pytest.raises(DocumentationError, match=words):
        run_page(tmp_path, text)


def test_an_exception_of_a_python_block_names_its_line(tmp_path):
    with pytest.raises(ZeroDivisionError) as caught:
        run_page(tmp_path, "# Page\n\n```python\nx = 1\n1 / 0\n```\n")
    assert caught.traceback[-1].lineno + 1 == 5


@pytest.mark.parametrize(
    ("shown", "got", "same"),
    [("a...z", "a\nb\nz", True), ("a", "a  \n", True), ("a.c", "abc", False), ("...", "", True), ("a", "a\nb", False)],
)
def test_comparison_of_output(shown, got, same):
    assert matches(shown, got) is same


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('detent run a.toml \\\n    --set k="1 m"', ["detent", "run", "a.toml", "--set", "k=1 m"]),
        ("detent check a.toml | tail -n 1", None),
        ("detent run a.toml > b.json", None),
        ("detent plot $file", None),
        ("detent-other", None),
        ("echo detent", None),
    ],
)
def test_only_what_needs_no_shell_runs_without_one(text, words):
    assert words_of(text) == words


def test_links_and_anchors_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One `tick`, to torque\n\n## A\n\n## A\n\n[x](y.md#z) ![p](p.png)\n<img src='q.png'>\n\n(here)=\n", "utf-8"
    )
    assert anchors_of(page) == {"one-tick-to-torque", "a", "a-1", "here"}
    assert links_of(page) == [(7, "y.md#z"), (7, "p.png"), (7, "q.png")]
