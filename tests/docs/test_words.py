"""The words of messages, help, reports and pages: phrases that no engineer would use do not come back."""

import pytest
from tests.docs.pages import ROOT

# What was said before it was: got, expected, try, compare, results, distance, predict, trip, oscillate, feedforward.
BANNED = (
    ": came {", ": came a ", ": came no ", "; allowed: ", "; do: ", "what came, what is allowed",
    "held against", "holds the method against", "hold the axis's method", "ways it was made to better",
    "what came out", "every value in effect", "values in effect", "of an acceleration", "swung to and fro", "sped up",
    "never breaks loose", "leads exchanged", "the drive goes off", "stood beside its target", "foretell", "foretold",
    "ask a recording", "single questions", "is not said is guessed", "feed-forward", "told by the data",
    "stretches not seen", "end of its way", "comes out negative", "drowns in noise",
)  # fmt: skip
SHOWN = {"src/detent": {".py", ".j2", ".toml", ".ipynb"}, "docs": {".md"}}
MADE = {"_build", "vendor", ".ipynb_checkpoints"}


def banned_in(text: str) -> list[str]:
    """Banned phrases of a text, also where its lines or strings break within them."""
    text = " ".join(text.lower().split())
    for join in ('" "', '" f"', "' '", "' f'"):
        text = text.replace(join, "")
    return [phrase for phrase in BANNED if phrase in text]


def test_no_banned_phrase_is_shown() -> None:
    paths = [path for folder, kinds in SHOWN.items() for path in (ROOT / folder).rglob("*") if path.suffix in kinds]
    paths = [ROOT / "README.md", *(path for path in sorted(paths) if not MADE & set(path.parts))]
    held = {str(path.relative_to(ROOT)): banned_in(path.read_text(encoding="utf-8")) for path in paths}
    assert {name: phrases for name, phrases in held.items() if phrases} == {}


@pytest.mark.parametrize(
    "text",
    ["a.toml:1:1 key: came a table", 'f"{name}; allowed: "', '"the drive "\n    f"goes off"', "Every value\nin effect"],
)
def test_a_banned_phrase_is_found(text: str) -> None:
    assert banned_in(text)
