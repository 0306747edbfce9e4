"""How Sphinx makes the site of the documents: `make site`.

Living figures are made by the commands that stand in the gallery.
"""

import re
import shlex
from importlib.metadata import version as version_of
from pathlib import Path

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

from pgraph_app.cli.main import main as pgraph

HERE = Path(__file__).parent
COMMAND = re.compile(r"^    pgraph (export .*--live.* -o (\S+))$", re.MULTILINE)

project = "Pgraph"
author = copyright = "the authors of Pgraph"
version = release = version_of("pgraph-dynamics")
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["pictures"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_class_signature = "separated"
html_math_renderer = "mathml"  # browsers draw it themselves: no script, no network
html_theme = "furo"
html_title = f"Pgraph {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]


def make_figures(app):
    """Write the figures of the gallery next to the pages."""
    if app.builder.format != "html":
        return
    folder = Path(app.outdir, "figures")
    folder.mkdir(parents=True, exist_ok=True)
    for line, name in COMMAND.findall((HERE / "gallery.md").read_text()):
        words = shlex.split(line)
        words[words.index("-o") + 1] = str(folder / name)
        if not (folder / name).exists() and pgraph(words):
            raise SystemExit(f"the gallery's command failed: pgraph {line}")


def as_text(app, what, name, obj, options, lines):
    """Docstrings are plain text: indented pieces are code, and only backticks are markup."""
    text, code = [], False
    for line in lines:
        indented = line.startswith("    ")
        if indented and not code:
            text += ["", "::", ""]
        code = indented or (code and not line)
        text.append(line if code else re.sub(r"([|*])", r"\\\1", line))
    lines[:] = text


def write_math(writer, node):
    """An equation as MathML."""
    writer.body.append(tex2mathml(node.astext(), as_block=node.tagname == "math_block"))
    raise SkipNode


def setup(app):
    """Called by Sphinx."""
    app.connect("builder-inited", make_figures)
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    app.connect("autodoc-process-docstring", as_text)
