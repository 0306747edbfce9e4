"""The distribution: its files, names and metadata, and the packages that it depends on."""

import os
import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from email import message_from_string
from email.message import Message
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from pgraph_core.engine.compiler.archive import FILE, File

ROOT = Path(__file__).parent.parent
OURS = {
    "pgraph_core": "pgraph_core",
    "pgraph_app": "app",
    "pgraph_models": "static_models",
    "pgraph_peers": "peers",
}
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
LINK = re.compile(r"\]\(([^)]+)\)")
SETUP = runpy.run_path(str(ROOT / "setup.py"))


def output(*words: str | Path, cwd: Path, code: int = 0, **environment: str) -> str:
    """Run a command and return its standard output, or its standard error if it fails."""
    if words[0] != sys.executable:  # of another environment, which is to see its own packages alone
        environment["PYTHONPATH"] = ""
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, env=os.environ | environment, capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    return done.stderr if code else done.stdout


def copy_of_sources(folder: Path) -> Path:
    """Copy what the distribution is made of."""
    folder.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    for name in OURS.values():
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def built(source: Path, into: Path, **environment: str) -> Path:
    """Build a wheel of a folder or an archive."""
    words = (*PIP, "wheel", "--no-deps", "--no-build-isolation", "--no-cache-dir", "-w", into)
    output(*words, source, cwd=into.parent, **environment)
    (file,) = into.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_of_sources(tmp_path_factory.mktemp("a folder") / "source")


@pytest.fixture(scope="module")
def wheel(source: Path) -> Path:
    return built(source, source.parent / "wheel")


@pytest.fixture(scope="module")
def lean(source: Path) -> Path:
    return built(source, source.parent / "lean", PGRAPH_LEAN="1")


def shipped(file: Path) -> set[str]:
    return set(zipfile.ZipFile(file).namelist())


def metadata(file: Path) -> Message:
    (name,) = (name for name in shipped(file) if name.endswith(".dist-info/METADATA"))
    return message_from_string(zipfile.ZipFile(file).read(name).decode())


def brought(file: Path) -> set[str]:
    """Return the names of all packages that `pip install` of a wheel brings."""
    found: set[str] = set()
    new = [(Requirement(text), "") for text in metadata(file).get_all("Requires-Dist", [])]
    while new:
        requirement, extra = new.pop()
        marker, name = requirement.marker, canonicalize_name(requirement.name)
        if name in found or not (marker is None or marker.evaluate({"extra": extra})):
            continue
        found.add(name)
        for chosen in ("", *requirement.extras):
            new += [(Requirement(text), chosen) for text in distribution(name).requires or []]
    return found


def environment_of(packages: set[str], folder: Path) -> Path:
    """Make an environment with these packages of ours and return its Python."""
    venv.create(folder, with_pip=False)
    (site,) = folder.glob("lib/python*/site-packages")
    for name in packages:
        found = distribution(name)
        parts = {file.parts[0] for file in found.files or () if file.parts[0] not in ("..", "")}
        for part in parts - {"__pycache__"}:
            (site / part).symlink_to(found.locate_file(part))
    return folder / "bin" / "python"


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "with_address", "without"),
    [
        ("a ![p q](docs/a.png) b", "a ![p q](https://s/raw/HEAD/docs/a.png) b", "a  b"),
        ("([p\nq](docs/a.md#part))", "([p\nq](https://s/blob/HEAD/docs/a.md#part))", "(p\nq)"),
        ("[p](a), [q](b/).", "[p](https://s/blob/HEAD/a), [q](https://s/blob/HEAD/b/).", "p, q."),
        *[(x, x, x) for x in ("[p](https://doi.org/1)", "`run['a'](1)`", "f(x)[0](1), [a, b]")],
    ],
)
def test_links_on_an_index_lead_to_the_repository(text: str, with_address: str, without: str):
    for_index = SETUP["for_index"]
    assert for_index(text, "https://s") == with_address
    assert for_index(text, None) == without


@pytest.mark.quick
@pytest.mark.parametrize("address", [None, "https://s"])
def test_every_link_of_the_readme_works_on_an_index(address: str | None):
    readme = (ROOT / "README.md").read_text("utf-8")
    shown = SETUP["for_index"](readme, address)
    assert [link for link in LINK.findall(shown) if not link.startswith("https://")] == []


@pytest.mark.quick
def test_every_llvmlite_that_is_allowed_reads_the_archive_of_kernels():
    (bound,) = (x for x in map(Requirement, SETUP["LIBRARY"]) if x.name == "llvmlite")
    made_by = File(FILE).index["made_by"]["llvmlite"]
    (least,) = bound.specifier
    assert least.operator == ">="
    assert Version(least.version).release[:2] == Version(made_by).release[:2]


@pytest.mark.quick
def test_every_file_that_is_no_module_is_named_as_data_of_its_package():
    """A wheel without the font of the page could not start the page."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    for package, patterns in settings["tool"]["setuptools"]["package-data"].items():
        folder = ROOT / OURS[package]
        data = {file for pattern in patterns for file in folder.glob(pattern)}
        files = {file for file in folder.rglob("*") if file.is_file()}
        missing = {x for x in files - data if x.suffix != ".py" and "__pycache__" not in x.parts}
        assert missing == set()


@pytest.mark.nightly
def test_the_wheel_has_every_file_of_every_package_and_no_other_names(wheel: Path, lean: Path):
    names = {name.split("/")[0] for name in shipped(wheel)}
    assert {name for name in names if not name.endswith(".dist-info")} == set(OURS)
    for package, folder in OURS.items():
        for file in (ROOT / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                assert f"{package}/{file.relative_to(ROOT / folder).as_posix()}" in shipped(wheel)
    assert shipped(lean) == shipped(wheel)


@pytest.mark.nightly
def test_the_metadata_of_the_wheel_are_complete(wheel: Path):
    found = metadata(wheel)
    for field in ("Author", "License-Expression", "License-File", "Keywords", "Project-URL"):
        assert found[field], field
    assert found["Requires-Python"] == ">=3.11"
    topics = {text.split(" :: ")[0] for text in found.get_all("Classifier", [])}
    assert topics >= {"Development Status", "Intended Audience", "Programming Language", "Topic"}
    assert "page" not in found.get_all("Provides-Extra", [])
    assert found["Description-Content-Type"] == "text/markdown"
    links = LINK.findall(str(found.get_payload()))
    assert links
    assert [link for link in links if not link.startswith("https://")] == []


@pytest.mark.nightly
def test_a_source_archive_makes_the_same_wheel(source: Path, wheel: Path):
    folder = source.parent / "archive"
    code = f"import setuptools.build_meta as m; m.build_sdist({str(folder)!r})"
    output(sys.executable, "-c", code, cwd=source)
    (archive,) = folder.glob("*.tar.gz")
    again = built(archive, source.parent / "again")
    assert shipped(again) == shipped(wheel)
    assert str(metadata(again)) == str(metadata(wheel))


@pytest.mark.nightly
def test_a_deleted_module_is_in_no_later_wheel(tmp_path: Path):
    source = copy_of_sources(tmp_path / "source")
    (source / "app" / "gone.py").write_text("")
    assert "pgraph_app/gone.py" in shipped(built(source, tmp_path / "before"))
    (source / "app" / "gone.py").unlink()
    assert "pgraph_app/gone.py" not in shipped(built(source, tmp_path / "after"))


@pytest.mark.nightly
def test_what_an_installation_brings(wheel: Path, lean: Path):
    rest = {"viser", "trimesh", "websockets", "numba"}
    assert len(brought(lean)) <= 8
    assert brought(wheel) >= brought(lean) | rest
    assert not brought(lean) & rest


@pytest.mark.nightly
def test_a_lean_installation_simulates_and_refuses_the_page(lean: Path, tmp_path: Path):
    python = environment_of(brought(lean), tmp_path / "environment")
    output(*PIP, "--python", python, "install", "--no-deps", lean, cwd=tmp_path)
    pgraph = python.parent / "pgraph"
    output(*PIP, "--python", python, "check", cwd=tmp_path)
    assert "pendulum" in output(pgraph, "models", cwd=tmp_path)
    output(pgraph, "convert", ROOT / "static_models/quadruped.json", "a.urdf", cwd=tmp_path)
    output(pgraph, "check", "a.urdf", cwd=tmp_path)
    output(pgraph, "run", "double_pendulum", "-o", "a.csv", cwd=tmp_path)
    output(pgraph, "export", "double_pendulum", "--live", "-o", "a.html", cwd=tmp_path)
    for words in (
        (),
        ("export", "pendulum", "-o", "b.html"),
        ("export", "pendulum", "-o", "b.png"),
    ):
        assert "PGRAPH_LEAN" in output(pgraph, *words, cwd=tmp_path, code=1)
    (archive,) = tmp_path.glob("environment/lib/python*/site-packages/pgraph_core/engine/*.archive")
    archive.write_bytes(archive.read_bytes()[:-1])
    cold = {"PGRAPH_CACHE": str(tmp_path / "cache")}
    refused = output(pgraph, "run", "double_pendulum", cwd=tmp_path, code=1, **cold)
    assert "archive" in refused
    assert "pip install numba" in refused
    assert "Traceback" not in refused


@pytest.mark.nightly
def test_install_run_and_uninstall_leave_nothing(wheel: Path, tmp_path: Path):
    python = environment_of(brought(wheel), tmp_path / "environment")
    (site,) = tmp_path.glob("environment/lib/python*/site-packages")
    before = {file.name for file in site.iterdir()}
    output(*PIP, "--python", python, "install", "--no-deps", wheel, cwd=tmp_path)
    home = {"HOME": str(tmp_path), "PGRAPH_CACHE": "", "PYTHONDONTWRITEBYTECODE": ""}
    output(python.parent / "pgraph", "run", "double_pendulum", cwd=tmp_path, **home)
    output(*PIP, "--python", python, "uninstall", "-y", "pgraph-dynamics", cwd=tmp_path)
    assert {file.name for file in site.iterdir()} - {"__pycache__"} == before
    assert not (python.parent / "pgraph").exists()


@pytest.mark.nightly
def test_an_app_of_the_user_and_ours_live_side_by_side(wheel: Path, tmp_path: Path):
    venv.create(tmp_path / "environment", with_pip=False)
    python = tmp_path / "environment" / "bin" / "python"
    output(*PIP, "--python", python, "install", "--no-deps", wheel, cwd=tmp_path)
    (packages,) = tmp_path.glob("environment/lib/python*/site-packages")
    paths = {sysconfig.get_path("purelib"), *(p for p in sys.path if "site-packages" in p)}
    (packages / "dependencies.pth").write_text("\n".join(sorted(paths)))
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "__init__.py").write_text("OWNER = 'the user'\n")
    (tmp_path / "static_models.py").write_text("OWNER = 'the user'\n")
    code = (
        "import app, static_models, pgraph_app, pgraph_models, pgraph_core as pg\n"
        "print(app.OWNER, static_models.OWNER, pgraph_models.path('pendulum').is_file())\n"
        "print(pgraph_app.show.__module__, pg.Model.load(pgraph_models.path('pendulum')).name)"
    )
    first, second = output(python, "-c", code, cwd=tmp_path).splitlines()
    assert first == "the user the user True"
    assert second.startswith("pgraph_app ")
    assert "pendulum" in output(python.parent / "pgraph", "models", cwd=tmp_path)


@pytest.mark.nightly
def test_the_names_of_the_folders_work_in_the_repository():
    code = "import static_models as a, app as b, pgraph_models as c, pgraph_app as d\n"
    code += "print(a.path('pendulum') == c.path('pendulum'), b.show.__name__ == d.show.__name__)"
    assert output(sys.executable, "-c", code, cwd=ROOT) == "True True\n"
    assert output(sys.executable, "-m", "app", "--version", cwd=ROOT).startswith("pgraph ")
