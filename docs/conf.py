"""How the documentation is built: ``make docs-site``."""

from __future__ import annotations

import re
from importlib.metadata import version as version_of
from typing import Any

import matplotlib
from docutils.nodes import SkipNode
from latex2mathml.converter import convert

matplotlib.use("Agg")

project = "discovery"
release = version = version_of("discovery")
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
templates_path = ["templates"]
exclude_patterns = ["gallery/*.rst", "templates"]

html_theme = "furo"
html_title = "discovery"
html_show_sphinx = False
html_copy_source = False
html_show_copyright = False
html_math_renderer = "mathml"

# Markdown as it reads on a page of the repository: its mathematics, and links to headings.
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
# A word of a docstring may be the name of attributes of two classes; it then links to none.
suppress_warnings = ["ref.python"]
numpydoc_show_class_members = False

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": "plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "remove_config_comments": True,
    "write_computation_times": False,
    "thumbnail_size": (480, 320),
}


def plain_mathematics(app: Any, name: str, source: list[str]) -> None:
    """Write formulas in a line of text as MyST reads them: between dollars, without the backticks of a repository."""
    source[0] = re.sub(r"\$`(.+?)`\$", r"$\1$", source[0])


def inline_formula(writer: Any, node: Any) -> None:
    """Write a formula as MathML, which browsers draw without a script or the network."""
    writer.body.append(convert(node.astext()))
    raise SkipNode


def displayed_formula(writer: Any, node: Any) -> None:
    """Write a formula on a line of its own."""
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise SkipNode


def level_of_captions(app: Any, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """Give captions of lists of pages a level: they are written as headings without one."""
    for part in ("furo_navigation_tree", "body"):
        if context.get(part):
            context[part] = context[part].replace('role="heading">', 'role="heading" aria-level="2">')


def setup(app: Any) -> None:
    """Tell Sphinx of the above."""
    app.connect("html-page-context", level_of_captions, priority=900)  # after the theme's own
    app.connect("source-read", plain_mathematics)
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
