"""The documents: the tour of the README runs, and what the documents name is there."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from tests.worlds import WHOLE

ROOT = Path(__file__).parent.parent
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


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


def test_links_pictures_and_files_of_the_documents_are_there():
    named = re.compile(r"\b((?:tests|benchmarks|app|pgraph_core|peers)/[\w/]+\.\w+)")
    for file in DOCUMENTS:
        text = file.read_text()
        links = [file.parent / x for x in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)]
        missing = [x for x in (*links, *(ROOT / x for x in named.findall(text))) if not x.exists()]
        assert missing == [], file.name
    contents = (ROOT / "docs" / "index.md").read_text()
    files = [file.stem for file in (ROOT / "docs").glob("*.md") if file.stem != "index"]
    assert [file for file in files if f" <{file}>\n" not in contents] == []


@pytest.mark.parametrize("part", [*[*WHOLE][:13], pg.Constraint, pg.Force, pg.Shape])
def test_every_field_and_kind_is_described_once(part):
    text = (ROOT / "docs" / "description.md").read_text(encoding="utf-8")
    section = text.split(f"\n## {part.__name__}\n")[1].split("\n## ")[0]
    blocks = [block.strip().splitlines() for block in section.split("\n\n")]
    tables = [block[2:] for block in blocks if block and block[0].startswith("|")]
    named = [[x for row in t for x in re.findall(r"`(\w+)`", row.split("|")[1])] for t in tables]
    kinds = getattr(part, "KINDS", {})
    assert sorted(named[0]) == sorted(part.fields_of_kinds() if kinds else part.model_fields)
    if kinds:
        assert named[1] == [x for kind, own in kinds.items() for x in (kind, own.__name__)]
