"""The documents: their code runs and prints what they show, and their links and figures hold."""

import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from tests.worlds import WHOLE

ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))
DOCUMENTS = [*ROOT.glob("*.md"), *DOCS]
CODE = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def test_version_is_the_top_of_the_changelog():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    top = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert top is not None
    assert top[1] == project["version"] == pg.__version__
    assert f"version: {top[1]}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_tour_of_the_readme_runs(capsys):
    (tour,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    exec(compile(tour, "README.md", "exec"), {})
    out = capsys.readouterr().out
    assert "1001 frames" in out
    assert "notice" not in out
    assert 0.0 < float(out.split()[-2]) < np.pi  # the largest angle of the hand [rad]


@pytest.mark.parametrize(
    "file", [f for f in DOCS if CODE.search(f.read_text())], ids=lambda f: f.stem
)
def test_code_of_a_document_runs_and_prints_the_numbers_shown(file, tmp_path, monkeypatch, capsys):
    """Numbers within 1 %, those in exponential notation (error estimates) within a factor of 3."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for piece, shown in CODE.findall(file.read_text()):
        exec(compile(piece, file.name, "exec"), names)
        printed = NUMBER.findall(capsys.readouterr().out)
        expected = NUMBER.findall(shown)
        for there, here in zip(expected, printed if expected else (), strict=True):
            widest = 2.0 if "e" in there else 0.01
            assert abs(float(here) - float(there)) <= widest * abs(float(there)), piece
    runs = [value for value in names.values() if isinstance(value, pg.Result)]
    assert all(run.status.ok for run in runs), [run.message for run in runs]


def rows(file: Path) -> list[list[str]]:
    """Return the cells of all table rows of a document."""
    lines = (line.strip() for line in file.read_text().splitlines())
    return [[c.strip() for c in x.strip("|").split("|")] for x in lines if x.startswith("|")]


def test_measured_figures_are_those_of_their_results_and_pages_agree():
    """Evidence quotes the results of benchmarks, and the README quotes the evidence."""
    evidence = rows(ROOT / "docs" / "evidence.md")
    quoted = [
        (row[1], x) for row in evidence for x in re.findall(r"benchmarks/results/\w+\.md", row[-1])
    ]
    assert len(quoted) > 20
    for figures, source in quoted:
        there = NUMBER.findall((ROOT / source).read_text())
        assert [x for x in NUMBER.findall(figures) if x not in there] == [], (figures, source)
    ratios = [row[2] for row in rows(ROOT / "README.md") if NUMBER.fullmatch(row[-1])]
    assert len(ratios) > 5
    assert [x for x in ratios if x not in [row[1] for row in evidence]] == []


def test_links_pictures_and_files_of_the_documents_are_there():
    named = re.compile(r"\b((?:tests|benchmarks|app|pgraph_core|peers)/[\w/]+\.\w+)")
    for file in DOCUMENTS:
        text = file.read_text()
        links = [file.parent / x for x in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)]
        missing = [x for x in (*links, *(ROOT / x for x in named.findall(text))) if not x.exists()]
        assert missing == [], file.name
    contents = (ROOT / "docs" / "index.md").read_text()
    files = [file.stem for file in DOCS if file.stem != "index"]
    assert [file for file in files if f" <{file}>\n" not in contents] == []


def test_functions_named_for_contributors_are_in_their_files():
    named = re.compile(r"`([\w/]+\.py)`: ((?:`\w+`(?:, )?)+)")
    sources = [file for folder in ("pgraph_core", "app") for file in ROOT.glob(f"{folder}/**/*.py")]
    for document in ("CONTRIBUTING.md", "docs/developer.md"):
        found = named.findall((ROOT / document).read_text())
        assert found
        for name, functions in found:
            texts = [x.read_text() for x in sources if str(x).endswith(f"/{name}")]
            words = re.findall(r"`(\w+)`", functions)
            missing = [x for x in words if not any(re.search(rf"\b{x}\b", t) for t in texts)]
            assert missing == [], (document, name)


def test_the_page_of_fields_is_that_of_the_classes():
    """`python docs/fields.py` writes it."""
    script = runpy.run_path(str(ROOT / "docs" / "fields.py"))
    assert script["PAGE"].read_text(encoding="utf-8") == script["page"]()


def test_every_part_of_a_model_has_its_fields_on_the_page():
    text = (ROOT / "docs" / "fields.md").read_text(encoding="utf-8")
    kinds = [kind for base in (pg.Constraint, pg.Force) for kind in base.KINDS.values()]
    parts = [part for part in WHOLE if not hasattr(part, "KINDS")] + kinds
    assert [part.__name__ for part in parts if f"\n### {part.__name__}\n" not in text] == []
