"""The Operators tab shows and exports the whole operator."""

import io
import json
from dataclasses import replace
from functools import partial
from typing import get_args

import numpy as np
import pytest
from scipy import io as files
from scipy import sparse

import pgraph_core as pg
from pgraph_app.operators import Inspected, Operator
from pgraph_app.operators import view as matrices
from pgraph_app.operators.view import operator

from .store import ME, after, begun, built_in, do, ran


@pytest.fixture(scope="module")
def state():
    model = built_in("quadruped")
    return ran(begun(model), pg.simulate(pg.Mechanism(model), t_end=0.02, frames=5))


@pytest.mark.parametrize("what", tuple(matrices.OPERATORS))
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
        for mark, name in zip(payload[f"{side}_numbers"], payload[f"{side}_names"], strict=True):
            assert name.split(" ")[0] == (
                mark if isinstance(mark, str) else state.derived.names[mark - 1]
            )
    assert "eq. (" in payload["words"]
    ends = ("npz", "csv", "mtx")
    npz, csv, mtx = (io.BytesIO(matrices.as_file(state, what, end)) for end in ends)
    assert sparse.load_npz(npz).toarray() == pytest.approx(whole, abs=1e-14)
    assert np.loadtxt(csv, delimiter=",", ndmin=2) == pytest.approx(whole, abs=1e-14)
    assert files.mmread(mtx).toarray() == pytest.approx(whole, abs=1e-14)


def test_what_is_shown_of_a_run_satisfies_the_equations_of_the_paper():
    model = built_in("double_pendulum")
    state = ran(begun(model), pg.simulate(pg.Mechanism(model), t_end=0.3, frames=5))
    state = replace(state, playback=replace(state.playback, time=0.3))
    M, C, J, H, Phi, Phi_T, Mk, S = (
        matrices.matrix(state, what).toarray()
        for what in ("M", "C", "J", "H", "Phi", "Phi_T", "M_k", "S")
    )
    a, b, V, V_T, Jdot, Vdot, F, tau, vdot = (
        matrices.matrix(state, what).toarray().T.reshape(-1)
        for what in ("a", "b", "V", "V_T", "Jdot", "Vdot", "F", "tau", "vdot")
    )
    v, up = state.run.result.v[-1], np.tile([0, 0, 0, *np.negative(model.gravity)], len(S))
    near = partial(pytest.approx, rel=1e-12, abs=1e-12)
    assert Phi @ H @ v == near(V)  # (17)
    assert Phi_T @ Phi @ H == near(J)  # (20)
    assert J @ v == near(V_T)  # (19)
    tip, q = state.derived.names[-1], state.run.result.q[-1]
    point = model.body(tip).tip_point
    assert pg.Mechanism(model).jacobian_bias(q, v, tip, point) == near(Jdot)  # (27)
    assert Phi @ (H @ vdot + a) == near(Vdot)  # (21)
    assert Phi.T @ (Mk @ (Vdot + up) + b) == near(F)  # (22)
    assert near(tau) == H.T @ F  # (23)
    assert H.T @ Phi.T @ Mk @ Phi @ H == near(M)  # (25)
    assert H.T @ Phi.T @ (Mk @ (Phi @ a + up) + b) == near(C[0])  # (25)
    assert np.linalg.solve(M, tau - C[0]) == near(vdot)  # (26)
    assert np.any(V)
    assert np.any(a)


def test_accelerations_and_forces_ask_for_a_run():
    state = begun(built_in("double_pendulum"))
    for what, one in matrices.OPERATORS.items():
        problem = operator(state, Inspected(what))["problem"]
        assert problem == (matrices.NO_RUN if one.of_run else "")


def test_each_operator_may_be_asked_for():
    assert set(matrices.OPERATORS) == set(get_args(Operator))


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
