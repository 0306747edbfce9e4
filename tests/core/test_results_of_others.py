"""Runs in damaged files, equal runs, and wrong types in the calls that take a run or a model."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import show

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
    refused = 0
    for place in rng.integers(0, len(saved), 150):
        content = bytearray(saved)
        content[place] ^= int(rng.integers(1, 256))
        file.write_bytes(content)
        try:
            assert pg.Result.load(file).status in pg.Status
        except pg.FileError:
            refused += 1
    assert refused > 0


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


# -- equality --------------------------------------------------------------------------------------


def test_equal_runs_are_equal_and_others_are_not(run, saved, tmp_path):
    again = pg.simulate(ROD, t_end=0.01, frames=5)
    assert (run == again) is True
    assert (run != again) is False
    assert run == dataclasses.replace(run, timing={}, counters={})
    file = tmp_path / "run.npz"
    file.write_bytes(saved)
    assert pg.Result.load(file) == run
    assert run != dataclasses.replace(run, q=run.q + 1.0)
    heavier = pg.Mechanism(ROD.edit("rod", mass=2.0))
    assert run != dataclasses.replace(run, mechanism=heavier)
    assert run != 3
    assert run in [again]


def test_nan_equals_nan(run):
    one, two = (dataclasses.replace(run, q=run.q * np.nan, error_estimate=np.nan) for _ in "ab")
    assert one == two
    assert one != run


def test_parts_of_runs_are_equal_by_their_arrays(run):
    again = pg.simulate(ROD, t_end=0.01, frames=5)
    assert run.contacts == again.contacts
    assert (run.body_motion == again.body_motion) is True
    assert (run.body_motion != again.body_motion) is False
    assert run.body_motion != run.body_motion._replace(force=run.body_motion.force + 1.0)
    assert run.mechanism.topology == again.mechanism.topology
    record = type(run.contacts)
    phases = {"foot": np.array(["swing", "stance"])}
    assert record(phases=phases) == record(phases={"foot": phases["foot"].copy()})
    assert record(phases=phases) != record()


def test_what_holds_arrays_has_no_hash(run):
    for value in (run, run.contacts, run.mechanism.topology, run.body_motion):
        with pytest.raises(TypeError, match="unhashable"):
            hash(value)


# -- wrong types -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (pg.Mechanism, r"Mechanism, model: must be a pg\.Model; given 'arm'; .*load\('arm'\)"),
        (lambda x: pg.BatchStepper(x, 3), r"BatchStepper, mechanism: must be a pg\.Mechanism or"),
        (pg.stability_map, r"stability_map, mechanism: must be a pg\.Mechanism or a pg\.Model; "),
        (pg.verify, r"verify, case: must be a pg\.Case, .* given 'arm'$"),
        (pg.footprints, r"footprints, run: must be a pg\.Result, .* given 'arm'$"),
    ],
)
def test_a_wrong_type_is_refused_in_a_sentence(call, wanted):
    with pytest.raises(pg.InputError, match=wanted):
        call("arm")
    with pytest.raises(pg.InputError, match="given None"):
        call(None)


# -- what a run says of itself ---------------------------------------------------------------------


def test_a_run_whose_torques_come_from_a_function_says_that_its_error_is_not_estimated(run):
    torque = {"tau": lambda t, q, v: -v, "t_end": 0.01, "frames": 5}
    done = pg.simulate(ROD, **torque)
    assert np.isnan(done.error_estimate)
    assert "its error is not estimated, because a function gives its torques" in done.message
    assert "half the step, or at a tighter rtol" in done.message
    assert "error not estimated" in repr(done)
    assert "nan" not in show.run_html(done)
    assert done.notices == ()
    assert run.message == run.status.value
    assert pg.simulate(ROD, estimate=False, **torque).message == run.message


def test_a_notebook_completes_the_joints_of_a_run(run):
    assert run._ipython_key_completions_() == ["rod"]
    assert run["rod"].shape == (5,)
