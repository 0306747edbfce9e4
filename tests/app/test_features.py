"""Features of the page: each folder is whole, and their layers hold."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_app.features import APP, FEATURES, places

from .store import ME, after, begun, do

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


def test_a_page_sees_each_view_that_has_a_place_and_no_other():
    state = begun(pg.Model())
    views = {host.view for place in places() for host in place.hosts}
    state = after(state, *(do.Sees(ME, view, True) for view in sorted(views)))
    assert state.clients[ME].sees == views
    assert after(state, do.Sees(ME, "nothing", True)) is state


TAB = {  # a whole feature: its part of the state, a job, and a tab that counts the bodies
    "__init__.py": """
from dataclasses import dataclass
from .. import run
from ..core.jobs import Job

class Client(run.Client): ...

@dataclass(frozen=True)
class State(run.State):
    counting: object = None

@dataclass(frozen=True)
class Counting(Job):
    NAME, FIELD, PROBLEM = "count", "counting", ""
    def work(self, progress): return len(self.model.bodies)
    def ended(self, state, result): return state
""",
    "view.py": """
from ..core.views import Host, Place, topic

VIEWS = (Place(topic("count", len, "model", seen="count"), 60, Host("count", "drawer", "Count")),)
""",
}
PROOF = """
from pgraph_app import features, server
from pgraph_app.core.jobs import Job
from pgraph_app.session import Sees
import pgraph_core as pg
tabs = [host.tab for place in features.places() for host in place.hosts]
state = features.update(features.initial(pg.Model()), server.Connected(1))
sees = features.update(state, Sees(1, "count", True)).clients[1].sees
print("Count" in tabs, "count" in sees, "count" in [kind.NAME for kind in Job.__subclasses__()])
"""


def test_a_tab_with_a_job_is_its_folder(tmp_path):
    """The folder alone makes it. Its layer is a line of `pyproject.toml`, without which it is
    refused (above)."""
    shutil.copytree(APP, tmp_path / "app", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "pgraph_app").symlink_to(tmp_path / "app")
    (folder := tmp_path / "app" / "count").mkdir()
    for name, text in TAB.items():
        (folder / name).write_text(text, "utf-8")
    path = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))
    ran = subprocess.run(
        [sys.executable, "-c", PROOF], cwd=tmp_path, capture_output=True, text=True, timeout=300,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert ran.stdout.split() == ["True"] * 3, ran.stderr
