"""The site of the documents: it builds without a warning, and all in it leads somewhere."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg

pytestmark = pytest.mark.nightly
ROOT = Path(__file__).parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))
EXTERNAL = re.compile(r"^(https?:|mailto:|data:)")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(out)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


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


def test_the_search_leads_to_sections_that_exist(site):
    """Its script replaces a function of Sphinx and uses names of it."""
    folder = site / "_static"
    sections = json.loads((folder / "sections.js").read_text().partition("=")[2].rstrip(" ;\n"))
    assert len(sections) > 5 * len(DOCS)
    for page, _, anchor, _, _ in sections:
        assert f'id="{anchor}"' in (site / f"{page}.html").read_text()
    assert 'src="_static/sections.js' in (site / "search.html").read_text()
    theirs = (folder / "searchtools.js").read_text()
    for name in re.findall(
        r"(?:Search|index)\.(\w+)|SearchResultKind", (folder / "search.js").read_text()
    ):
        assert name in theirs
    assert "performTermsSearch: (searchTerms, excludedTerms) =>" in theirs


def test_the_site_has_the_reference_the_equations_and_the_figures(site):
    text = (site / "api.html").read_text()
    assert [name for name in dir(pg) if f'id="pgraph_core.{name}"' not in text] == []
    assert (site / "paper.html").read_text().count("<math") > 10  # drawn without a script
    for file in (ROOT / "examples" / "notebooks").glob("*.ipynb"):
        text = (site / "notebooks" / f"{file.stem}.html").read_text()
        assert [x for x in ("<iframe srcdoc=", "pgraphEngine") if x not in text] == []
