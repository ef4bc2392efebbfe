"""How Sphinx reads the pages of the site: Markdown, notebooks that it runs, docstrings."""

import re
from pathlib import Path

from numpy.typing import ArrayLike, DTypeLike
from sphinx.util.typing import stringify_annotation

from kappaskin.frames import Array, Indices, Mask

project = "Kappaskin"
extensions = ["myst_nb", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = project
html_favicon = str(Path(__file__).parents[2] / "resources/kappaskin_resources/icons/kappaskin.svg")
html_show_copyright = html_show_sphinx = html_copy_source = False
myst_heading_anchors = 6
myst_enable_extensions = ["colon_fence"]
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
autodoc_preserve_defaults = True
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


_ALIASES = {
    stringify_annotation(of, "smart"): name
    for name, of in (
        ("ArrayLike", ArrayLike),
        ("DTypeLike", DTypeLike),
        ("Array", Array),
        ("Mask", Mask),
        ("Indices", Indices),
    )
}


def with_aliases(app, what, name, obj, options, signature, returned):
    """A signature in which types of arrays have their short names."""
    texts = [signature, returned]
    for whole, short in _ALIASES.items():
        texts = [text and text.replace(whole, short) for text in texts]
    return tuple(texts)


def setup(app):
    app.connect("autodoc-process-signature", with_aliases)
    app.connect("autodoc-process-docstring", as_plain_text)
