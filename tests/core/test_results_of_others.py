"""Runs in damaged files, equal runs, and wrong types in the calls that take a run or a model."""

import dataclasses
import io
import json
import math
import tracemalloc
import zipfile

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import show

pytestmark = pytest.mark.quick

ROD = pg.Model(bodies=[pg.Body(name="rod", com=(1, 0, 0), tip=(1, 0, 0))])


@pytest.fixture(scope="module")
def run():
    return pg.simulate(ROD, t_end=0.01, frames=5)


@pytest.fixture(scope="module")
def saved(run, tmp_path_factory):
    file = tmp_path_factory.mktemp("runs") / "run.npz"
    run.save(file)
    return file.read_bytes()


def refusal(file, content: bytes) -> str:
    file.write_bytes(content)
    with pytest.raises(pg.FileError) as refused:
        pg.Result.load(file)
    text = str(refused.value)
    assert text.startswith(f"{file}")
    assert "\n" not in text
    assert "pickle" not in text
    return text


def test_other_files_and_cut_ones_are_refused(saved, tmp_path):
    file = tmp_path / "run.npz"
    for content in (b"", b"{}", b"\x89PNG", b"\x93NUMPY\x01\x00v\x00"):
        assert "Result.save" in refusal(file, content)
    for path in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(pg.FileError, match=r"Result\.save"):
            pg.Result.load(path)
    for n in (2, len(saved) // 2, len(saved) - 1):
        assert "damaged" in refusal(file, saved[:n])


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

    assert "header" in said(header=None)
    assert "'q'" in said(q=None)
    said(q=arrays["q"][1:])
    said(v=np.zeros((5, 7)))
    said(header=np.array("[1"))
    assert "'model'" in said(header=np.array("{}"))
    said(header=np.array(json.dumps(header | {"status": "GONE"})))


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("t", (3_000_000,)),
        ("q", (5, 600_000)),
        ("q", (3_000_000, 1)),
        ("header", (1, 75_000_000)),
        ("force:rod", (5, 600_000)),
        ("contact event times", (9_000_000,)),
        ("user event q", (9_000_000, 1)),
        ("unknown", (3_000_000,)),
    ],
)
def test_what_unpacks_to_more_than_a_model_can_have_is_refused_unread(saved, tmp_path, name, shape):
    file, kind = tmp_path / "run.npz", "<f8" if name != "header" else "<U1"
    with np.load(io.BytesIO(saved)) as data:
        arrays = {k: x for k, x in data.items() if k != name}
    np.savez_compressed(file, **arrays)
    head = {"descr": kind, "fortran_order": False, "shape": shape}
    whole = zipfile.ZipFile(file, "a", zipfile.ZIP_DEFLATED)
    with whole, whole.open(f"{name}.npy", "w") as entry:
        np.lib.format.write_array_header_1_0(entry, head)
        for _ in range(math.prod(shape) * np.dtype(kind).itemsize // 100_000):
            entry.write(bytes(100_000))
    tracemalloc.start()
    try:
        refusal(file, file.read_bytes())
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()


def test_equal_runs_are_equal_and_others_are_not(run, saved, tmp_path):
    again = pg.simulate(ROD, t_end=0.01, frames=5)
    assert (run == again) is True
    assert (run != again) is False
    one, two = (dataclasses.replace(run, q=run.q * np.nan, error_at=run.t * np.nan) for _ in "ab")
    assert one == two != run
    assert run == dataclasses.replace(run, timing={}, counters={})
    file = tmp_path / "run.npz"
    file.write_bytes(saved)
    assert pg.Result.load(file) == run
    assert run != dataclasses.replace(run, q=run.q + 1.0)
    heavier = pg.Mechanism(ROD.edit("rod", mass=2.0))
    assert run != dataclasses.replace(run, mechanism=heavier)
    assert run != 3
    assert run in [again]


def test_parts_of_runs_are_equal_by_their_arrays(run):
    again = pg.simulate(ROD, t_end=0.01, frames=5)
    assert run.contacts == again.contacts
    assert (run.body_motion == again.body_motion) is True
    assert (run.body_motion != again.body_motion) is False
    assert run.body_motion != run.body_motion._replace(force=run.body_motion.force + 1.0)
    assert run.mechanism.topology == again.mechanism.topology
    for value in (run, run.contacts, run.mechanism.topology, run.body_motion):
        with pytest.raises(TypeError, match="unhashable"):
            hash(value)


def test_the_error_of_a_run_with_torques_by_a_function_is_not_estimated(run):
    torque = {"tau": lambda t, q, v: -v, "t_end": 0.01, "frames": 5}
    done = pg.simulate(ROD, **torque)
    assert np.isnan(done.error_estimate)
    assert "estimated" in done.message
    assert "not estimated" in repr(done)
    assert "nan" not in show.run_html(done)
    assert done.notices == ()
    assert run.message == run.status.value
    assert pg.simulate(ROD, estimate=False, **torque).message == run.message
