"""Counting and closing: ranks and redundant rows by name, singular positions, assembly."""

import json
from itertools import pairwise

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.paper import Operators
from tests.oracle.constrained import constraint_rows

from ..worlds import built_in as mechanism

FLAT = np.array([-np.pi / 2, np.pi / 2, -np.pi / 2])  # of the parallelogram, in number order
ALONG = np.array([-1.0, 1.0, -1.0])


def like(part, **changes):
    return part.model_copy(update=changes)


def windows(n):
    model = pg.Model.load(pgraph_models.path("four_bar"))
    crank, coupler, _ = model.bodies
    bodies, loops = [like(crank, name="crank 0")], []
    for i in range(n):
        bodies.append(like(coupler, name=f"coupler {i}", parent=f"crank {i}"))
        bodies.append(like(crank, name=f"crank {i + 1}", link=(i + 1, 0, 0)))
        ends = {"body": f"coupler {i}", "other": f"crank {i + 1}"}
        loops.append(like(model.constraints[0], name=f"loop {i}", **ends))
    return pg.Model(up="y", bodies=tuple(bodies), constraints=tuple(loops))


Z, TURNS = "translation along z", ["rotation about x", "rotation about y"]
SKEW = "rotation about (0, 0.707, -0.707)"
COUNTS = [  # model, rows, rank, dof, redundant rows by constraint
    ("four_bar", 3, 2, 1, {"loop": [Z]}),
    ("slider_crank", 5, 2, 1, {"pin": [Z, *TURNS]}),
    ("bricard", 5, 4, 1, {"loop": [SKEW]}),
    ("andrews", 9, 6, 1, {f"{k} at K2": [Z] for k in ("K3", "K4", "K6")}),
    ("quadruped", 12, 10, 11, {f"right_{k}_paw": [Z] for k in ("front", "hind")}),
    ("rolling_disc", 3, 3, 3, {}),
    ("pendulum", 0, 0, 1, {}),
]


def test_the_kind_that_a_remark_suggests_has_no_redundant_row():
    model = mechanism("four_bar").model
    loop = model.constraints[0]
    (text,) = (text for of, text, _ in pg.Mechanism(model).mobility().remarks if of)
    (kind,) = (kind for kind in pg.Constraint.KINDS if f"'{kind}'" in text)
    ends = {name: getattr(loop, name) for name in ("name", "body", "other", "point", "other_point")}
    line = pg.Constraint(kind=kind, axis=(0, 0, 1), **ends)
    found = pg.Mechanism(model.replace(constraints=(line,))).mobility()
    assert (found.dof, found.redundant) == (1, ())
    assert not found.remarks


@pytest.mark.parametrize(("name", "rows", "rank", "dof", "redundant"), COUNTS)
def test_ranks_and_redundant_rows_by_name(name, rows, rank, dof, redundant):
    report = mechanism(name).mobility()
    assert (report.rows, report.rank, report.dof) == (rows, rank, dof)
    found = [(row.constraint, row.direction) for row in report.redundant]
    assert found == [(name, row) for name, rows in redundant.items() for row in rows]
    assert not any(row.only_here for row in report.redundant)
    assert report.extra == 0
    again = json.loads(json.dumps(report.to_dict()))
    assert [row["constraint"] for row in again["redundant"]] == [row[0] for row in found]


@pytest.mark.parametrize("name", ["slider_crank", "bricard", "quadruped", "andrews"])
def test_the_rank_is_that_of_the_dense_rows(name):
    mech = mechanism(name)
    q, v = mech.home()
    q, v, _ = mech.assemble(q + 0.05 * (np.abs(q) < 0.4), v)
    J, _ = constraint_rows(Operators(mech.model, mech.topology, q), mech.model.constraints)
    values = np.linalg.svd(J @ np.linalg.inv(np.linalg.cholesky(mech.mass_matrix(q))).T)[1]
    assert mech.mobility(q).rank == int((values > 1e-7 * values[0]).sum())


def test_a_flat_parallelogram_has_two_ways_to_go():
    mech = mechanism("four_bar")
    report = mech.mobility(FLAT, ALONG)
    assert (report.rank, report.dof, report.extra, report.finite) == (1, 2, 1, True)
    assert [row.direction for row in report.redundant if row.only_here] == ["translation along x"]
    assert report.joints == ("left crank", "coupler", "right crank")
    taken = np.array(report.branches[report.branch])
    assert abs(taken @ ALONG) == pytest.approx(3.0, abs=0.05)
    assert mech.mobility(FLAT).branch == -1


def test_stretched_rods_shake_but_do_not_move():
    """Two rods in line between pins two rods apart: a way to move that leads nowhere."""
    first = like(windows(1).body("coupler 0"), name="a", parent="ground", link=(0, 0, 0))
    rods = (first, like(first, name="b", parent="a", link=(1, 0, 0)))
    pin = pg.Constraint(name="pin", body="b", point=(1, 0, 0))
    report = pg.Mechanism(pg.Model(up="y", bodies=rods, constraints=(pin,))).mobility()
    assert (report.dof, report.extra, report.finite) == (1, 1, False)
    assert "locked" in str(report)


def test_every_row_of_a_repeated_constraint_is_redundant():
    model = windows(1)
    again = like(model.constraints[0], name="again")
    report = pg.Mechanism(model.replace(constraints=(*model.constraints, again))).mobility()
    assert report.rank == 2
    assert [row.constraint for row in report.redundant] == ["loop 0", "again", "again", "again"]


@pytest.mark.parametrize("tilt", [0.0, 1e-17, 1e-14, 1e-10])
def test_a_hinge_that_is_parallel_up_to_rounding_closes_a_plane(tilt):
    """CAD writes axes to the last digits; rows of nothing but rounding have no rank."""
    model = mechanism("four_bar").model
    ends = {name: getattr(model.constraints[0], name) for name in ("body", "other", "point")}
    hinge = pg.Revolute(name="loop", axis=(tilt, 0, 1), other_axis=(0, 0, 1), **ends)
    report = pg.Mechanism(model.replace(constraints=(hinge,))).mobility()
    assert (report.rows, report.rank, report.dof) == (5, 2, 1)


@pytest.mark.parametrize("n", [12, pytest.param(50, marks=pytest.mark.nightly)])
def test_loops_that_share_their_cranks_leave_one_way_to_move(n):
    report = pg.Mechanism(windows(n)).mobility()
    assert (report.tree, report.rows, report.rank, report.dof) == (2 * n + 1, 3 * n, 2 * n, 1)
    assert [row.constraint for row in report.redundant] == [f"loop {i}" for i in range(n)]
    assert {row.direction for row in report.redundant} == {Z}


@pytest.mark.parametrize("n", [40, pytest.param(220, marks=pytest.mark.nightly)])
def test_a_closed_chain_is_counted(n):
    """A regular polygon: a plane needs two of the three rows of its pin."""
    names = [f"link {i}" for i in range(n)]
    links = [pg.Body(name=names[0], q=(2 * np.pi / n,))]
    links += [
        pg.Body(name=name, parent=parent, link=(1, 0, 0), q=(2 * np.pi / n,))
        for parent, name in pairwise(names)
    ]
    pin = pg.Constraint(name="pin", body=names[-1], point=(1, 0, 0), other_point=(0, 0, 0))
    report = pg.Mechanism(pg.Model(bodies=tuple(links), constraints=(pin,))).mobility()
    assert (report.rows, report.rank, report.dof, report.extra) == (3, 2, n - 2, 0)
    assert [(row.constraint, row.direction) for row in report.redundant] == [("pin", Z)]


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "bricard", "andrews", "quadruped"])
@pytest.mark.parametrize("size", [1e-3, 0.1, 0.6])
def test_a_disturbed_state_is_assembled(name, size):
    """Nearby, and so far off that whole steps of the projection diverge."""
    if (name, size) == ("quadruped", 0.6):
        size = 0.3  # its feet stand on a fold of what the legs can reach: slow from afar
    mech = mechanism(name)
    q, v = mech.home()
    random = np.random.default_rng(3)
    q, v = q + size * random.normal(size=mech.nq), v + random.normal(size=mech.nv)
    new_q, new_v, report = mech.assemble(q, v)
    again_q, again_v, nothing = mech.assemble(new_q, new_v)
    assert max(np.abs(again_q - new_q).max(), np.abs(again_v - new_v).max()) < 1e-9
    assert report.moved > 0
    assert report.joint in mech.names
    assert not nothing.notable


def test_the_report_names_the_joint_that_moved_most():
    mech = mechanism("four_bar")
    start = np.array([0.0, 0.0, 0.3])
    _, v, report = mech.assemble(start, np.array([-1.0, 1.0, -1.0]))
    assert (report.joint, report.turned) == ("right crank", True)
    assert "0." in str(report)
    done = pg.simulate(mech, start, v, t_end=0.01)
    assert done.status.ok
    assert "'right crank'" in done.notices[0]
    hold = pg.Motion(name="hold", body="a", q_of_t={"t": [0.0], "value": [0.5]})
    rail = pg.Model(bodies=[pg.Body(name="a", joint="prismatic")], constraints=[hold])
    q, _, report = pg.Mechanism(rail).assemble()
    assert (q[0], report.moved) == (pytest.approx(0.5), pytest.approx(0.5))
    assert (report.joint, report.turned) == ("a", False)


def test_one_of_two_contradicting_constraints_may_be_assembled_alone():
    held = [
        pg.Motion(name=name, body="crank 0", q_of_t={"t": (0, 1), "value": (x, x)})
        for name, x in (("left", 0.2), ("right", 0.5))
    ]
    rod = windows(1).body("crank 0")
    mech = pg.Mechanism(pg.Model(up="y", bodies=(rod,), constraints=tuple(held)))
    assert mech.assemble(active=["right"])[0] == pytest.approx([0.5])


@pytest.mark.parametrize("t_end", [10.0, pytest.param(60.0, marks=pytest.mark.nightly)])
def test_a_four_bar_does_not_drift(t_end):
    done = pg.simulate(mechanism("four_bar"), scenario="turn", t_end=t_end, frames=61)
    assert done.status.ok
    assert done.constraint_drift.max() < 1e-9
    assert done.energy_drift < 1e-6


@pytest.mark.parametrize("law", [None, "soft", "complementarity"])
def test_redundant_rows_are_reported_once_at_the_start(law):
    model = pg.Model.load(pgraph_models.path("slider_crank"))
    if law:
        model = model.add(pg.Contact(name="floor", body="rod", law=law, points=((0, 0, 0),)))
    first, *others = pg.simulate(model, scenario="turn", t_end=0.01, method="auto").notices
    assert all(fact in first for fact in ("3 of 5", "'pin'", Z, *TURNS))
    assert not any("redundant" in text for text in others)
    assert pg.simulate(mechanism("rolling_disc"), t_end=0.01).notices == ()


def singular(run):
    return [text for text in run.notices if "singular" in text]


HOW = [
    *({"method": "rk4", "step": 1e-3}, {"method": "rk4", "step": 2e-2}),
    *({"method": "dop853", "rtol": 1e-8}, {"method": "radau5", "rtol": 1e-6}),
    {"method": "semi_implicit_euler", "step": 1e-3},
]


@pytest.mark.parametrize("how", HOW)
def test_a_singular_position_on_the_way_is_reported_with_its_time(how):
    """The parallelogram is flat where its crank lies along x, whatever the steps hit."""
    mech = mechanism("four_bar")
    done = pg.simulate(mech, scenario="turn", t_end=1.0, frames=10001, **how)
    when = np.interp(np.pi / 2, np.abs(done.q[:, 0]), done.t)
    (text,) = singular(done)
    assert all(fact in text for fact in (f"t = {when:.3g}", "translation along x", "'loop'"))


def test_singular_positions_are_counted_also_at_the_start():
    (text,) = singular(pg.simulate(mechanism("four_bar"), scenario="turn", t_end=3.0))
    assert "3" in text
    (text,) = singular(pg.simulate(mechanism("four_bar"), FLAT, np.zeros(3), step=1e-3))
    assert "began" in text
    options = {"t_end": 0.5, "method": "rk4", "step": 1e-3}  # the crank turns back before
    assert not singular(
        pg.simulate(mechanism("four_bar"), FLAT + 0.1 * ALONG, -1e-3 * ALONG, **options)
    )


@pytest.mark.parametrize("name", ["bricard", "quadruped", "slider_crank", "andrews"])
def test_positions_that_are_regular_are_not_called_singular(name):
    """Rows that are redundant all the way, and rows that take each other's place."""
    mech = mechanism(name)
    for scenario in (None, *(s.name for s in mech.model.scenarios)):
        assert not singular(pg.simulate(mech, scenario=scenario, estimate=False))


def test_a_constraint_that_no_joint_can_change_leaves_the_motion_as_it_is():
    """All rows of Ω are zero: a distance between two points that move together."""
    held = {"parent": "upper", "link": (0.5, 0, 0), "inertia": (0.01,) * 3}
    bodies = (
        pg.Body(name="upper", tip=(0.5, 0, 0), axes=(0, 1, 0)),
        pg.Body(name="lower", tip=(0.3, 0, 0), axes=(0, 1, 0), **held),
        pg.Body(name="pin", joint="weld", **held),
    )
    ends = {"point": (0.3, 0, 0), "other_point": (0, 0, 0)}
    rod = pg.Distance(name="rod", body="lower", other="pin", length=0.3, **ends)
    free = pg.simulate(pg.Model(bodies=bodies), t_end=0.2)
    tied = pg.simulate(pg.Model(bodies=bodies, constraints=(rod,)), t_end=0.2)
    assert tied.status.ok
    np.testing.assert_allclose(tied.q[-1], free.q[-1], atol=1e-9)
    assert abs(tied.constraint_force["rod"]).max() == 0.0
    assert any("redundant" in notice and "rod" in notice for notice in tied.notices)
