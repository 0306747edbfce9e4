"""The site of the documents: it builds without a warning, and all in it leads somewhere."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg

ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))
CODE = re.compile(r"```python\n(.*?)```", re.DOTALL)
EXTERNAL = re.compile(r"^(https?:|mailto:|data:)")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    out = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(out)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


def test_each_public_name_has_its_place_in_the_reference(site):
    text = (site / "api.html").read_text()
    assert [name for name in dir(pg) if f'id="pgraph_core.{name}"' not in text] == []


def test_links_and_figures_of_the_site_are_there_and_nothing_loads_from_outside(site):
    pages = {page: page.read_text() for page in site.glob("*.html")}
    assert len(pages) > len(DOCS)
    for page, text in pages.items():
        loaded = re.findall(r"<(?:script|iframe|img|link)\b[^>]*?(?:src|href)=\"([^\"]+)\"", text)
        assert [link for link in loaded if EXTERNAL.match(link)] == []
        for link in {*loaded, *re.findall(r"<a\b[^>]*?href=\"([^\"]+)\"", text)}:
            if EXTERNAL.match(link):
                continue
            file, _, anchor = link.partition("#")
            there = page if not file else (site / file.partition("?")[0])
            assert there.is_file(), f"{page.name}: {link}"
            if anchor and there in pages:
                assert f'id="{anchor}"' in pages[there], f"{page.name}: {link}"


QUESTIONS = {  # of a newcomer: the page with the answer, and words of the answer
    "How do I install it?": ("install", "pip install"),
    "How do I describe my first mechanism?": ("tutorial", "Body"),
    "How do I close a loop?": ("constraints", "close_loop"),
    "Which integration method do I take?": ("methods", "auto"),
    "How accurate is my run?": ("methods", "error estimate"),
    "How does a body touch the ground?": ("contact", "friction"),
    "How do I drive a joint?": ("forces", "servo"),
    "Can it read my URDF?": ("files_of_others", "URDF"),
    "Why did my run stop?": ("troubleshooting", "step"),
    "How do I make a film of it?": ("figures", "to_film"),
    "What can it not do?": ("limits", "flexible"),
}


def test_a_newcomer_s_questions_are_answered_within_three_clicks(site):
    clicks, new = {"index": 0}, ["index"]
    while new:
        page = new.pop(0)
        text = (site / f"{page}.html").read_text()
        for link in re.findall(r"<a\b[^>]*?href=\"([\w.-]+)\.html(?:#[^\"]*)?\"", text):
            if link not in clicks and (site / f"{link}.html").is_file():
                clicks[link] = clicks[page] + 1
                new.append(link)
    for question, (page, words) in QUESTIONS.items():
        assert clicks[page] <= 3, question
        article = (site / f"{page}.html").read_text().partition("<article")[2]
        assert words.lower() in article.lower(), question


def test_the_notebooks_ran_and_their_runs_are_figures(site):
    for file in (ROOT / "examples" / "notebooks").glob("*.ipynb"):
        text = (site / "notebooks" / f"{file.stem}.html").read_text()
        assert text.count("<iframe srcdoc=") >= 1
        assert "pgraphEngine" in text
        assert 'src="http' not in text
        cells = json.loads(file.read_text())["cells"]
        assert not any(cell.get("outputs") for cell in cells)  # kept small: they are run here


def test_equations_are_drawn_without_a_script(site):
    text = (site / "theory.html").read_text()
    assert text.count("<math") > 20


@pytest.mark.parametrize(
    "file", [f for f in DOCS if CODE.search(f.read_text())], ids=lambda f: f.stem
)
def test_code_of_a_document_runs_as_it_stands(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for piece in CODE.findall(file.read_text()):
        exec(compile(piece, file.name, "exec"), names)
    runs = [value for value in names.values() if isinstance(value, pg.Result)]
    assert all(run.status.ok for run in runs), [run.message for run in runs]
