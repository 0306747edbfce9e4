"""Motions that constraints block to second order only: runs that name them."""

from __future__ import annotations

import pgraph_core as pg
import pgraph_models

OFF = ((0.1, "left_front_paw", False),)


def quadruped():
    return pg.Model.load(pgraph_models.path("quadruped"))


def test_three_feet_of_a_quadruped_with_parallel_hinges_say_what_blocks_them():
    """Its roll is free to first order; with a foot that may slide across, the run goes on."""
    model = quadruped()
    run = pg.simulate(pg.Mechanism(model), scenario="stance", switches=OFF, estimate=False)
    assert run.status is pg.Status.CANNOT_CLOSE
    assert (
        "constraints 'left_hind_paw' and 'right_hind_paw' leave 'pelvis' free to move to first "
        "order and block it to second, which no finite force does: they are off by 6.6e-08 m where "
        "their rows say nothing new. Give one of them a kind with fewer rows (line, plane, "
        "distance), or a joint the freedom that is missing; with stabilise=None the run goes on "
        "and the gap stands in constraint_drift"
    ) in run.message
    foot = pg.Constraint(
        name="right_hind_paw",
        kind="line",
        body="right_hind_paw",
        point=next(c.point for c in model.constraints if c.name == "right_hind_paw"),
        other_axis=(0.0, 0.0, 1.0),
    )
    held = tuple(foot if c.name == foot.name else c for c in model.constraints)
    mech = pg.Mechanism(model.replace(constraints=held))
    run = pg.simulate(mech, scenario="stance", switches=OFF, estimate=False)
    assert run.status.ok, run.message


def test_a_mechanism_that_is_torn_blocks_nothing():
    """Two ends that are pulled apart are off by more than a motion of second order makes."""
    rod = pg.Body(name="rod", joint="prismatic", axes=((1.0, 0.0, 0.0),), mass=1.0)
    follow = pg.Constraint(
        name="pull", kind="motion", body="rod", q_of_t=pg.Polynomial(coefficients=(0.0, 1.0))
    )
    stay = pg.Constraint(name="stay", kind="point", body="rod")
    mech = pg.Mechanism(pg.Model(bodies=(rod,), constraints=(follow, stay)))
    run = pg.simulate(mech, t_end=0.1, step=1e-3, estimate=False)
    assert not run.status.ok
    assert "to second" not in run.message
