"""Runs in damaged files, equal runs, and wrong types in the calls that take a run or a model."""

from __future__ import annotations

import json
from contextlib import suppress

import numpy as np
import pytest

import pgraph_core as pg

ROD = pg.Model(bodies=[pg.Body(name="rod", mass=1.0, tip=(1, 0, 0))])


@pytest.fixture(scope="module")
def run():
    return pg.simulate(ROD, t_end=0.01, frames=5)


@pytest.fixture(scope="module")
def saved(run, tmp_path_factory):
    file = tmp_path_factory.mktemp("runs") / "run.npz"
    run.save(file)
    return file.read_bytes()


# -- damaged files ---------------------------------------------------------------------------------


def refusal(file, content: bytes) -> str:
    file.write_bytes(content)
    with pytest.raises(pg.FileError) as refused:
        pg.Result.load(file)
    text = str(refused.value)
    assert text.startswith(f"{file}: ")
    assert "\n" not in text
    assert "pickle" not in text
    return text


@pytest.mark.parametrize("content", [b"", b"{}", b"\x89PNG", b"\x93NUMPY\x01\x00v\x00"])
def test_other_files_are_refused_with_what_would_do(content, tmp_path):
    said = refusal(tmp_path / "run.npz", content)
    assert said.endswith("is no run: not an .npz file; give a file written by Result.save")


def test_a_file_cut_anywhere_is_damaged(saved, tmp_path):
    for n in np.linspace(2, len(saved) - 1, 40).astype(int):
        assert "is damaged" in refusal(tmp_path / "run.npz", saved[:n])


def test_a_file_changed_anywhere_is_read_or_refused(saved, tmp_path):
    file, rng = tmp_path / "run.npz", np.random.default_rng(1)
    for place in rng.integers(0, len(saved), 150):
        content = bytearray(saved)
        content[place] ^= int(rng.integers(1, 256))
        file.write_bytes(content)
        with suppress(pg.FileError):
            pg.Result.load(file)


def test_a_file_with_parts_missing_or_of_other_sizes_is_refused(run, saved, tmp_path):
    file = tmp_path / "run.npz"
    file.write_bytes(saved)
    with np.load(file) as data:
        arrays = dict(data)
    header = json.loads(str(arrays["header"]))

    def said(**changed) -> str:
        parts = {k: x for k, x in (arrays | changed).items() if x is not None}
        np.savez(file, **parts)
        return refusal(file, file.read_bytes())

    assert "it has no header" in said(header=None)
    assert "'q' is missing" in said(q=None)
    assert "holds no whole run" in said(q=arrays["q"][1:])
    assert "holds no whole run" in said(v=np.zeros((5, 7)))
    assert "is damaged" in said(header=np.array("[1"))
    assert "'model' is missing" in said(header=np.array("{}"))
    assert "'GONE' is missing" not in said(header=np.array(json.dumps(header | {"status": "GONE"})))


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(pg.FileError, match=r"cannot be read: .*Result\.save"):
            pg.Result.load(path)
