"""Every command and every code block of README.md and docs/ does what the page says.

A page's blocks run in the order of the text in one folder of their own (see runner.py for the kinds). A block that
installs, or runs the whole test-suite, cannot run inside it; it is preceded by `<!-- checked-by: make NAME -->` and
`.ci/run` runs that target. The last tests here see to it that the mark is used for nothing else. A block behind
`<!-- session -->` is run by tests/page_session.py, with programs of other people.
"""

import re

import pytest
from tests.docs.pages import ROOT, Block, all_pages, blocks_of, page_name
from tests.docs.runner import PageRunner, commands_of

# Shown as they are; everything else must be run, parsed or be a directive.
SHOWN_ONLY = {"text", "csv"}
# Programs: saved by their mark, and compiled by a command of the page.
SAVED = {"c"}
CHECKED = {"console", "python", "output", "toml", "json"}
# Directives that would show code without its being run: use a plain fence.
CODE_DIRECTIVES = {
    "{code}",
    "{code-block}",
    "{sourcecode}",
    "{eval-rst}",
    "{doctest}",
    "{testcode}",
    "{parsed-literal}",
}
MARKS = {"file", "checked-by", "session"}
# What a block may hold, besides `make` lines, when .ci/run checks it in place of this harness.
INSTALLING = re.compile(r"(git clone|cd|(sudo )?apt install|\S*python3? -m venv|source|\S*pip install|\S*pytest)\b.*")

pytestmark = pytest.mark.early

PAGES = all_pages()
BLOCKS = [block for page in PAGES for block in blocks_of(page)]
LEFT_TO_CI = [block for block in BLOCKS if "checked-by" in block.marks]


def left_to(block: Block) -> list[str]:
    """The make targets that check the block."""
    return re.findall(r"make ([a-z-]+)", block.marks["checked-by"])


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_blocks_of_a_page_do_what_it_says(page, tmp_path):
    runner = PageRunner(tmp_path)
    for block in blocks_of(page):
        if not {"checked-by", "session"} & set(block.marks):  # a session is run by test_faces, with its clients
            runner.run(block)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.where)
def test_no_block_escapes_the_check(block):
    directive = re.match(r"\{[\w:-]+\}", block.language)
    if directive:
        assert directive.group() not in CODE_DIRECTIVES, f"{block.where}: use a plain ``` fence, so that it is run"
        return
    known = CHECKED | SHOWN_ONLY | SAVED
    assert block.language in known, (
        f"{block.where}: `{block.language}` is not among {sorted(known)}; commands are `console` blocks"
    )
    assert block.language not in SAVED or "file" in block.marks, f"{block.where}: write `<!-- file: NAME -->`"
    assert set(block.marks) <= MARKS, f"{block.where}: unknown mark; known are {sorted(MARKS)}"
    if block.language in SHOWN_ONLY:
        assert not re.search(r"^\$ ", block.text, flags=re.MULTILINE), f"{block.where}: a command in a block not run"


@pytest.mark.parametrize("block", LEFT_TO_CI, ids=lambda block: f"{block.where} {block.marks['checked-by']}")
def test_a_block_left_to_ci_is_run_there(block):
    targets = left_to(block)
    assert targets, f"{block.where}: write `<!-- checked-by: make NAME -->`"
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), f"{block.where}: the Makefile has no `{target}`"
        assert re.search(rf"^[^#\n]*\bmake {target}\b", ci, flags=re.MULTILINE), (
            f"{block.where}: .ci/run lacks `{target}`"
        )


@pytest.mark.parametrize("block", LEFT_TO_CI, ids=lambda block: block.where)
def test_a_block_left_to_ci_only_installs_or_makes(block):
    for command in commands_of(block):
        made = re.fullmatch(r"make ([a-z-]+)( [A-Z]+=\S+)?(\s+#.*)?", command.text)
        if made:
            assert made.group(1) in left_to(block), f"{block.where}: the mark does not name `{command.text}`"
        else:
            assert INSTALLING.fullmatch(command.text), f"{block.where}: `{command.text}` can be run here: drop the mark"
