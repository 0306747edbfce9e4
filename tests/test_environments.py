"""Runs without a home, in odd folders, with damaged and closed caches, and started otherwise."""

import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from pgraph_core.engine.compiler import archive, loading
from pgraph_core.model.files import user_folder

RUN = """
import hashlib, pgraph_core as pg
run = pg.simulate(pg.Model.serial(3), t_end=0.1)
print(hashlib.sha256(run.q.tobytes() + run.v.tobytes()).hexdigest())
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


def test_machine_code_that_is_damaged_is_as_if_it_were_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, "cache_folder", lambda: tmp_path)
    assert loading.kept("piece") is None
    loading.keep("piece", bytes(1000))
    assert loading.kept("piece") == bytes(1000)
    assert loading.kept("another") is None
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for content in (b"", whole[:20], whole[:-1], bytes(40) + whole[40:], whole + b"0"):
        path.write_bytes(content)
        assert loading.kept("piece") is None
    loading.keep("piece", b"3")
    assert loading.kept("piece") == b"3"
    for closed in (tmp_path / "no folder", None):
        monkeypatch.setattr(loading, "cache_folder", lambda folder=closed: folder)
        loading.keep("piece", b"3")
        assert loading.kept("piece") is None


def test_the_cache_forgets_what_was_used_longest_ago(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, "cache_folder", lambda: tmp_path)
    now = time.time()
    for k in range(5):
        loading.keep(f"old {k}", bytes(1000))
    for k, path in enumerate(sorted(tmp_path.iterdir(), key=lambda p: p.stat().st_mtime_ns)):
        os.utime(path, (now - 1e6 + k, now - 1e6 + k))
    (tmp_path / "half written.o.1").write_bytes(bytes(9000))
    os.utime(tmp_path / "half written.o.1", (now - 2e6, now - 2e6))
    assert loading.kept("old 0")  # which is a use
    monkeypatch.setattr(loading, "LARGEST_CACHE", 3500)
    loading._tidy.cache_clear()
    loading.keep("new", bytes(1000))
    left = [k for k in range(5) if loading.kept(f"old {k}")]
    assert left == [0, 4]
    assert loading.kept("new")
    assert len([*tmp_path.iterdir()]) == 3


def test_a_kernel_that_has_to_be_compiled_names_numba_where_it_is_missing(monkeypatch):
    """A lean installation has no numba; a damaged archive is the reason that it is told."""
    from pgraph_core.engine.tree.dynamics import mass_matrix

    monkeypatch.setattr(loading, "find_spec", lambda name: None)
    monkeypatch.setattr(loading, "kept", lambda key: None)
    monkeypatch.setattr(archive, "current", lambda: archive.Archive(Path("/nowhere")))
    with pytest.raises(ModuleNotFoundError, match=r"numba.*archive.*missing.*pip install"):
        loading.code_of(mass_matrix, 0)


def test_someone_without_a_home_has_a_folder(monkeypatch):
    for variable in ("XDG_STATE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as for a user without an entry
    assert user_folder("XDG_STATE_HOME", ".local/state").is_absolute()


def spaced(folder):
    place = folder / "mes modèles à moi (2)"
    place.mkdir()
    return {"folder": place, "PGRAPH_CACHE": str(place / "çache")}


def damaged(folder):
    kept = loading.cache_folder()
    assert kept is not None
    shutil.copytree(kept, folder / kept.name)
    for path in folder.rglob("*.o"):
        path.write_bytes(path.read_bytes()[:1000])
    return {"PGRAPH_CACHE": str(folder)}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "given",
    [
        {"HOME": None}, {"HOME": "/nowhere"}, {"LC_ALL": "C"}, {"LC_ALL": "tr_TR.UTF-8"},
        {"PYTHONOPTIMIZE": "2"}, {"PYTHONUTF8": "0"}, {"TZ": "Nowhere/X"},
        {"PYTHONHASHSEED": "7"}, {"COLUMNS": "0"}, {"NUMBA_NUM_THREADS": "1"},
        spaced, damaged,
    ],
    ids=lambda given: getattr(given, "__name__", str(given)),
)  # fmt: skip
def test_it_gives_the_same_bits_in_every_environment(given, tmp_path, here):
    given = given if isinstance(given, dict) else given(tmp_path)
    assert printed("-c", RUN, **given) == here


@pytest.mark.nightly
def test_two_processes_that_begin_at_once_share_an_empty_cache(tmp_path, here):
    with ThreadPoolExecutor(2) as both:
        again = both.map(lambda _: printed("-c", RUN, PGRAPH_CACHE=str(tmp_path)), range(2))
        assert [*again] == [here, here]


@pytest.mark.nightly
def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, here):
    """Root can write every folder, so the cache folder is below a file."""
    (tmp_path / "file").write_text("")
    closed = (
        "import pgraph_core.engine.compiler.loading as loading, pathlib; "
        f"loading.cache_folder = lambda: pathlib.Path({str(tmp_path / 'file')!r}, 'x')"
    )
    assert printed("-c", f"{closed}\n{RUN}") == here
