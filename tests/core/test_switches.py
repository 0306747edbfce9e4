"""Constraints that go on and off during a run."""

import re
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import built_in

METHODS = [
    {"method": "rk4", "step": 1e-3},
    {"method": "semi_implicit_euler", "step": 1e-3},
    {"method": "dop853", "rtol": 1e-11},
    {"method": "radau5", "rtol": 1e-10},
]
FOOT = "left_hind_paw"


def pair(kind: Any, **fields: Any) -> pg.Mechanism:
    q = ((0, 0, 0, 1, 0, 0, 0), (1, 0, 0, 1, 0, 0, 0))
    v = ((0.3, 0.2, -0.5, 0, 1, 0), (-0.4, 0.1, 1.0, 0, -1, 0.5))
    bodies = tuple(
        pg.Body(
            name=name, joint="free", mass=m, inertia=np.diag((m, 2 * m, 2.5 * m)), q=q[i], v=v[i]
        )
        for i, (name, m) in enumerate((("a", 1.0), ("b", 3.0)))
    )
    tie = pg.Constraint(name="tie", kind=kind, body="b", other="a", active=False, **fields)
    return pg.Mechanism(pg.Model(bodies=bodies, constraints=(tie,), gravity=(0, 0, 0)))


@pytest.mark.parametrize("how", METHODS, ids=lambda how: how["method"])
def test_a_foot_that_is_released_is_two_runs_in_one(how):
    mech = built_in("quadruped")
    names = [c.name for c in mech.model.constraints if c.name != FOOT]
    rest = pg.Mechanism(
        mech.model.replace(scenarios=(pg.Scenario(name="rest", constraints=names, t_end=0.15),))
    )
    done = pg.simulate(mech, t_end=0.15, frames=16, switches=((0.1, FOOT, False),), **how)
    first = pg.simulate(mech, t_end=0.1, frames=11, **how)
    last = first.q[-1], first.v[-1]
    then = pg.simulate(rest, *last, t_start=0.1, t_end=0.15, frames=6, scenario="rest", **how)
    whole = pg.joined((first, then))
    assert np.allclose(done.t, whole.t, atol=1e-12)
    assert np.abs(done.q - whole.q).max() < 1e-10
    assert np.abs(done.v - whole.v).max() < 1e-8
    assert np.all(done.constraint_force[FOOT][:10, 4] != 0.0)
    assert np.all(done.constraint_force[FOOT][10:] == 0.0)
    (event,) = done.events
    assert (event.t, event.contact) == (pytest.approx(0.1), FOOT)
    assert (event.before, event.after) == ("on", "off")


@pytest.mark.parametrize(
    ("kind", "how", "exact"),
    [
        ("point", {"method": "rk4", "step": 1e-3}, 1e-5),
        ("weld", {"method": "dop853", "rtol": 1e-11}, 1e-9),
        ("distance", {"method": "radau5", "rtol": 1e-10}, 1e-9),
        ("distance", {"method": "semi_implicit_euler", "step": 1e-3}, 2e-2),
        ("weld", {"method": "moreau_jean"}, 2e-2),
    ],
)
def test_switching_on_keeps_momentum_and_loses_the_energy_in_the_ledger(kind, how, exact):
    ends = {"other_point": (0, 0, 0)} if kind == "distance" else {}
    mech = pair(kind, point=(-0.5, 0, 0), **ends)
    if how["method"] == "moreau_jean":
        far = pg.Contact(name="far", body="a", points=((0, 0, 1e3),))
        mech = pg.Mechanism(mech.model.replace(contacts=(far,)))
    times = np.linspace(0.0, 0.2, 21)
    done = pg.simulate(mech, t_eval=times, t_end=0.2, switches=((0.1, "tie", True),), **how)
    assert done.status.ok, done.message
    assert np.array_equal(done.t, times)
    momenta = np.array([mech.momentum(q, v) for q, v in zip(done.q, done.v)])
    assert np.abs(momenta - momenta[0]).max() < exact
    before, after = done.kinetic_energy[9], done.kinetic_energy[10]
    assert after < 0.95 * before
    event = done.events[-1]
    assert (event.before, event.after) == ("off", "on")
    lost = max(float(word) for word in re.findall(r"[0-9.]+(?:e-?[0-9]+)?", event.cause))
    assert lost == pytest.approx(before - after, rel=2e-2)
    assert done.energy_drift < exact
    assert done.constraint_drift[10:].max() < 1e-9
    assert np.abs(done.constraint_force["tie"][:10]).max() == 0.0


def test_a_weld_keeps_the_pose_at_which_it_goes_on():
    mech = pair("weld", point=(0, 0, 0))
    done = pg.simulate(mech, t_end=0.3, frames=31, rtol=1e-11, switches=((0.1, "tie", True),))
    poses = [mech.poses(q) for q in done.q]
    seen = np.array([R[0].T @ (p[1] - p[0]) for p, R in poses])
    assert np.ptp(seen[10:], axis=0).max() < 1e-9
    assert np.ptp(seen[:11], axis=0).max() > 0.1
    assert done.notices == ()
    turned = np.array([R[0].T @ R[1] for _, R in poses])
    assert np.ptp(turned[10:], axis=0).max() < 1e-9


def test_runs_with_contacts_switch_constraints():
    rod = pg.Body(
        name="rod", joint="free", inertia=np.diag((0.1, 0.1, 0.01)), q=(0, 0, 0.5, 1, 0, 0, 0)
    )
    hold = pg.Constraint(name="hold", body="rod", point=(0, 0, 0.5))
    foot = pg.Contact(name="foot", body="rod", points=((0, 0, -0.4),), friction=0.5)
    mech = pg.Mechanism(pg.Model(bodies=(rod,), constraints=(hold,), contacts=(foot,)))
    switches = ((0.1, "hold", False), (0.4, "hold", True))
    for method in ("rk4", "moreau_jean"):
        done = pg.simulate(mech, method=method, t_end=0.5, step=1e-3, switches=switches)
        assert done.status.ok, done.message
        still = np.abs(done.v[done.t < 0.1]).max()
        assert still < 1e-9
        hit = 0.1 + np.sqrt(0.2 / 9.81)
        assert abs(done.t[np.argmax(done.q[:, 2] < 0.4 + 1e-3)] - hit) < 5e-3
        assert done.q[-1, 2] == pytest.approx(0.4, abs=2e-3)
        assert [e.after for e in done.events if e.contact == "hold"] == ["off", "on"]
        assert done.energy_drift < 1e-2


def test_an_argument_replaces_the_switches_of_a_scenario():
    """A switch at the start belongs to the initial state."""
    model = built_in("quadruped").model
    drop = pg.Scenario(name="drop", switches=({"t": 0.05, "constraint": FOOT, "active": False},))
    model = pg.Model.from_json(model.replace(scenarios=(drop,)).to_json())
    mech = pg.Mechanism(model)
    assert len(pg.simulate(mech, scenario="drop", t_end=0.1).events) == 1
    assert pg.simulate(mech, scenario="drop", t_end=0.05).events == ()
    assert pg.simulate(mech, scenario="drop", t_end=0.1, switches=()).events == ()
    assert model.remove(FOOT).scenarios[0].switches == ()
    mech = pair("point", point=(-0.5, 0, 0))
    done = pg.simulate(mech, t_end=0.01, switches=((0.0, "tie", True),))
    assert done.events == ()
    assert done.constraint_drift.max() < 1e-9


def test_a_constraint_does_not_jump_to_a_given_place():
    mech = pair("point", point=(-0.5, 0, 0), other_point=(5.0, 0, 0))
    done = pg.simulate(mech, t_end=0.2, switches=((0.1, "tie", True),))
    assert done.status is pg.Status.CANNOT_CLOSE
    assert done.t[-1] == pytest.approx(0.1)
    assert "'tie'" in done.message
    assert "other_point" in done.message


def test_three_feet_with_parallel_hinges_block_the_roll_to_second_order_only():
    """With a foot that may slide across, the run goes on."""
    model, off = built_in("quadruped").model, ((0.01, "left_front_paw", False),)
    given = {"scenario": "stance", "switches": off, "t_end": 0.1, "estimate": False}
    run = pg.simulate(model, **given)
    assert run.status is pg.Status.CANNOT_CLOSE
    for part in ("'left_hind_paw'", "'right_hind_paw'", "'pelvis'", "second"):
        assert part in run.message
    foot = next(c for c in model.constraints if c.name == "right_hind_paw")
    foot = pg.Constraint(
        name=foot.name, kind="line", body=foot.body, point=foot.point, other_axis=(0, 0, 1)
    )
    held = tuple(foot if c.name == foot.name else c for c in model.constraints)
    run = pg.simulate(model.replace(constraints=held), **given)
    assert run.status.ok, run.message


def test_a_mechanism_that_is_torn_is_not_blocked_to_second_order():
    rod = pg.Body(name="rod", joint="prismatic", axes=((1.0, 0.0, 0.0),), mass=1.0)
    pull = pg.Motion(name="pull", body="rod", q_of_t=pg.Polynomial(coefficients=(0.0, 1.0)))
    stay = pg.Constraint(name="stay", kind="point", body="rod")
    model = pg.Model(bodies=(rod,), constraints=(pull, stay))
    run = pg.simulate(model, t_end=0.1, step=1e-3, estimate=False)
    assert not run.status.ok
    assert "second" not in run.message
