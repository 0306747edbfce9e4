"""Runs without a home, in odd folders, with damaged and closed caches, and started otherwise."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_core.engine.compiler.jit import _Files, cache_folder
from pgraph_core.model.files import user_folder

RUN = """
import hashlib, pgraph_core as pg
run = pg.simulate(pg.Model.serial(3), t_end=0.1)
print(hashlib.sha256(run.q.tobytes() + run.v.tobytes()).hexdigest())
"""
PROCESSES = """
import concurrent.futures, multiprocessing, sys
import pgraph_core as pg

def last(model):
    return pg.simulate(model, t_end=0.1).q[-1].tobytes()

if __name__ == "__main__":
    model = pg.Model.serial(3)
    here, way = last(model), multiprocessing.get_context(sys.argv[1])
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=way) as pool:
        assert set(pool.map(last, [model] * 4)) == {here}
    print("equal")
"""


def printed(*arguments: str, folder: Path | None = None, **environment: str | None) -> str:
    """Return the output of a new process. A variable that is None is not set."""
    values = {k: v for k, v in {**os.environ, **environment}.items() if v is not None}
    command = [sys.executable, *arguments]
    return subprocess.run(
        command, env=values, cwd=folder, check=True, capture_output=True, text=True
    ).stdout


@pytest.fixture(scope="module")
def here() -> str:
    return printed("-c", RUN)


def test_a_kernel_file_that_is_damaged_is_as_if_it_were_not_there(tmp_path):
    files = _Files(tmp_path / "kernel")
    assert files.load("signature") is None
    files.save("signature", {"code": bytes(1000)})
    assert files.load("signature") == {"code": bytes(1000)}
    assert files.load("another") is None
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for content in (b"", whole[:20], whole[:-1], bytes(40) + whole[40:], whole + b"0"):
        path.write_bytes(content)
        assert files.load("signature") is None
    files.save("signature", 3)
    assert files.load("signature") == 3
    closed = _Files(tmp_path / "kernel" / "no folder")
    closed.save("signature", 3)
    assert closed.load("signature") is None


def test_someone_without_a_home_has_a_folder(monkeypatch):
    for variable in ("XDG_STATE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as for a user without an entry
    assert user_folder("XDG_STATE_HOME", ".local/state").is_absolute()


@pytest.mark.nightly
@pytest.mark.parametrize(
    "environment",
    [
        {"HOME": None}, {"HOME": "/nowhere"}, {"LC_ALL": "C"}, {"LC_ALL": "tr_TR.UTF-8"},
        {"PYTHONOPTIMIZE": "1"}, {"PYTHONOPTIMIZE": "2"}, {"PYTHONUTF8": "0"}, {"TZ": "Nowhere/X"},
        {"PYTHONHASHSEED": "7"}, {"COLUMNS": "0"}, {"NUMBA_NUM_THREADS": "1"},
    ],
    ids=str,
)  # fmt: skip
def test_it_works_and_gives_the_same_bits_in_other_environments(environment, here):
    assert printed("-c", RUN, **environment) == here


@pytest.mark.nightly
def test_it_works_in_a_folder_with_spaces_and_accents(tmp_path, here):
    folder = tmp_path / "mes modèles à moi (2)"
    folder.mkdir()
    pg.Model.serial(2).save(folder / "modèle.json")
    assert printed("-c", RUN, folder=folder, PGRAPH_CACHE=str(folder / "çache")) == here
    printed("-m", "pgraph_app", "check", "modèle.json", folder=folder)


@pytest.mark.nightly
@pytest.mark.parametrize("way", ["fork", "spawn", "forkserver"])
def test_processes_started_any_way_give_the_same_bits(way, tmp_path):
    (tmp_path / "many.py").write_text(PROCESSES, "utf-8")
    assert printed(str(tmp_path / "many.py"), way) == "equal\n"


@pytest.mark.nightly
def test_a_cache_that_is_damaged_is_made_again(tmp_path, here):
    shutil.copytree(cache_folder(), tmp_path / cache_folder().name)
    for path in tmp_path.rglob("*.kernel"):
        path.write_bytes(path.read_bytes()[:1000])
    assert printed("-c", RUN, PGRAPH_CACHE=str(tmp_path)) == here


@pytest.mark.nightly
def test_two_processes_that_begin_at_once_share_an_empty_cache(tmp_path, here):
    command = [sys.executable, "-c", RUN]
    environment = {**os.environ, "PGRAPH_CACHE": str(tmp_path)}
    both = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate()[0] for process in both] == [here, here]


@pytest.mark.nightly
def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, here, monkeypatch):
    """Root can write every folder, so the cache folder is a file."""
    closed = tmp_path / "a file"
    closed.write_text("")
    closed_cache = (
        "import pgraph_core.engine.compiler.jit as jit, pathlib; "
        f"jit.cache_folder = lambda: pathlib.Path({str(closed)!r}, 'x')"
    )
    assert printed("-c", f"{closed_cache}\n{RUN}") == here
