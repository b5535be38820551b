"""Sphinx's configuration. Nothing that a page shows is loaded from elsewhere."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "host"), str(HERE.parent / "protocol")]

import setae  # noqa: E402  (found through the path above)

project = "setae"
author = copyright = "The setae developers"
version = release = setae.__version__

extensions = [
    "mathml",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"setae {version}"
html_copy_source = False
exclude_patterns = ["README.md"]

autodoc_typehints = "none"  # numpydoc's tables of parameters say them
autodoc_member_order = "bysource"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False


def link_within_pages(app: Sphinx, docname: str, source: list[str]) -> None:
    """Let the pages of protocol/ find each other, and pictures, here where they are links."""
    del app
    if docname.startswith("protocol/"):
        source[0] = re.sub(
            r"\[([^]]+)\]\((README|REFERENCE|STATES)\.md\)", r"{doc}`\1 </protocol/\2>`", source[0]
        ).replace("(../docs/pictures/", "(../pictures/")


def setup(app: Sphinx) -> None:
    """Register what the pages need."""
    app.connect("source-read", link_within_pages)
