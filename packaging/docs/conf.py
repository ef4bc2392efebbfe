"""How Sphinx reads the pages of the site: Markdown, notebooks that it runs, docstrings."""

import re
from pathlib import Path

project = "Kappaskin"
extensions = ["myst_nb", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = project
html_logo = str(Path(__file__).parents[2] / "resources/kappaskin_resources/icons/kappaskin.svg")
html_show_copyright = html_show_sphinx = html_copy_source = False
html_theme_options = {"sidebar_hide_name": True}
templates_path: list[str] = []
myst_heading_anchors = 6
myst_enable_extensions = ["colon_fence"]
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
autodoc_typehints = "signature"
autodoc_member_order = "groupwise"
autodoc_inherit_docstrings = False
suppress_warnings = ["myst.header", "misc.highlighting_failure", "ref.python"]


def as_plain_text(app, what, name, obj, options, lines):
    """Make a docstring reStructuredText: its text is plain, but for code in single backticks."""
    text = "\n".join(lines)
    parts = re.split(r"(`[^`\n]+`)", text)
    parts[::2] = [re.sub(r"([\\*|_`])", r"\\\1", part) for part in parts[::2]]
    parts[1::2] = [f"`{part}`" for part in parts[1::2]]
    lines[:] = "".join(parts).split("\n")
    # What is indented, as a formula, is shown as it stands.
    for n in reversed(range(1, len(lines))):
        if lines[n].startswith(" ") and not lines[n - 1].startswith(" "):
            lines[n:n] = ["", "::", ""] if lines[n - 1].strip() else ["::", ""]
        elif lines[n - 1].startswith(" ") and lines[n].strip() and not lines[n].startswith(" "):
            lines[n:n] = [""]


def setup(app):
    app.connect("autodoc-process-docstring", as_plain_text)
