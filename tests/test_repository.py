"""The repository: packaging, the promises of README and CHANGELOG, and how the tests are run."""

from __future__ import annotations

import ast
import fnmatch
import os
import re
import stat
import subprocess
import tomllib
from pathlib import Path

import pytest

import pgraph_core as pg
import pgraph_models

pytestmark = pytest.mark.fast

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_version_is_the_top_of_the_changelog():
    top = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert top is not None
    assert top[1] == PROJECT["project"]["version"]
    assert f"version: {top[1]}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_tour_of_the_readme_runs(capsys):
    (tour,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len([line for line in tour.splitlines() if line]) <= 10
    exec(compile(tour, "README.md", "exec"), {})
    out = capsys.readouterr().out
    model = pg.Model.load(pgraph_models.path("quadruped"))
    assert str(pg.Mechanism(model).pgraph) in out
    assert "<Result: 1001 frames over 0 to 2 s by dop853, error " in out
    assert "notice" not in out
    assert "N on the left hind paw at most" in out


def test_the_readme_is_short_and_its_figures_come_from_the_benchmarks():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) < 90
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| ([\d.]+) \|$", text, re.MULTILINE)
    assert len(rows) >= 3
    measured = (ROOT / "docs" / "benchmarks.md").read_text()
    for case, peer, ratio in rows:
        assert re.search(
            rf"^\| {re.escape(case)} \| {re.escape(peer)} \|.*\| {ratio} \|", measured, re.M
        )


def test_every_document_is_in_the_contents_of_the_site():
    assert "](docs/index.md)" in (ROOT / "README.md").read_text()
    contents = (ROOT / "docs" / "index.md").read_text()
    files = [file.stem for file in (ROOT / "docs").glob("*.md") if file.stem != "index"]
    assert [file for file in files if f" <{file}>\n" not in contents] == []


def test_links_between_documents_lead_somewhere():
    for file in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", file.read_text()):
            assert (file.parent / link).exists(), f"{file.name}: {link}"


def test_the_workflow_of_the_forge_runs_the_two_commands():
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text()
    assert "run: make test" in workflow
    assert "make run" in workflow


def test_commands_of_the_readme_are_commands():
    from pgraph_app.cli.main import COMMANDS

    shown = set(re.findall(r"^    pgraph (\w+) ", (ROOT / "README.md").read_text(), re.MULTILINE))
    assert shown == set(COMMANDS)


def imported(file: Path) -> set[str]:
    """Top-level names of the absolute imports of a module, those in functions and texts of
    `import_module` too."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                found |= {alias.name.split(".")[0] for alias in names}
            case ast.ImportFrom(module=str(module), level=0):
                found.add(module.split(".")[0])
            case ast.Call(
                func=ast.Name(id="import_module"), args=[ast.Constant(value=str(module)), *_]
            ):
                found.add(module.split(".")[0])
    return found


@pytest.mark.parametrize(
    "folder", ["pgraph_core", "app", "static_models", "peers", "benchmarks", "docs", "examples"]
)
def test_nothing_outside_the_tests_imports_them(folder: str):
    files = list((ROOT / folder).rglob("*.py"))
    assert files
    assert [str(file) for file in files if "tests" in imported(file)] == []


def test_every_folder_with_source_is_a_package():
    for package in ("app", "static_models", "pgraph_core", "peers"):
        folders = {file.parent for file in (ROOT / package).rglob("*.py")}
        assert all((folder / "__init__.py").is_file() for folder in folders)


def test_every_dependency_is_justified():
    project = PROJECT["project"]
    extras = project["optional-dependencies"].values()
    wanted = [*project["dependencies"], *(line for extra in extras for line in extra)]
    names = {re.match(r"[\w-]+", line)[0] for line in wanted}  # type: ignore[index]
    text = (ROOT / "docs" / "dependencies.md").read_text()
    assert [name for name in sorted(names) if not re.search(rf"\b{name}\b", text)] == []


@pytest.mark.parametrize("script", ["run", "browser"])
def test_ci_scripts_are_executable_and_parse(script: str):
    file = ROOT / ".ci" / script
    assert file.stat().st_mode & stat.S_IXUSR
    assert os.access(file, os.X_OK)
    subprocess.run(["sh", "-n", str(file)], check=True)


def test_ci_runs_make_test():
    assert "exec make test" in (ROOT / ".ci" / "run").read_text()
    makefile = (ROOT / "Makefile").read_text()
    for target in ("run", "test", "quick", "nightly", "format"):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_pictures_of_the_documents_are_there():
    for file in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", file.read_text()):
            assert (file.parent / picture).is_file(), picture


def named_in(line: str) -> list[tuple[Path, str]]:
    """(file, pattern of a name) of a line of docs/page.md: 'test_page: a_name, b_...; test_x'."""
    found = []
    for part in line.split(";"):
        module, _, names = part.strip().partition(":")
        file = ROOT / (f"{module}.py" if "/" in module else f"tests/app/{module}.py")
        for name in names.split(",") if names else ["*"]:
            found.append((file, name.strip().replace("...", "*")))
    return found


def test_each_test_that_the_table_of_the_page_names_is_there():
    text = (ROOT / "docs" / "page.md").read_text().split("## What is tested")[1]
    lines = re.findall(r"^\| (\S+[^|]*) \| ([^|]+) \|$", text, re.MULTILINE)[1:]
    told = {word for line, _ in lines for word in re.findall(r"\b(?:1\.\d+|D\d+)\b", line)}
    assert told == {*(f"1.{k}" for k in range(1, 12)), *(f"D{k}" for k in range(1, 19))}
    missing = []
    for _, tests in lines:
        for file, pattern in named_in(tests):
            names = re.findall(r"^def test_(\w+)", file.read_text(), re.MULTILINE)
            if not any(fnmatch.fnmatchcase(name, pattern) for name in names):
                missing.append(f"{file.name}: {pattern}")
    assert missing == []


def test_the_tutorial_types_what_its_test_types():
    text = (ROOT / "docs" / "tutorial.md").read_text()
    script = (ROOT / "benchmarks" / "tutorial.py").read_text()
    typed = re.findall(r"(?:type|`:|next|coupler|rocker) `(-?\w[\w.]*)`|`(\w+)`, Enter", text)
    words = {a or b for a, b in typed}
    assert words >= {"3", "crank", "coupler", "rocker", "-1"}
    assert [word for word in sorted(words) if f'"{word}"' not in script] == []


# Words of a private dialect, and where they must not come back.
BANNED = re.compile(r"\b(?:anew|beside|is said|are said)\b", re.IGNORECASE)
PLAIN = (
    "docs",
    "examples",
    "benchmarks",
    "peers",
    "static_models",
    "app/digraph",
    "app/run",
    "pgraph_core/show",
    "pgraph_core/study",
    "pgraph_core/simulation/__init__.py",
)


def test_texts_are_plain_english():
    files = [*ROOT.glob("*.md")]
    for place in PLAIN:
        folder = ROOT / place
        files += [folder] if folder.is_file() else folder.rglob("*")
    texts = {file: file.read_text() for file in files if file.suffix in (".md", ".py", ".js")}
    assert len(texts) > 60
    found = [
        f"{file.name}: {word}" for file, text in texts.items() for word in BANNED.findall(text)
    ]
    assert found == []


def test_files_that_the_documents_name_are_there():
    path = re.compile(r"\b((?:tests|benchmarks|app|pgraph_core|peers)/[\w/]+\.\w+)")
    for file in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        named = path.findall(file.read_text())
        assert [name for name in named if not (ROOT / name).exists()] == [], file.name


def test_imports_by_name_hide_no_circle_but_two():
    """What stands above a module is imported by none; these two hand a call to the top floor."""
    found = set()
    for file in (ROOT / "pgraph_core").rglob("*.py"):
        for above in re.findall(r"import_module\(\"pgraph_core\.([\w.]+)\"\)", file.read_text()):
            found.add((file.stem, above))
    assert found == {("files", "formats"), ("result", "live.export")}
