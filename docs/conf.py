"""The site: ``python -m docs`` writes generated pages, then has Sphinx build all of them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import sbafab

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent

project = "sbafab"
author = "sbafab contributors"
project_copyright = "sbafab contributors"
release = version = sbafab.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc"]
exclude_patterns = ["scripts", "__main__.py", "conf.py"]
myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 3
smartquotes = False  # an option is --set, not one dash

# Notebooks are run by the build; one that fails stops it.
nb_execution_mode = "auto"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
# Widgets would be fetched from another host.
nb_ipywidgets_js: dict[str, dict[str, str]] = {}

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80

html_theme = "furo"
html_title = f"sbafab {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_logo = "_static/mark.svg"
html_favicon = "_static/mark.svg"
html_extra_path = ["llms.txt"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b4f86", "color-brand-content": "#0b4f86"},
    "dark_css_variables": {"color-brand-primary": "#a9cfea", "color-brand-content": "#a9cfea"},
}

OTHERS = "<!-- every other page -->"
"""In index.md, where the guides that no list names are put."""


MADE = re.compile(r"<!-- made: (.+) -->")
"""In index.md, where pages are put that the build makes and the source does not have."""


def with_other_pages(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put into index.md the pages that the build makes, and those that it does not name."""
    if docname != "index":
        return
    source[0] = MADE.sub(lambda m: "\n".join(f"_made/{name}" for name in m[1].split()), source[0])
    named = set(re.findall(r"^([\w./-]+)$", source[0], re.MULTILINE))
    pages = sorted(path.stem for path in HERE.glob("*.md") if path.stem != "index")
    source[0] = source[0].replace(OTHERS, "\n".join(p for p in pages if p not in named))


def always_anew(*_: object) -> list[str]:
    """The page whose text hangs on which other pages there are."""
    return ["index"]


def setup(app: Sphinx) -> None:
    app.connect("source-read", with_other_pages)
    app.connect("env-get-outdated", always_anew)
