"""Contacts of a model as tables: who touches what, where, and how hard if nothing is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_core.contact.solids import search_space, terrain_of
from pgraph_core.contact.tables import damping_ratio, loss_of_impact
from pgraph_core.contact.tables import tables as tables_of
from pgraph_core.engine import layout as at
from pgraph_core.engine.contact import search as kernels
from pgraph_core.engine.records import CONTACT, PENALTY, POSE, RIGID, SOFT, table

BALL = {"kind": "sphere", "radius": 0.1}


def tables(model):
    mech = pg.Mechanism(model)
    return mech, tables_of(mech.packed, model.contacts)


def heap(count, *contacts):
    bodies = [
        pg.Body(name=f"b{k}", joint="free", link=(0.15 * k, 0, 0.05), shape=BALL, mass=2.0)
        for k in range(count)
    ]
    return pg.Model(bodies=tuple(bodies), contacts=contacts)


def found(mech, t, q):
    """(gap, shape A, shape B, contact) of everything within 1 m."""
    system = mech.packed.system
    poses = table(POSE, len(t.geometry.shapes))
    position, rotation = mech.poses(q)
    for shape, place in zip(t.geometry.shapes, poses):
        body = shape["body"]
        if body == 0:  # a step of the ground
            place["position"], place["rotation"] = shape["position"], shape["rotation"]
            continue
        assert shape["row"] == system.bodies_i[body, at.ROW]
        home = system.bodies_f[body, at.HOME : at.HOME + 9].reshape(3, 3)
        turn = rotation[body - 1] @ home.T
        offset = system.bodies_f[body, at.OFFSET : at.OFFSET + 3]
        place["position"] = position[body - 1] - turn @ offset + turn @ shape["position"]
        place["rotation"] = (turn @ shape["rotation"].reshape(3, 3)).ravel()
    out = table(CONTACT, 50)
    room = search_space(t.geometry, len(t.candidates.members))
    n = kernels.contacts(t.geometry, t.ground, t.candidates, poses, room, 0.0, out)
    whose = (out[:n][name].tolist() for name in ("shape_a", "shape_b", "pair"))
    return [(round(g, 12), *w) for g, *w in zip(out["gap"][:n].tolist(), *whose)]


def test_a_heap_takes_two_lines(monkeypatch):
    monkeypatch.setattr("pgraph_core.contact.tables.CROWD", 2)  # of more, all are one pair
    floor, every = (pg.Contact(name=n, body="*", other=o) for n, o in (("f", "ground"), ("h", "*")))
    mech, t = tables(heap(3, floor, every))
    assert t.candidates.on_ground.tolist() == [
        (0, 0),
        (1, 1),
        (2, 2),
    ]  # a touch for each on the ground
    assert t.candidates.members.tolist() == [(0, 3), (1, 3), (2, 3)]
    assert [x.name for x in t.touches] == ["f[b0]", "f[b1]", "f[b2]", "h"]
    q, _ = mech.home()
    gaps = found(mech, t, q)
    assert sorted(g for g, *_ in gaps) == [-0.05] * 5
    assert {tuple(sorted(x[1:3])) for x in gaps if x[3] == 3} == {(0, 1), (1, 2)}


@pytest.mark.parametrize("crowd", [0, 20])
def test_bodies_that_a_joint_ties_do_not_touch_as_members_of_all(crowd, monkeypatch):
    monkeypatch.setattr("pgraph_core.contact.tables.CROWD", crowd)
    rod = {"kind": "box", "size": (0.2, 0.1, 0.1)}
    model = pg.Model.serial(3)
    for name in model.row:
        model = model.edit(name, shape=rod)
    model = model.edit("3", joint="weld")
    every, one, named = (
        pg.Contact(name="all", body="*", other="*"),
        pg.Contact(name="one", body="1", other="*"),
        pg.Contact(name="named", body="1", other="2"),
    )
    _, t = tables(model.replace(contacts=(every, one, named)))
    if crowd:
        assert [x.name for x in t.touches] == ["all[1, 3]", "one[3]", "named"]
        assert t.candidates.pairs.tolist() == [(0, 1, 0), (0, 1, 1), (0, 2, 2)]
    else:
        assert t.candidates.apart.tolist() == [(1, 2), (2, 3)]
        assert t.candidates.pairs.tolist() == [(0, 2, 1), (0, 1, 2)]


def test_points_touch_where_the_body_has_them():
    foot = pg.Contact(name="foot", body="1", points=((0.2, 0, 0), (0.2, 0, -0.1)))
    model = pg.Model.serial(1).edit("1", rotation=(0.8, 0.6, 0, 0)).replace(contacts=(foot,))
    mech, t = tables(model)
    q = np.array([0.4])
    gaps = found(mech, t, q)
    position, rotation = mech.pose(q, "1")
    heights = [(position + rotation @ np.array(p))[2] for p in foot.points]
    assert sorted(g for g, *_ in gaps) == pytest.approx(sorted(h for h in heights if h < 0))


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_steps_lie_where_the_description_says(up):
    step = pg.Step(low=(1, 10), high=(2, 20), height=0.3)
    level = [k for k in range(3) if "xyz"[k] != up]
    mech, t = tables(pg.Model(up=up, bodies=(pg.Body(name="a", joint="free", shape=BALL),),
                              contacts=(pg.Contact(name="c", body="a"),),
                              ground=pg.Ground(steps=(step,))))  # fmt: skip
    q, _ = mech.home()
    place = np.zeros(3)
    place[level], place["xyz".index(up)] = (1.5, 15.0), 0.35
    q[:3] = place
    assert [g for g, *_ in found(mech, t, q)] == [-0.05]
    q[:3][level] = (15.0, 1.5)
    assert not found(mech, t, q)
    assert len(terrain_of(mech.model).ground.patches) == 1


def rebound(force):
    """Speed of a unit mass after an impact at 1 m/s on a force of depth and speed."""
    over = lambda t, y: force(*y) - 1e-12  # noqa: E731
    over.terminal, over.direction = True, -1
    start = [1e-6, 1.0]
    found = solve_ivp(lambda t, y: (y[1], -force(*y)), (0, 100), start, events=over,
                      method="Radau", rtol=1e-9, atol=1e-12)  # fmt: skip
    return -found.y[1, -1]


def test_what_a_law_leaves_out_follows_from_masses_and_restitution():
    """A body of 2 kg rests 1e-4 of its size deep; a linear impact gives the restitution back."""
    contacts = (
        pg.Contact(name="p", body="b0", law="penalty", restitution=0.4),
        pg.Contact(name="s", body="b0", law="soft", stiffness=7.0, friction=0.1),
        pg.Contact(name="c", body="*"),
    )
    model = heap(1, *contacts).replace(ground={"friction": 0.9, "restitution": 0.2})
    _, t = tables(model)
    size = np.sqrt(0.015 / 2)
    k = 2 * 9.81 / (1e-4 * size)
    zeta = damping_ratio(0.4)
    assert rebound(lambda x, u: max(x + 2 * zeta * u, 0.0)) == pytest.approx(0.4, abs=1e-6)
    assert t.laws[0].item()[:5] == pytest.approx((PENALTY, 0.9, 0.4, k, 0.0))
    assert t.laws[0]["loss"] == pytest.approx(2 * zeta)
    loss = loss_of_impact(0.2)

    def soft(x, u):
        x = max(x, 0.0)
        return x**1.5 * (1 + loss * u / np.sqrt(u**2 + 0.8 * x**2.5))

    assert rebound(soft) == pytest.approx(0.2, abs=1e-6)
    assert t.laws[1].item()[:5] == pytest.approx((SOFT, 0.1, 0.2, 7.0, 0.0))
    assert t.laws[1]["loss"] == pytest.approx(loss)
    assert t.laws[2].item()[:3] == pytest.approx((RIGID, 0.9, 0.2))


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize("mass", [1.0, 1e-3, 1e3])
def test_what_is_welded_to_the_ground_moves_no_more_than_the_ground(law, mass):
    """A wall of any mass, on a base that is welded too: what a law leaves out is as of a floor."""
    base = pg.Body(name="base", joint="weld", mass=mass)
    wall = pg.Body(name="wall", parent="base", joint="weld", shape=BALL, mass=mass)
    floor = pg.Contact(name="floor", body="b0", law=law, restitution=0.4)
    hit = pg.Contact(name="hit", body="b0", other="wall", law=law, restitution=0.4)
    bodies = (*heap(1).bodies, base, wall)
    _, t = tables(pg.Model(bodies=bodies, contacts=(floor, hit)))
    for name in ("stiffness", "damping", "mass", "loss"):
        assert t.laws[1][name] == pytest.approx(t.laws[0][name], rel=1e-12)


def test_a_mesh_that_is_not_there_is_named_with_its_body():
    model = pg.Model.serial(1).edit("1", shape={"kind": "mesh", "file": "none.stl"})
    with pytest.raises(
        pg.ModelError,
        match=r"^contact '.*': the shape of '1': mesh .*none\.stl: there is no such file",
    ):
        tables(model.replace(contacts=(pg.Contact(name="c", body="1"),)))


def test_limits_name_the_coordinates_that_they_bound():
    motions = (("ball", (0, 0, 1)), ("translate", (1, 0, 0)), ("rotate", (0, 0, 1)))
    bodies = (
        pg.Body(name="a", joint="compound", motions=motions, limits=(None, (0, None), (-1, 2))),
        pg.Body(name="b", parent="a", limits=(None, 0.5), limit_restitution=0.6),
    )
    mech = pg.Mechanism(pg.Model(bodies=bodies))
    t = tables_of(mech.packed, ())
    ints, floats, terms, factors = t.limit_blocks
    assert t.limits == ("a low limit 1", "a low limit 2", "a high limit 2", "b high limit")
    assert terms.tolist() == [[3, 4], [4, 5], [4, 5], [5, 6]]  # v, q
    assert factors.tolist() == [1, 1, -1, -1]
    assert floats[:, at.VALUE].tolist() == [0, -1, -2, -0.5]
    assert floats[:, at.BOUNCE].tolist() == [0, 0, 0, 0.6]
    assert set(ints[:, at.B_TYPE]) == {at.T_LIMIT}
