"""The configuration of the documentation site, built by `python -m scripts.site`."""

import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(ROOT))

from scripts.playground import is_possible  # noqa: E402
from urc import __version__  # noqa: E402

project = "URC"
author = "URC contributors"
copyright = author
version = release = __version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx_design",
    "sphinx_copybutton",
    "scripts.site_extension",
]
root_doc = "index"
exclude_patterns = ["README.md", "_static"]
nitpicky = True

myst_enable_extensions = ["attrs_inline", "colon_fence"]
myst_heading_anchors = 4
"""Headings down to this level get the anchors that code-hosting sites give them."""

smartquotes = False
"""Two hyphens are an option of the command line, not a dash."""

html_theme = "furo"
html_title = f"URC {__version__}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = [("search.js", {"defer": "defer", "priority": 900})]
"""The ranking of the search; it does nothing on pages without the search."""
html_show_sphinx = False
html_copy_source = True
templates_path = ["_templates"]
highlight_language = "text"
pygments_style = "a11y-light"
pygments_dark_style = "a11y-dark"
copybutton_selector = "div.highlight pre"

_urls = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"].get("urls", {})
html_theme_options = {
    "top_of_page_buttons": ["view"],
    "light_css_variables": {
        "color-brand-primary": "#0b57a4",
        "color-brand-content": "#0b57a4",
    },
    "dark_css_variables": {
        "color-brand-primary": "#7cb8f2",
        "color-brand-content": "#7cb8f2",
    },
}
if "Source" in _urls:
    html_theme_options |= {
        "top_of_page_buttons": ["view", "edit"],
        "source_repository": _urls["Source"],
        "source_branch": "main",
        "source_directory": "docs/",
    }

# The buttons of the playground, on every page; scripts/site.py adds the playground itself.
if is_possible():
    tags.add("playground")  # noqa: F821  # Sphinx provides the name
    html_js_files.append(("playground/page.js", {"type": "module"}))
    html_css_files.append("playground/page.css")
