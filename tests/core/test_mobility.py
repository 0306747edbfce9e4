"""Counting and closing: ranks and redundant rows by name, singular positions, assembly."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

FLAT = np.array([-np.pi / 2, np.pi / 2, -np.pi / 2])  # of the parallelogram, in number order
ALONG = np.array([-1.0, 1.0, -1.0])


def mechanism(name: str) -> pg.Mechanism:
    return pg.Mechanism(pg.Model.load(pgraph_models.path(name)))


def like(part, **changes):
    return part.model_copy(update=changes)


def windows(n: int) -> pg.Model:
    """n parallelograms in a row, of rods of 1 m."""
    model = pg.Model.load(pgraph_models.path("four_bar"))
    crank, coupler, _ = model.bodies
    bodies, loops = [], []
    for i in range(n + 1):
        bodies.append(like(crank, name=f"crank {i}", link=(i, 0, 0)))
        if i < n:
            bodies.append(like(coupler, name=f"coupler {i}", parent=f"crank {i}"))
            ends = {"body": f"coupler {i}", "other": f"crank {i + 1}"}
            loops.append(like(model.constraints[0], name=f"loop {i}", **ends))
    return pg.Model(up="y", bodies=tuple(bodies), constraints=tuple(loops))


@pytest.mark.parametrize(
    ("name", "rows", "rank", "dof", "redundant"),
    [
        ("four_bar", 3, 2, 1, ["translation along z of constraint 'loop'"]),
        (
            "slider_crank",
            5,
            2,
            1,
            [
                f"{what} of constraint 'pin'"
                for what in ("translation along z", "rotation about x", "rotation about y")
            ],
        ),
        ("bricard", 5, 4, 1, ["rotation about (0, 0.707, -0.707) of constraint 'loop'"]),
        (
            "andrews",
            9,
            6,
            1,
            [f"translation along z of constraint '{k} at K2'" for k in ("K3", "K4", "K6")],
        ),
        (
            "quadruped",
            12,
            10,
            11,
            [f"translation along z of constraint 'right_{k}_paw'" for k in ("front", "hind")],
        ),
        ("rolling_disc", 3, 3, 3, []),
        ("pendulum", 0, 0, 1, []),
    ],
)
def test_ranks_and_redundant_rows_by_name(name, rows, rank, dof, redundant):
    report = mechanism(name).mobility()
    assert (report.rows, report.rank, report.dof) == (rows, rank, dof)
    assert [str(row) for row in report.redundant] == redundant
    assert not any(row.only_here for row in report.redundant)
    assert report.extra == 0


@pytest.mark.parametrize("name", ["slider_crank", "bricard", "quadruped", "andrews"])
def test_the_rank_is_that_of_the_dense_rows_off_the_first_position(name):
    """An oracle that knows neither groups nor order: the singular values of all rows."""
    from tests.oracle.constrained import constraint_rows

    mech = mechanism(name)
    q, v = mech.home()
    q, v, _ = mech.assemble(q + 0.05 * (np.abs(q) < 0.4), v)
    from pgraph_core.paper import Operators

    J, _ = constraint_rows(Operators(mech.model, mech.topology, q), mech.model.constraints)
    values = np.linalg.svd(J @ np.linalg.inv(np.linalg.cholesky(mech.mass_matrix(q))).T)[1]
    assert mech.mobility(q).rank == int((values > 1e-7 * values[0]).sum())


def test_a_flat_parallelogram_has_two_ways_to_go():
    mech = mechanism("four_bar")
    report = mech.mobility(FLAT, ALONG)
    assert (report.rank, report.dof, report.extra, report.finite) == (1, 2, 1, True)
    assert [str(row) for row in report.redundant if row.only_here] == [
        "translation along x of constraint 'loop'"
    ]
    assert report.joints == ("left crank", "coupler", "right crank")
    taken = np.array(report.branches[report.branch])
    assert abs(taken @ ALONG) == pytest.approx(3.0, abs=0.05)
    assert mech.mobility(FLAT).branch == -1
    assert str(report).splitlines()[-2].startswith("  branch")
    assert "(the velocity takes it)" in str(report)


def test_stretched_rods_shake_but_do_not_move():
    """Two rods in line between pins two rods apart: a way to move that leads nowhere."""
    model = windows(1)
    rods = (like(model.body("coupler 0"), name="a", parent="ground", link=(0, 0, 0)),)
    rods += (like(rods[0], name="b", parent="a", link=(1, 0, 0)),)
    pin = pg.Constraint(name="pin", body="b", point=(1, 0, 0))
    report = pg.Mechanism(pg.Model(up="y", bodies=rods, constraints=(pin,))).mobility()
    assert (report.dof, report.extra, report.finite) == (1, 1, False)
    assert "it is locked" in str(report).splitlines()[0]
    assert "the parts can shake, not move" in str(report)


def test_the_report_is_plain_data_too():
    data = mechanism("slider_crank").mobility().to_dict()
    again = json.loads(json.dumps(data))
    assert again["redundant"][0]["direction"] == "translation along z"
    assert again["redundant"][0]["bodies"] == ["rod", "slider"]
    assert again["text"].splitlines()[1].startswith("3 of 5 rows are redundant")


def test_every_row_of_a_constraint_said_twice_is_redundant():
    model = windows(1)
    twice = model.replace(
        constraints=(*model.constraints, like(model.constraints[0], name="again"))
    )
    report = pg.Mechanism(twice).mobility()
    assert report.rank == 2
    assert [row.constraint for row in report.redundant] == ["loop 0", "again", "again", "again"]


def test_fifty_loops_that_share_their_cranks_leave_one_way_to_move():
    report = pg.Mechanism(windows(50)).mobility()
    assert (report.tree, report.rows, report.rank, report.dof) == (101, 150, 100, 1)
    assert [row.constraint for row in report.redundant] == [f"loop {i}" for i in range(50)]
    assert {row.direction for row in report.redundant} == {"translation along z"}


def test_a_closed_chain_of_220_links_is_counted():
    """A regular polygon: two of the three rows of its pin are all that a plane asks."""
    n = 220
    turn, names = 2 * np.pi / n, [f"link {i}" for i in range(n)]
    parents = ["ground", *names]
    places = [(0.0, 0.0, 0.0)] + [(1.0, 0.0, 0.0)] * (n - 1)
    links = [
        pg.Body(name=name, parent=parent, link=place, q=(turn,))
        for name, parent, place in zip(names, parents, places)
    ]
    pin = pg.Constraint(name="pin", body=names[-1], point=(1, 0, 0), other_point=(0, 0, 0))
    report = pg.Mechanism(pg.Model(bodies=tuple(links), constraints=(pin,))).mobility()
    assert (report.rows, report.rank, report.dof, report.extra) == (3, 2, n - 2, 0)
    assert [str(row) for row in report.redundant] == ["translation along z of constraint 'pin'"]


# -- assembly ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "bricard", "andrews", "quadruped"])
@pytest.mark.parametrize("size", [1e-3, 0.1, 0.6])
def test_a_disturbed_state_is_assembled(name, size):
    """Nearby, and so far off that whole steps of the projection diverge."""
    if (name, size) == ("quadruped", 0.6):
        size = 0.3  # its feet stand on a fold of what the legs can reach: slow from afar
    mech = mechanism(name)
    q, v = mech.home()
    random = np.random.default_rng(3)
    new_q, new_v, report = mech.assemble(
        q + size * random.normal(size=mech.nq), v + random.normal(size=mech.nv)
    )
    again_q, again_v, nothing = mech.assemble(new_q, new_v)
    assert np.abs(again_q - new_q).max() < 1e-9
    assert np.abs(again_v - new_v).max() < 1e-9
    assert report.moved > 0
    assert report.joint in mech.names
    assert not nothing.notable
    assert str(nothing) == "the state meets its constraints"


def test_the_report_names_the_joint_that_moved_most():
    mech = mechanism("four_bar")
    q, v, report = mech.assemble(np.array([0.0, 0.0, 0.3]), np.array([-1.0, 1.0, -1.0]))
    assert report.joint == "right crank"
    assert report.turned
    assert str(report).startswith("joints were moved by up to 0.")
    done = pg.simulate(mech, np.array([0.0, 0.0, 0.3]), v, t_end=0.01)
    assert done.status.ok
    assert done.notices[0].startswith("at the start joints were moved by up to 0.")
    assert "('right crank') and velocities were changed" in done.notices[0]


def test_a_loop_that_cannot_close_is_named_with_its_gap():
    """Rods of 1, 1 and 1 m between pins 4 m apart: 1 m is missing."""
    model = windows(1).edit("crank 1", link=(4.0, 0, 0))
    mech = pg.Mechanism(model)
    said = (
        "constraint 'loop 0': cannot be met: it misses by 1 m at the nearest position that the "
        "joints allow; move its points or change a length"
    )
    with pytest.raises(pg.InputError) as refused:
        mech.assemble()
    assert str(refused.value) == said
    done = pg.simulate(mech, t_end=0.1)
    assert done.message == f"the constraints cannot all be met: {said}"
    with pytest.raises(pg.InputError) as refused:
        mech.mobility()
    assert str(refused.value) == said


def test_of_what_contradicts_one_alone_is_assembled():
    rod = windows(1).body("crank 0")
    held = [
        pg.Constraint(
            name=name, kind="motion", body="crank 0", q_of_t={"t": (0, 1), "value": (x, x)}
        )
        for name, x in (("left", 0.2), ("right", 0.5))
    ]
    mech = pg.Mechanism(pg.Model(up="y", bodies=(rod,), constraints=tuple(held)))
    q, _, _ = mech.assemble(active=["right"])
    assert q == pytest.approx([0.5])


def test_an_unknown_constraint_is_refused():
    with pytest.raises(pg.InputError) as refused:
        mechanism("four_bar").assemble(active=["lop"])
    assert str(refused.value) == (
        "assemble, active: no constraint is named 'lop'; choose one of loop"
    )


# -- long runs -----------------------------------------------------------------------------------


def test_a_four_bar_does_not_drift_in_a_minute():
    done = pg.simulate(mechanism("four_bar"), scenario="turn", t_end=60.0, frames=61)
    assert done.status.ok
    assert done.constraint_drift.max() < 1e-9
    assert done.energy_drift < 1e-6


@pytest.mark.nightly
def test_a_standing_quadruped_does_not_creep_in_a_minute():
    done = pg.simulate(mechanism("quadruped"), scenario="stand", t_end=60.0, frames=61)
    assert done.status.ok
    assert done.constraint_drift.max() < 1e-9
    assert np.abs(done.q[-1] - done.q[30]).max() < 1e-9


def test_redundant_rows_are_said_once_at_the_start():
    said = pg.simulate(mechanism("slider_crank"), scenario="turn", t_end=0.01).notices
    assert said == (
        "3 of 5 constraint rows are redundant at the start: translation along z of constraint "
        "'pin', rotation about x of constraint 'pin', rotation about y of constraint 'pin'; the "
        "forces are those of least norm",
    )
    assert pg.simulate(mechanism("rolling_disc"), t_end=0.01).notices == ()


def test_redundant_rows_are_said_where_something_touches_too():
    model = pg.Model.load(pgraph_models.path("slider_crank"))
    soft = pg.Contact(name="floor", body="rod", law="soft", points=((0, 0, 0),))
    for contact in (soft, like(soft, law="complementarity")):
        mech = pg.Mechanism(model.replace(contacts=(contact,)))
        said = pg.simulate(mech, scenario="turn", t_end=0.01, method="auto").notices
        assert said[0].startswith("3 of 5 constraint rows are redundant at the start: ")


# -- singular positions on the way ---------------------------------------------------------------

MORE = (
    "translation along x of constraint 'loop' says nothing new there, so that more than one "
    "motion leads on; it took the one that its velocity or rounding was on, and its error "
    "estimate may be too low"
)


@pytest.mark.parametrize(
    "how",
    [
        {"method": "rk4", "step": 1e-3},
        {"method": "rk4", "step": 2e-2},
        {"method": "dop853", "rtol": 1e-8},
        {"method": "radau5", "rtol": 1e-6},
        {"method": "semi_implicit_euler", "step": 1e-3},
    ],
)
def test_a_singular_position_on_the_way_is_said_with_its_time(how):
    """The parallelogram is flat where its crank lies along x, whatever the steps hit."""
    mech = mechanism("four_bar")
    done = pg.simulate(mech, scenario="turn", t_end=1.0, frames=10001, **how)
    when = np.interp(np.pi / 2, np.abs(done.q[:, 0]), done.t)
    said = done.notices[1]
    assert said.startswith(f"at t = {when:.3g}")
    assert "s the run passed a singular position or close by one: " in said
    assert said.endswith(MORE)


def test_singular_positions_are_counted():
    said = pg.simulate(mechanism("four_bar"), scenario="turn", t_end=3.0).notices
    assert "passed a singular position, the first of 3, or close by one" in said[1]


def test_a_run_that_begins_at_a_singular_position_says_so():
    done = pg.simulate(mechanism("four_bar"), FLAT, np.zeros(3), step=1e-3)
    assert done.notices[1] == f"the run began at a singular position: {MORE}"


@pytest.mark.parametrize("name", ["bricard", "quadruped", "slider_crank", "andrews"])
def test_positions_that_are_regular_are_not_called_singular(name):
    """Redundant all the way, or nowhere; rows that take each other's place are sorted out."""
    mech = mechanism(name)
    for scenario in (None, *(s.name for s in mech.model.scenarios)):
        said = pg.simulate(mech, scenario=scenario).notices
        assert not any("singular" in notice for notice in said)


def test_a_crank_that_turns_back_before_the_flat_position_passes_none():
    mech = mechanism("four_bar")
    v = np.array([-1.0, 1.0, -1.0])
    done = pg.simulate(mech, FLAT + 0.1 * ALONG, -1e-3 * v, t_end=0.5, method="rk4", step=1e-3)
    assert not any("singular" in notice for notice in done.notices)


def test_a_constraint_that_no_joint_can_change_leaves_the_motion_as_it_is():
    """All rows of Ω are zero: a distance between two points that move together."""
    bodies = (
        pg.Body(name="upper", tip=(0.5, 0, 0), axes=(0, 1, 0)),
        pg.Body(name="lower", parent="upper", link=(0.5, 0, 0), tip=(0.3, 0, 0), axes=(0, 1, 0)),
        pg.Body(name="pin", parent="upper", link=(0.5, 0, 0), joint="weld"),
    )
    rod = pg.Distance(
        name="rod", body="lower", other="pin", point=(0.3, 0, 0), other_point=(0, 0, 0), length=0.3
    )
    free = pg.simulate(pg.Model(bodies=bodies), t_end=0.2)
    tied = pg.simulate(pg.Model(bodies=bodies, constraints=(rod,)), t_end=0.2)
    assert tied.status.ok
    np.testing.assert_allclose(tied.q[-1], free.q[-1], atol=1e-9)
    assert abs(tied.constraint_force["rod"]).max() == 0.0
    assert any("redundant" in notice and "rod" in notice for notice in tied.notices)
