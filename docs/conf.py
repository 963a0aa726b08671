"""How Sphinx builds the documentation: Markdown through MyST, the furo theme, API pages from the docstrings.

The reference tables are made anew from the code (generate.py); the figures are committed (draw.py).
"""

import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "src"), str(ROOT / "docs")]

project = "detent"
author = "The detent authors"
copyright = "2026, The detent authors"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
PARTS = ("trust", "fault", "endurance", "feedback", "step-methods")  # tables that a page includes
exclude_patterns = ["_build", *(f"explanation/{part}-table.md" for part in PARTS)]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = False  # types of other packages are named in signatures, and their inventories need a network

smartquotes = False  # a quotation mark in a value of the axis file is a straight one

# Headings down to the third level can be linked to, as on a code host.
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = False
napoleon_use_rtype = False

# Formulas as MathML, which every browser draws by itself: the built pages need no network.
html_math_renderer = "mathml"
myst_update_mathjax = False

html_theme = "furo"
html_title = f"detent {release}"
html_static_path = ["_static"]
html_css_files = ["captions.css"]
html_show_sourcelink = False


def keep_bars(_app: Any, _what: str, _name: str, _object: object, _options: object, lines: list[str]) -> None:
    """Leave |x| in a docstring the magnitude that it is there; reStructuredText would take it for a substitution."""
    lines[:] = [re.sub(r"\|(\w+)\|", r"\|\1\|", line) for line in lines]


def put_formula(display: str) -> Any:
    """What writes a formula into a page: MathML in the line, or as a block of its own."""

    def visit(page: Any, node: Any) -> None:
        page.body.append(convert(node.astext(), display=display))
        raise nodes.SkipNode

    return visit


def setup(app: Any) -> None:
    """Make the generated parts before any page is read."""
    app.connect("autodoc-process-docstring", keep_bars)
    app.add_html_math_renderer("mathml", (put_formula("inline"), None), (put_formula("block"), None))
    import generate

    generate.write_all()
