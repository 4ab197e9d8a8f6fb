"""Settings of Sphinx for the site made of these pages: ``make docs``."""

import os
import sys
from pathlib import Path

sys.path.insert(0, os.fspath(Path(__file__).resolve().parent.parent))

from sms_handover import __version__

project = "sms_handover"
author = "sms_handover maintainers"
copyright = "sms_handover maintainers, BSD-3-Clause"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "docs.extensions.docstrings",
    "docs.extensions.mathml",
    "docs.extensions.repository_links",
]

# Pages: Markdown that GitHub shows too; headings get the anchors that GitHub gives them.
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_math_renderer = "mathml"  # drawn by the browser itself: no script, no network
copybutton_exclude = ".linenos, .gp, .go"
suppress_warnings = [
    "toc.not_included",  # a new page must not break the build; test/test_documents.py names it
    "ref.python",  # a field named `type` hides the built-in from the search for it
]

# API: every public module, a page per package.
apidoc_modules = [
    {
        "path": "../sms_handover",
        "destination": "api",
        "module_first": True,
        "automodule_options": ["members", "undoc-members", "show-inheritance"],
    }
]
autodoc_default_options = {"ignore-module-all": True}  # what is imported is told where it is made
autodoc_member_order = "bysource"
autodoc_mock_imports = ["Basilisk", "mujoco"]  # other engines, each in an extra of its own
autodoc_preserve_defaults = True
add_module_names = False
viewcode_follow_imported_members = False  # the default of a field may be a type from elsewhere
toc_object_entries_show_parents = "hide"
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!sms_handover\.).*"),  # other projects: their pages are not read while this is built
    ("py:.*", r"sms_handover\.[a-z_.]+\.[A-Z]"),  # type variables have no entry of their own
]

html_theme = "furo"
html_title = f"sms_handover {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
