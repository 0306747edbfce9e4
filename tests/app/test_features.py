"""Features of the page: each folder is whole, and their layers hold."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pgraph_app.features import APP, FEATURES

pytestmark = pytest.mark.quick
NOT_FEATURES = {"core", "cli", "__pycache__"}
PARTS = {
    "__init__.py": ("State", "Client"),
    "view.py": ("VIEWS = (",),
}


def lacking(folder: Path) -> list[str]:
    """Return the parts that a feature's folder lacks, as FOLDER/FILE: what."""
    found = []
    for file, needed in PARTS.items():
        path = folder / file
        text = path.read_text("utf-8") if path.exists() else ""
        found += [f"{folder.name}/{file}: {part}" for part in needed if part not in text]
    return found


def test_each_feature_declares_its_state_its_events_and_its_views():
    folders = [path for path in APP.iterdir() if path.is_dir() and path.name not in NOT_FEATURES]
    assert sorted(path.name for path in folders) == list(FEATURES)
    assert not [part for folder in folders for part in lacking(folder)]


@pytest.mark.parametrize("file", PARTS)
def test_a_part_that_is_missing_is_named(tmp_path, file):
    folder = shutil.copytree(APP / "digraph", tmp_path / "digraph")
    assert not lacking(folder)
    (folder / file).unlink()
    assert lacking(folder) == [f"digraph/{file}: {part}" for part in PARTS[file]]


LINT = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports())"


@pytest.mark.parametrize(
    ("file", "line", "names"),
    [
        ("core/store.py", "from ..gait import Walking", "pgraph_app.gait"),
        ("run/__init__.py", "from ..scene import State as S2", "pgraph_app.scene"),
        ("sweeps/__init__.py", "", "sweeps"),
    ],
)
def test_an_import_upwards_or_a_folder_without_a_layer_is_refused(tmp_path, file, line, names):
    """A copy of the packages with one more line breaks the contract, and the report names it."""
    root = APP.resolve().parent
    for package in ("app", "pgraph_core", "static_models", "peers"):
        shutil.copytree(root / package, tmp_path / package, ignore=shutil.ignore_patterns(
            "__pycache__", "*.json", "*.obj", "*.archive", "*.wasm"))  # fmt: skip
    for name, package in (("app", "app"), ("models", "static_models"), ("peers", "peers")):
        (tmp_path / f"pgraph_{name}").symlink_to(tmp_path / package)
    shutil.copy(root / "pyproject.toml", tmp_path)
    path = tmp_path / "app" / file
    path.parent.mkdir(exist_ok=True)
    path.write_text((path.read_text("utf-8") if path.exists() else "") + line + "\n", "utf-8")
    ran = subprocess.run(
        [sys.executable, "-c", LINT], cwd=tmp_path, capture_output=True, text=True, timeout=300,
        env={"PYTHONPATH": str(tmp_path), "PATH": ""},
    )  # fmt: skip
    assert ran.returncode == 1
    assert "features of the page > core BROKEN" in ran.stdout
    assert names in ran.stdout.partition("Broken contracts")[2]
