"""The Operators tab: what is shown is the operator, exported it is all of it."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from scipy import io as files
from scipy import sparse

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.state import Inspected, initial
from pgraph_app.features import update
from pgraph_app.operators import view as matrices
from pgraph_app.operators.view import operator
from pgraph_app.pose.update import MoveJoint
from pgraph_app.session.update import Connected

ALL = tuple(matrices.TITLES)


@pytest.fixture
def state():
    model = pg.Model.load(pgraph_models.path("quadruped"))
    return update(initial(model), Connected(1))


@pytest.mark.parametrize("what", ALL)
def test_d11_each_operator_is_shown_whole_with_its_names_as_json(state, what):
    payload = json.loads(json.dumps(operator(state, Inspected(what)), allow_nan=False))
    assert payload["problem"] == ""
    assert payload["step"] == [1, 1]
    assert [len(payload["row_names"]), len(payload["column_names"])] == payload["shape"]
    shown = np.zeros(payload["shape"])
    for i, j, x in payload["cells"]:
        shown[i, j] = x
    assert shown == pytest.approx(matrices.matrix(state, what).toarray(), rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("what", ALL)
def test_rows_and_columns_have_the_numbers_of_their_bodies(state, what):
    found = operator(state, Inspected(what))
    for side in ("row", "column"):
        for number, name in zip(found[f"{side}_numbers"], found[f"{side}_names"], strict=True):
            body = state.derived.names[number - 1]
            assert name.split(" ")[0] == body, (number, name)
    assert "eq. (" in found["words"]


def test_it_counts_bodies_dof_separation_and_tip_bodies(state):
    said = operator(state, Inspected("M"))["facts"]
    assert said == "16 bodies, 21 DoF, 2 separation bodies, 4 tip bodies"


def test_it_follows_the_pose_that_is_shown():
    state = update(initial(pg.Model.serial(3)), Connected(1))
    before = matrices.matrix(state, "M").toarray()
    after = update(state, MoveJoint(1, 0, "2", 0, "1.0"))
    assert not np.allclose(matrices.matrix(after, "M").toarray(), before)


def test_a_thousand_bodies_are_shown_in_blocks_and_a_part_of_them_in_entries():
    state = initial(pg.Model.serial(1000))
    whole = matrices.matrix(state, "eps_phi")
    shown = matrices.picture(whole, Inspected("eps_phi"))
    assert len(shown.cells) <= matrices.MOST**2
    assert shown.step == (63, 63)
    part = matrices.picture(whole, Inspected("eps_phi", (100, 196), (94, 190)))
    assert part.step == (1, 1)
    assert part.cells
    assert "too many entries" in operator(state, Inspected("Phi"))["problem"]
    assert "compiled" in operator(state, Inspected("M"))["problem"]


def test_of_a_block_the_largest_entry_is_told():
    whole = np.zeros((200, 200))
    whole[0, 0], whole[1, 1], whole[2, 2] = 1.0, -5.0, 2.0
    assert matrices.picture(whole, Inspected("M")).cells[0] == (0, 0, -5.0)


@pytest.mark.parametrize("what", ALL)
def test_every_operator_is_exported_whole(state, what):
    whole = matrices.matrix(state, what).toarray()
    npz = sparse.load_npz(io.BytesIO(matrices.as_file(state, what, "npz"))).toarray()
    csv = np.loadtxt(io.BytesIO(matrices.as_file(state, what, "csv")), delimiter=",", ndmin=2)
    mtx = files.mmread(io.BytesIO(matrices.as_file(state, what, "mtx"))).toarray()
    for read in (npz, csv, mtx):
        assert read == pytest.approx(whole, abs=1e-14)


@pytest.mark.parametrize("span", [(5, 2), (10**6, 10**6), (0, 0)])
def test_any_span_of_a_page_is_a_part_of_the_operator(state, span):
    shown = matrices.picture(matrices.matrix(state, "M"), Inspected("M", span, span))
    assert 0 <= shown.rows[0] < shown.rows[1] <= shown.shape[0]
