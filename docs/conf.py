"""How the documentation site is built: `make docs`.

Nothing is downloaded, neither by the build nor by a reader's browser: no fonts, no scripts from elsewhere, formulas as
MathML, which browsers draw themselves.
"""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]
os.environ.setdefault("MPLBACKEND", "Agg")
gc.set_threshold(100_000, 20, 50)  # pages are trees of many objects, which each search for garbage goes through

from hgorun.version import __version__  # noqa: E402  # of this checkout, whose folder comes first in the path only now

project = "hgorun"
author = "The hgorun developers"
copyright = "The hgorun developers, BSD-3-Clause"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "site_formulas", "site_links"]
extensions += ["site_messages", "site_pages"]
exclude_patterns = ["_build", "_ext"]
root_doc = "index"

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3
# A pipe in a cell, a command in a console and a file of several languages have no lexer that takes all of them.
highlight_language = "none"
# Who copies an option or a message from a page, or searches for one, needs its characters: -- is no dash, ' no quote.
smartquotes = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
nitpicky = True
# Types of signatures come from NumPy, CasADi and from rooms that have no page; links in sentences must lead somewhere.
nitpick_ignore_regex = [("py:(class|obj|data|exc|attr)", ".*")]

html_theme = "furo"
html_title = f"hgorun {release}"
html_static_path = ["_static"]
html_css_files = ["hgorun.css"]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
