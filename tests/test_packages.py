"""The installed package: which names it owns, what a user's own packages may be called."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OURS = {
    "pgraph_core": "pgraph_core",
    "pgraph_app": "app",
    "pgraph_models": "static_models",
    "pgraph_peers": "peers",
}


def output(*words: str | Path, cwd: Path) -> str:
    done = subprocess.run([*map(str, words)], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for folder in OURS.values():
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, source / folder, ignore=ignored)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    output(*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", source, source, cwd=source)
    (file,) = source.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment that has the wheel and everything that it depends on."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    output(*pip, "--python", python, "install", "--no-deps", wheel, cwd=folder)
    (packages,) = folder.glob("lib/python*/site-packages")
    paths = {sysconfig.get_path("purelib"), *(p for p in sys.path if "site-packages" in p)}
    (packages / "dependencies.pth").write_text("\n".join(sorted(paths)))
    return python


def test_the_wheel_owns_only_names_of_ours(wheel: Path):
    names = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {name for name in names if not name.endswith(".dist-info")} == set(OURS)
    assert wheel.name.startswith("pgraph_dynamics-0.2.0-")


def test_the_wheel_has_every_file_of_every_package(wheel: Path):
    shipped = set(zipfile.ZipFile(wheel).namelist())
    for package, folder in OURS.items():
        for file in (ROOT / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                assert f"{package}/{file.relative_to(ROOT / folder).as_posix()}" in shipped


def test_an_app_of_the_user_and_ours_live_side_by_side(installed: Path, tmp_path: Path):
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "__init__.py").write_text("OWNER = 'the user'\n")
    (tmp_path / "static_models.py").write_text("OWNER = 'the user'\n")
    code = (
        "import app, static_models, pgraph_app, pgraph_models, pgraph_core as pg\n"
        "print(app.OWNER, static_models.OWNER, pgraph_models.path('pendulum').is_file())\n"
        "print(pgraph_app.show.__module__, pg.Model.load(pgraph_models.path('pendulum')).name)"
    )
    lines = output(installed, "-c", code, cwd=tmp_path).splitlines()
    assert lines[0] == "the user the user True"
    assert lines[1].startswith("pgraph_app ")
    command = installed.parent / "pgraph"
    assert "pendulum" in output(command, "models", cwd=tmp_path)
    assert output(command, "--version", cwd=tmp_path) == "pgraph 0.2.0\n"


def test_from_the_repository_root_the_names_of_the_folders_mean_the_same_modules():
    code = (
        "import static_models, app, pgraph_models, pgraph_app\n"
        "assert static_models is pgraph_models and app is pgraph_app\n"
        "from static_models import path; print(path('pendulum').name)"
    )
    assert output(sys.executable, "-c", code, cwd=ROOT) == "pendulum.json\n"
    assert output(sys.executable, "-m", "app", "--version", cwd=ROOT) == "pgraph 0.2.0\n"


def test_no_module_is_loaded_twice_under_two_names():
    code = (
        "import sys, runpy\n"
        "sys.argv = ['app', 'info', 'pendulum']\n"
        "try: runpy.run_module('app', run_name='__main__', alter_sys=False)\n"
        "except SystemExit: pass\n"
        "import pgraph_app.server, static_models, app\n"
        "files = {}\n"
        "for name, module in list(sys.modules.items()):\n"
        "    file = getattr(module, '__file__', None)\n"
        "    if file and name != '__main__': files.setdefault(file, set()).add(id(module))\n"
        "print([file for file, modules in files.items() if len(modules) > 1])"
    )
    assert output(sys.executable, "-c", code, cwd=ROOT).splitlines()[-1] == "[]"


@pytest.mark.parametrize("folder", [*OURS.values(), "tests", "benchmarks", "docs", "examples"])
def test_nothing_imports_by_the_name_of_a_folder(folder: str):
    for file in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            match node:
                case ast.Import(names=names):
                    modules = [alias.name for alias in names]
                case ast.ImportFrom(module=str(module), level=0):
                    modules = [module]
                case _:
                    continue
            found = {"app", "static_models", "peers"} & {module.split(".")[0] for module in modules}
            assert not found, f"{file}:{node.lineno}"
