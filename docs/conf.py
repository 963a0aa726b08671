"""How Sphinx builds the documentation: Markdown through MyST, the furo theme, API pages from the docstrings."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

project = "detent"
author = "The detent authors"
copyright = "2026, The detent authors"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
nitpicky = False  # types of other packages are named in signatures, and their inventories need a network

# Headings down to the third level can be linked to, as on a code host.
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"detent {release}"
html_static_path = ["_static"]
html_show_sourcelink = False
