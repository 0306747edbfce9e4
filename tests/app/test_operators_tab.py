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
    assert "eq. (" in payload["words"] or "fig. " in payload["words"]
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


def hinges(model, v, vdot, state):
    """Compute (fig3, eq5, eq8, J of tips, M, tau) of hinged bodies from the vectors of fig. 3.

    Newton's and Euler's laws of each body in three dimensions, without any spatial operator.
    """
    gravity, size = np.array(model.gravity), len(model.bodies)
    number = {body.name: k for k, body in enumerate(model.bodies)}
    place, w, speed, alpha, accel = np.zeros((5, size + 1, 3))  # the last one is the ground
    R, h, centre = np.zeros((size + 1, 3, 3)), np.zeros((size, 3)), np.zeros((size, 3))
    R[-1], ahead, across = np.eye(3), np.zeros((2, 6, size)), np.zeros((2, 6, size))
    a, path = np.zeros((6, size)), np.zeros((size, size), bool)
    for k, body in enumerate(model.bodies):
        p, axis, turn = number.get(body.parent, -1), np.array(body.axes[0]), state[k]
        path[k] = path[p] if p >= 0 else False
        path[k, k] = True
        K = np.cross(axis, np.eye(3)).T
        h[k], link = R[p] @ axis, R[p] @ body.link
        R[k] = R[p] @ (np.eye(3) + np.sin(turn) * K + (1 - np.cos(turn)) * K @ K)
        place[k], centre[k] = place[p] + link, R[k] @ body.com
        turned = np.cross(w[p], np.cross(w[p], link))
        ahead[:, :, k] = (
            np.concatenate((w[p], speed[p] + np.cross(w[p], link))),
            np.concatenate((alpha[p], accel[p] + np.cross(alpha[p], link))),
        )
        across[:, :3, k] = h[k] * v[k], h[k] * vdot[k]
        a[:, k] = np.concatenate((np.cross(w[p], h[k] * v[k]), turned))
        w[k], speed[k] = np.split(ahead[0, :, k] + across[0, :, k], 2)
        alpha[k], accel[k] = np.split(ahead[1, :, k] + across[1, :, k] + a[:, k], 2)

    def jacobian(k, point):  # of a point in world axes
        columns = [(*h[j], *np.cross(h[j], point - place[j])) for j in range(size)]
        return np.transpose(columns) * path[k]

    M, tau, fig3 = np.zeros((size, size)), np.zeros(size), []
    for k, body in enumerate(model.bodies):
        inertia, c = R[k] @ body.inertia @ R[k].T, centre[k]
        J = jacobian(k, place[k] + c)
        M += body.mass * J[3:].T @ J[3:] + J[:3].T @ inertia @ J[:3]
        a_c = accel[k] + np.cross(alpha[k], c) + np.cross(w[k], np.cross(w[k], c))
        moment = inertia @ alpha[k] + np.cross(w[k], inertia @ w[k])
        tau += J[3:].T @ (body.mass * (a_c - gravity)) + J[:3].T @ moment
        link = R[number.get(body.parent, -1)] @ body.link
        fig3.append((*place[k], *link, *c, *w[k], *(speed[k] + np.cross(w[k], c))))
    V, Vdot = np.hstack((w, speed))[:-1].T, np.hstack((alpha, accel))[:-1].T
    tips = [k for k in range(size) if model.bodies[k].name not in {b.parent for b in model.bodies}]
    ends = [place[k] + R[k] @ model.bodies[k].tip_point for k in tips]
    return (
        np.array(fig3), np.vstack((V, ahead[0], across[0])).T,
        np.vstack((Vdot, ahead[1], across[1], a)).T,
        np.vstack([jacobian(k, end) for k, end in zip(tips, ends)]), M, tau,
    )  # fmt: skip


def test_equations_of_several_terms_and_omega_are_those_of_newton_and_euler():
    model = built_in("fig1_tree")
    assert all(body.joint == "revolute" for body in model.bodies)
    run = pg.simulate(pg.Mechanism(model), t_end=0.3, frames=5)
    state = ran(begun(model), run)
    state = replace(state, playback=replace(state.playback, time=0.3))
    q, v, vdot = run.q[-1], run.v[-1], run.vdot[-1]
    fig3, eq5, eq8, J, M, tau = hinges(model, v, vdot, q)
    rest = hinges(model, v, 0 * vdot, q)[-1]
    eq24 = np.array([tau, M @ vdot, rest, 0 * vdot])
    expected = {"fig3": fig3, "eq5": eq5, "eq8": eq8, "eq24": eq24}
    expected["Omega"] = J @ np.linalg.inv(M) @ J.T
    for what, numbers in expected.items():
        found = matrices.matrix(state, what).toarray()
        assert found == pytest.approx(numbers, rel=1e-12, abs=1e-12 * abs(numbers).max()), what
    assert np.ptp(v) > 0.1


def test_forces_of_the_ground_are_the_last_term_of_equation_24():
    """With springs, drives, and feet that constraints hold: F_T of the paper, with its sign."""
    model = built_in("quadruped")
    mech = pg.Mechanism(model)
    run = pg.simulate(mech, scenario="stance", t_end=0.05, frames=6)
    state = ran(begun(model), run)
    state = replace(state, playback=replace(state.playback, time=float(run.t[-1])))
    tau, inertia, bias, outer = matrices.matrix(state, "eq24").toarray()
    feet = {c.name: mech.jacobian(run.q[-1], c.body, c.point) for c in model.constraints}
    on_bodies = sum(J.T @ run.constraint_force[name][-1] for name, J in feet.items())
    size = abs(tau).max() + abs(bias).max()
    assert -outer == pytest.approx(on_bodies, abs=1e-12 * size)
    assert tau == pytest.approx(inertia + bias + outer, abs=1e-11 * size)
    for what, terms in (("eq5", 3), ("eq8", 4)):
        whole, *parts = np.split(matrices.matrix(state, what).toarray(), terms, axis=1)
        assert whole == pytest.approx(sum(parts), abs=1e-12 * abs(whole).max())
    assert abs(outer).max() > 10.0


def test_omega_of_a_singular_mass_matrix_names_the_body():
    model = pg.Model.serial(3).edit("3", mass=0.0, inertia=np.zeros((3, 3)), derived=())
    for compiled in (True, False):
        problem = operator(begun(model, compiled=compiled), Inspected("Omega"))["problem"]
        assert "singular" in problem
        assert "'3'" in problem


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
