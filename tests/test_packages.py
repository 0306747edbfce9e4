"""The installed package: which names it owns, and what a user's own packages may be called."""

import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.nightly
ROOT = Path(__file__).parent.parent
OURS = {
    "pgraph_core": "pgraph_core",
    "pgraph_app": "app",
    "pgraph_models": "static_models",
    "pgraph_peers": "peers",
}
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]


def output(*words: str | Path, cwd: Path) -> str:
    done = subprocess.run([*map(str, words)], cwd=cwd, capture_output=True, text=True)
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
    output(*PIP, "wheel", "--no-deps", "--no-build-isolation", "-w", source, source, cwd=source)
    (file,) = source.glob("*.whl")
    return file


def test_the_wheel_has_every_file_of_every_package_and_no_other_names(wheel: Path):
    shipped = set(zipfile.ZipFile(wheel).namelist())
    names = {name.split("/")[0] for name in shipped}
    assert {name for name in names if not name.endswith(".dist-info")} == set(OURS)
    for package, folder in OURS.items():
        for file in (ROOT / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                assert f"{package}/{file.relative_to(ROOT / folder).as_posix()}" in shipped


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


def test_the_names_of_the_folders_mean_the_same_modules():
    code = "import static_models as a, app as b, pgraph_models as c, pgraph_app as d\n"
    code += "print(a is c, b is d, a.path('pendulum').name)"
    assert output(sys.executable, "-c", code, cwd=ROOT) == "True True pendulum.json\n"
    assert output(sys.executable, "-m", "app", "--version", cwd=ROOT).startswith("pgraph ")
