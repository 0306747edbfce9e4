"""A loop cut elsewhere is the same mechanism: accelerations, motions, forces that act."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.rotation import unit
from tests.refusals import holds, refusal

NAMES = ("a", "b", "c", "d", "e")


def ring(joints: Any, closing: Any, branch: int, cuts: tuple[str, ...]) -> pg.Model:
    """Bodies in a ring, cut between the ends of its two sides; assembled, with a velocity.

    The bodies before `branch` hang on the ground one after the other, the rest too. A child that
    is no part of the ring, a spring, a wrench, a motor and a gear hang on what is turned around.
    """
    random = np.random.default_rng(len(joints) + branch)
    bodies = []
    for i, joint in enumerate(joints):
        moments = random.uniform(0.2, 0.3, 3)
        parent = "ground" if i in (0, branch) else NAMES[i - 1]
        axis, fields = tuple(random.normal(size=3).tolist()), dict[str, Any]()
        if joint not in ("spherical", "weld"):
            fields["axes"] = (axis,) * (2 if joint == "cylindrical" else 1)
        if joint == "revolute" and NAMES[i] not in cuts:
            fields |= {"damping": 0.1, "stiffness": 2.0, "rest": 0.1, "armature": 0.05}
        bodies.append(
            pg.Body(
                name=NAMES[i],
                parent=parent,
                joint=joint,
                link=vector(random, 0.5),
                rotation=unit(random.normal(size=4).tolist()),
                mass=float(random.uniform(0.5, 2.0)),
                com=vector(random, 0.3),
                inertia=matrix(*moments),
                tip=vector(random, 1.0),
                shape=pg.Shape(kind="sphere", radius=0.1, position=(0.1, 0, 0)),
                **fields,
            )
        )
    bodies.append(
        pg.Body(name="rider", parent="b", link=(0.1, 0.2, 0.3), inertia=matrix(1, 1, 1), mass=0.5)
    )
    last, first = NAMES[len(joints) - 1], NAMES[branch - 1]
    loop = pg.Constraint(
        name="loop", kind=closing, body=first, other=last, point=vector(random, 0.3)
    )
    forces = (
        pg.Force(name="spring", kind="spring", body="a", other="b", stiffness=30.0, rest=0.1),
        pg.Force(name="push", kind="wrench", body="b", force=(1.0, 2.0, -1.0), frame="body"),
    )
    model = pg.Model(bodies=tuple(bodies), constraints=(loop,), forces=forces)
    mech = pg.Mechanism(model)
    q, v = mech.home()
    q, v, _ = mech.assemble(q, v + random.normal(size=mech.nv))
    return at(model, mech, q, v)


def vector(random: np.random.Generator, size: float) -> Any:
    return tuple((random.normal(size=3) * size).tolist())


def matrix(*moments: float) -> Any:
    return np.diag(moments)


def at(model: pg.Model, mech: pg.Mechanism, q: np.ndarray, v: np.ndarray) -> pg.Model:
    """The model with this initial state."""
    bodies = []
    for body in model.bodies:
        if body.name in mech.joints:  # not a weld
            place = mech.joints[body.name]
            body = body.model_copy(update={"q": tuple(q[place.q]), "v": tuple(v[place.v])})
        bodies.append(body)
    return model.replace(bodies=tuple(bodies))


def motion(model: pg.Model, **how: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, pg.Result]:
    """Centres of mass, rotations and energies over a run."""
    mech = pg.Mechanism(model)
    done = pg.simulate(mech, **how)
    assert done.status.ok, done.message
    places, turns = [], []
    for q in done.q:
        poses = {name: mech.pose(q, name) for name in sorted(mech.names)}
        places.append([x + R @ model.body(k).com for k, (x, R) in poses.items()])
        turns.append([R for _, R in poses.values()])
    return np.array(places), np.array(turns), done.energy, done


R, S, P, C, W = "revolute", "spherical", "prismatic", "cylindrical", "weld"
RINGS = [
    ((R, S, R), "point", 2, ("a", "b", "c")),
    ((R, S, S), "revolute", 2, ("b", "c")),
    ((R, R, S, R), "point", 3, ("a", "b", "c", "d")),
    ((R, R, C, S), "point", 3, ("a", "c", "d")),
    ((R, W, P, S, R), "point", 3, ("b", "c", "d")),
    ((R, R, R, S, R), "cylindrical", 3, ("a", "c")),
    ((R, S, S, S, R), "revolute", 4, ("b", "d", "e")),
]


@pytest.mark.parametrize(("joints", "closing", "branch", "cuts"), RINGS)
def test_a_loop_cut_elsewhere_moves_alike(joints, closing, branch, cuts):
    how = {"t_end": 0.1, "method": "dop853", "rtol": 1e-12, "frames": 5}
    model = ring(joints, closing, branch, cuts)
    places, turns, energy, done = motion(model, **how)
    assert np.abs(places[-1] - places[0]).max() > 1e-3
    mech = pg.Mechanism(model)
    expected = {k: mech.pose(done.q[0], k)[1] for k in mech.names}
    for name in cuts:
        other = model.cut_at(name)
        assert [c.body for c in other.constraints] == [name]
        again = motion(other, **how)
        assert np.abs(again[0][0] - places[0]).max() < 1e-10
        assert np.abs(again[0] - places).max() < 1e-9
        assert np.abs(again[1] - turns).max() < 1e-9
        assert np.abs(np.ptp(again[2] - energy)) < 1e-9
        assert pg.Mechanism(other).mobility().dof == mech.mobility().dof
        assert set(expected) == set(pg.Mechanism(other).names)


def test_the_four_bar_is_cut_anywhere_in_its_scenario_and_back():
    """Its rods given a little inertia about themselves: a point is a ball as a joint."""
    model = pg.Model.load(pgraph_models.path("four_bar"))
    for name in ("left crank", "coupler", "right crank"):
        model = model.edit(name, inertia=matrix(0.05, 0.06, 0.07))
    how = {"scenario": "turn", "t_end": 0.5, "method": "dop853", "rtol": 1e-12, "frames": 6}
    places = motion(model, **how)[0]
    for name in ("left crank", "coupler", "right crank"):
        other = model.cut_at(name)
        assert np.abs(motion(other, **how)[0] - places).max() < 1e-9
        assert other.constraints[0].name in other.notices[-1]
        back = other.cut_at("coupler" if name != "coupler" else "right crank")
        assert np.abs(motion(back, **how)[0] - places).max() < 1e-9


def test_a_motor_and_a_clutch_follow_their_joint():
    """A motor and a clutch on joints that are turned around."""
    model = ring((R,) * 5, "point", 4, ("b",))
    motor = pg.Force(name="motor", body="c", torque=0.7)
    model = model.replace(forces=(*model.forces, motor))
    how = {"t_end": 0.05, "method": "dop853", "rtol": 1e-12, "frames": 3}
    other = model.cut_at("b")
    assert {f.name: f.body for f in other.forces}["motor"] == "b"
    assert np.abs(motion(other, **how)[0] - motion(model, **how)[0]).max() < 1e-9
    clutch = pg.Velocity(name="clutch", coefficients={"c": 1.0, "d": 0.5}, active=False)
    tied = model.replace(constraints=(*model.constraints, clutch)).cut_at("b").constraints[1]
    assert tied.coefficients == {"b": (1.0,), "c": (0.5,)}


def test_a_loop_that_cannot_be_cut_is_refused():
    model = ring((R, R, R), "revolute", 2, ("a", "b"))
    motor = pg.Motor(name="motor", body="a", torque=0.7)
    loose = model.constraints[0].model_copy(update={"other_point": (1.0, 2.0, 3.0)})
    for cut, facts in (
        (lambda: model.cut_at("c"), ("body 'c'", "spring", "armature", "limits")),
        (lambda: model.replace(constraints=()).cut_at("a"), ("body 'a', loop", "no loop")),
        (lambda: model.cut_at("a", loop="lop"), ("body 'a', loop", "loop; given 'lop'")),
        (lambda: model.replace(forces=(motor,)).cut_at("a"), ("body 'a'", "force 'motor'")),
        (lambda: model.replace(constraints=(loose,)).cut_at("a"), ("initial state",)),
    ):
        holds(str(refusal(cut, pg.ModelError)), *facts)
