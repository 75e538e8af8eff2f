"""The pages as a website: `make site`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

project = "dapple"
author = "the dapple developers"
html_title = "dapple"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "captions", "data/README.md"]
html_theme = "furo"
html_static_path = ["img"]
myst_heading_anchors = 3
napoleon_google_docstring = False
autodoc_typehints = "description"
autodoc_member_order = "bysource"
# Diagrams of rules are drawn where the page is read on a forge; here they stay as text.
suppress_warnings = ["misc.highlighting_failure"]
