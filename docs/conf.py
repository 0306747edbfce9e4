"""How Sphinx makes the site of the documents: `make site`.

Living figures are made by the commands that stand in the gallery; the notebooks are run.
"""

import json
import re
import shlex
from html import escape
from importlib.metadata import version as version_of
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.ext.napoleon import Config, NumpyDocstring

from pgraph_app.cli.main import main as pgraph

HERE = Path(__file__).parent
COMMAND = re.compile(r"^pgraph (export .*--live.* -o (\S+))$", re.MULTILINE)

MOVED = {  # pages of earlier versions, and where their content is
    "batches": "many", "benchmarks": "evidence", "comparison": "limits", "construction": "evidence",
    "dependencies": "developer", "design": "developer", "figures": "gallery",
    "glossary": "conventions", "methods": "accuracy", "notebooks": "gallery",
    "pgraph_by_hand": "paper", "precision": "evidence", "reliability": "evidence",
    "report": "accuracy", "security": "page", "stability": "accuracy", "stance": "paper",
    "sweeps": "many", "testing": "developer", "theory": "paper", "troubleshooting": "limits",
    "tutorial_page": "page", "verification": "accuracy",
}  # fmt: skip

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


SHEET = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>:root {{ color-scheme: light dark }}
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 900px; margin: 0 auto; padding: 16px }}
pre {{ overflow-x: auto; padding: 10px; border-radius: 6px; background: #8882 }}
pre.out {{ background: none }} img {{ max-width: 100%; background: #fff }}
th, td {{ text-align: left; padding: 2px 12px 2px 0 }}</style></head><body>{}</body></html>"""


def make_notebooks(app):
    """Run the notebooks, and write each as a page that needs nothing else."""
    if app.builder.format != "html":
        return
    import nbformat
    from markdown_it import MarkdownIt
    from nbclient import NotebookClient

    folder = Path(app.outdir, "notebooks")
    folder.mkdir(parents=True, exist_ok=True)
    for file in sorted((HERE.parent / "examples" / "notebooks").glob("*.ipynb")):
        made = folder / f"{file.stem}.html"
        if made.exists() and made.stat().st_mtime > file.stat().st_mtime:
            continue
        notebook = nbformat.read(file, 4)
        NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
        parts = []
        for cell in notebook.cells:
            if cell.cell_type == "markdown":
                parts.append(MarkdownIt().render(cell.source))
                continue
            parts.append(f"<pre>{escape(cell.source)}</pre>")
            parts += map(shown_output, cell.outputs)
        page = SHEET.format(escape(file.stem), "\n".join(parts))
        made.write_text(page, encoding="utf-8")


def make_redirects(app, error):
    """Write a page under each old name that leads to the new one."""
    if app.builder.format != "html" or error:
        return
    for old, new in MOVED.items():
        body = f'<p>This page moved to <a href="{new}.html">{new}</a>.</p>'
        lead = f'<meta http-equiv="refresh" content="0; url={new}.html">'
        text = SHEET.format(old, body).replace("<meta name", f"{lead}<meta name", 1)
        Path(app.outdir, f"{old}.html").write_text(text, encoding="utf-8")


def make_sections(app, error):
    """Write the words of each section, which the search reads."""
    if app.builder.format != "html" or error:
        return
    found = []
    for page in sorted(app.env.found_docs - {"api", "fields"}):  # generated, and found by name
        doctree = app.env.get_doctree(page)
        for section in doctree.findall(nodes.section):
            own = [x for x in section.children if not isinstance(x, (nodes.section, nodes.raw))]
            words = re.findall(r"[^\W\d_]+", " ".join(x.astext() for x in own).lower())
            title = section.next_node(nodes.title).astext()
            found.append(
                (page, app.env.titles[page].astext(), section["ids"][0], title, " ".join(words))
            )
    text = f"const SECTIONS = {json.dumps(found, ensure_ascii=False)};\n"
    Path(app.outdir, "_static", "sections.js").write_text(text, encoding="utf-8")


def find_sections(app, pagename, templatename, context, doctree):
    """Let the search page find sections."""
    if pagename == "search":
        for file in ("sections.js", "search.js"):
            app.add_js_file(file, loading_method="defer")


def shown_output(output):
    """What a cell printed or gave, as HTML; without progress bars."""
    if output.output_type == "stream":
        return f'<pre class="out">{escape(output.text)}</pre>' if output.name == "stdout" else ""
    data = output.get("data", {})
    if "text/html" in data:
        return f"<div>{data['text/html']}</div>"
    if "image/png" in data:
        return f'<img alt="plot" src="data:image/png;base64,{data["image/png"].strip()}">'
    return f'<pre class="out">{escape(data.get("text/plain", ""))}</pre>'


def as_text(app, what, name, obj, options, lines):
    """Make a docstring markup: indented text after a blank line is code, * and | are characters."""
    text, code = [], False
    for before, line in zip(["", *lines], lines):
        indented = line.startswith("    ")
        if indented and not code and before in ("", "Fields:"):
            text += ["", "::", ""]
            code = True
        code = code and (indented or not line)
        text.append(line if code else re.sub(r"([|*])", r"\\\1", line))
    sections = what not in ("attribute", "property", "data")
    lines[:] = NumpyDocstring(text, Config(), app, what).lines() if sections else text


def write_math(writer, node):
    """An equation as MathML."""
    writer.body.append(tex2mathml(node.astext(), as_block=node.tagname == "math_block"))
    raise nodes.SkipNode


def setup(app):
    """Called by Sphinx."""
    app.connect("builder-inited", make_figures)
    app.connect("builder-inited", make_notebooks)
    app.connect("html-page-context", find_sections)
    app.connect("build-finished", make_sections)
    app.connect("build-finished", make_redirects)
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    app.connect("autodoc-process-docstring", as_text)
