"""The Operators tab shows and exports the whole operator."""

import io
import json

import numpy as np
import pytest
from scipy import io as files
from scipy import sparse

import pgraph_core as pg
from pgraph_app.operators import Inspected
from pgraph_app.operators import view as matrices
from pgraph_app.operators.view import operator

from .store import ME, after, begun, built_in, do


@pytest.fixture(scope="module")
def state():
    return begun(built_in("quadruped"))


@pytest.mark.parametrize("what", tuple(matrices.TITLES))
def test_d11_each_operator_is_shown_and_exported_whole_with_its_names(state, what):
    payload = json.loads(json.dumps(operator(state, Inspected(what)), allow_nan=False))
    assert payload["problem"] == ""
    assert payload["step"] == [1, 1]
    assert [len(payload["row_names"]), len(payload["column_names"])] == payload["shape"]
    shown, whole = np.zeros(payload["shape"]), matrices.matrix(state, what).toarray()
    for i, j, x in payload["cells"]:
        shown[i, j] = x
    assert shown == pytest.approx(whole, rel=1e-5, abs=1e-12)
    for side in ("row", "column"):
        for number, name in zip(payload[f"{side}_numbers"], payload[f"{side}_names"], strict=True):
            assert name.split(" ")[0] == state.derived.names[number - 1]
    assert "eq. (" in payload["words"]
    ends = ("npz", "csv", "mtx")
    npz, csv, mtx = (io.BytesIO(matrices.as_file(state, what, end)) for end in ends)
    assert sparse.load_npz(npz).toarray() == pytest.approx(whole, abs=1e-14)
    assert np.loadtxt(csv, delimiter=",", ndmin=2) == pytest.approx(whole, abs=1e-14)
    assert files.mmread(mtx).toarray() == pytest.approx(whole, abs=1e-14)


def test_it_follows_the_pose_that_is_shown():
    state = begun(pg.Model.serial(3))
    before = matrices.matrix(state, "M").toarray()
    now = after(state, do.MoveJoint(ME, 0, "2", 0, "1.0"))
    assert not np.allclose(matrices.matrix(now, "M").toarray(), before)


def test_a_thousand_bodies_are_shown_in_blocks_and_a_part_of_them_in_entries():
    state = begun(pg.Model.serial(1000), compiled=False)
    whole = matrices.matrix(state, "eps_phi")
    shown = matrices.picture(whole, Inspected("eps_phi"))
    assert len(shown.cells) <= matrices.MOST**2
    assert shown.step == (63, 63)
    part = matrices.picture(whole, Inspected("eps_phi", (100, 196), (94, 190)))
    assert part.step == (1, 1)
    assert part.cells
    assert operator(state, Inspected("Phi"))["problem"]  # too many entries
    assert "compiled" in operator(state, Inspected("M"))["problem"]
    blocks = np.zeros((200, 200))
    blocks[0, 0], blocks[1, 1], blocks[2, 2] = 1.0, -5.0, 2.0
    assert matrices.picture(blocks, Inspected("M")).cells[0] == (0, 0, -5.0)  # the largest


@pytest.mark.parametrize("span", [(5, 2), (10**6, 10**6), (0, 0)])
def test_any_span_of_a_page_is_a_part_of_the_operator(state, span):
    shown = matrices.picture(matrices.matrix(state, "M"), Inspected("M", span, span))
    assert 0 <= shown.rows[0] < shown.rows[1] <= shown.shape[0]
