"""Equilibria at the bounds of strings, tendons and cables: closed forms and their conditions."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import pgraph_core as pg
from tests.refusals import assert_names, refusal


def string(name, x, high):
    return pg.Spring(name=name, body="w", point=(0, 0, 0), other_point=(x, 0, 0), high=high)


def cable(name, x, high):
    return pg.Cable(name=name, through=[("ground", (x, 0, 0)), ("w", (0, 0, 0))], length=high)


def hung(q, *forces, limits=(), contacts=(), **body):
    """A mass that moves in the plane of x and z."""
    x = pg.Body(name="x", joint="prismatic", axes=["x"], mass=0, q=q[0], limits=limits)
    fields = {"parent": "x", "joint": "prismatic", "axes": ["z"], "mass": 2.0, "q": q[1], **body}
    bodies = [x, pg.Body(name="w", **fields)]
    return pg.Mechanism(pg.Model(bodies=bodies, forces=list(forces), contacts=list(contacts)))


@pytest.mark.parametrize("kind", [string, cable])
@pytest.mark.parametrize("q", [(0.3, -0.2), (-0.9, 0.1), (0.01, -0.999), (3.0, -2.0)])
def test_a_mass_hangs_on_what_is_taut(kind, q):
    low = -np.sqrt(0.75)
    one = hung(q, kind("a", 0.0, 1.0)).equilibrium()
    np.testing.assert_allclose(one, [0.0, -1.0], atol=1e-9)
    two = hung(q, kind("a", 0.0, 1.0), kind("b", 1.0, 1.0)).equilibrium()
    np.testing.assert_allclose(two, [0.5, low], atol=1e-9)
    slack = hung(q, kind("a", 0.0, 1.0), kind("b", 1.0, 2.0)).equilibrium()
    np.testing.assert_allclose(slack, [0.0, -1.0], atol=1e-9)
    beside = hung(q, kind("a", 0.0, 1.0), limits=[(0.5, None)]).equilibrium()
    np.testing.assert_allclose(beside, [0.5, low], atol=1e-9)


@pytest.mark.parametrize("high", [0.2, 0.6, 2.0])
def test_a_tendon_rests_on_its_limit_unless_its_spring_holds_it_before(high):
    bodies = [
        pg.Body(name=name, joint="prismatic", axes=["z"], mass=m, stiffness=50.0)
        for name, m in (("a", 1.0), ("b", 3.0))
    ]
    tendon = pg.Tendon(name="t", body="a", coefficients={"a": -1.0, "b": -1.0}, high=high)
    q = pg.Mechanism(pg.Model(bodies=bodies, forces=[tendon])).equilibrium()
    sags = np.array([9.81, 3 * 9.81]) / 50.0
    push = max(float(sum(sags)) - high, 0.0) / 2
    np.testing.assert_allclose(q, push - sags, atol=1e-9)


def test_a_cable_over_a_wheel_with_friction_holds_a_spring():
    bodies = [
        pg.Body(name=name, joint="prismatic", axes=["z"], mass=m, link=(x, 0, -1), stiffness=k)
        for name, m, x, k in (("a", 1.0, -0.1, 0.0), ("b", 3.0, 0.1, 100.0))
    ]
    wheel = pg.Pulley(body="ground", point=(0, 0, 0), radius=0.1, axis=(0, 1, 0), friction=0.2)
    cable = pg.Cable(name="c", through=[("a", (0, 0, 0)), wheel, ("b", (0, 0, 0))])
    q = pg.Mechanism(pg.Model(bodies=bodies, forces=[cable])).equilibrium()
    np.testing.assert_allclose(q, [2 * 9.81 / 100, -2 * 9.81 / 100], atol=1e-9)


def test_limits_that_exclude_each_other_are_named():
    mech = hung((0.0, -0.2), string("a", 0.0, 1.0), string("b", 3.0, 1.0))
    assert_names(str(refusal(mech.equilibrium)), "spring 'a'", "spring 'b'", "together")


def test_a_place_inside_a_contact_is_no_equilibrium():
    fields = {"shape": pg.Sphere(radius=0.1), "stiffness": 10.0, "rest": 0.0}
    floor = pg.Contact(name="floor", body="w", other="ground")
    mech = hung((0.0, 0.5), contacts=[floor], limits=[(0.0, 1.0)], **fields)
    assert_names(str(refusal(mech.equilibrium)), "floor", "2.06", "run.q[-1]")
    high = hung((0.0, 0.5), contacts=[floor], limits=[(0.0, 1.0)], **{**fields, "rest": 3.0})
    np.testing.assert_allclose(high.equilibrium(), [0.0, 3.0 - 1.962], atol=1e-9)


@pytest.mark.parametrize("kind", [string, cable])
def test_a_linearisation_names_a_taut_string(kind):
    mech = hung((0.0, -0.5), kind("rope", 0.0, 1.0))
    assert "'rope'" in mech.linearise(mech.equilibrium()).notices[0]


@pytest.mark.parametrize("seed", range(6))
def test_bounds_only_push_and_are_kept(seed):
    """A chain of hinges: the forces left are a sum of pushes of the bounds that are reached."""
    random = np.random.default_rng(seed)
    bodies = [
        pg.Body(name=f"{k}", parent=f"{k - 1}" if k else "ground", joint="revolute", mass=1.0,
                axes=["xyz"[random.integers(3)]], link=random.normal(size=3) * 0.3,
                com=random.normal(size=3) * 0.3, tip=random.normal(size=3) * 0.4,
                q=random.normal() * 0.4)
        for k in range(4)
    ]  # fmt: skip
    ends = random.normal(size=(3, 3))
    forces = [
        pg.Spring(name=f"s{k}", body=f"{k + 1}", point=(0, 0, 0), other_point=ends[k], high=9.0)
        for k in range(3)
    ]
    start = pg.Mechanism(pg.Model(bodies=bodies, forces=forces))
    lengths = start.path_length(start.home()[0])
    forces = [f.model_copy(update={"high": 1.02 * x}) for f, x in zip(forces, lengths)]
    mech = pg.Mechanism(pg.Model(bodies=bodies, forces=forces))
    q = mech.equilibrium()
    room = 1.02 * lengths - mech.path_length(q)
    assert room.min() > -1e-9
    pulls = mech.moment_arms(q)[room < 1e-7]
    left = mech.inverse_dynamics(q, np.zeros(4), np.zeros(4))
    assert lsq_linear(np.vstack((pulls, np.zeros(4))).T, left, (0.0, np.inf)).cost < 1e-13


@pytest.mark.parametrize("q", [(0.0, -0.1), (0.1, 0.1), (-0.1, -0.3)])
@pytest.mark.parametrize("kind", ["rod", "cable"])
def test_a_joint_rests_on_its_limit_beside_a_closed_row(kind, q):
    fields = {"axes": [(0, 1, 0)], "mass": 1.0, "inertia": (0.01,) * 3}
    upper = pg.Body(name="a", com=(0, 0, -0.4), **fields)
    lower = pg.Body(
        name="b", parent="a", link=(0, 0, -0.8), com=(0, 0, -0.3), limits=[(-0.8, 0.6)], **fields
    )
    push = pg.Wrench(name="push", body="b", point=(0, 0, -0.6), force=(15.0, 0, 0))
    at, to = (0.05, 0, -0.5), (-0.5, 0, -0.3)
    rod = pg.Distance(name="r", body="b", point=at, other="ground", other_point=to, length=1.1)
    cable = pg.Cable(name="r", through=[("b", at), ("ground", to)], length=1.1)
    model = pg.Model(
        bodies=[upper, lower], forces=[push, *([cable] if kind == "cable" else [])],
        constraints=[rod] if kind == "rod" else [],
    )  # fmt: skip
    found = pg.Mechanism(model).equilibrium(q)
    assert found[1] == pytest.approx(-0.8, abs=1e-9)
    run = pg.simulate(model, q=np.asarray(found), t_end=0.05, estimate=False)
    np.testing.assert_allclose(run.q[-1], found, atol=1e-9)


@pytest.mark.parametrize("kind", sorted(pg.Force.KINDS))
def test_a_kind_that_bounds_states_the_constraint_that_holds(kind):
    own = {name for base in pg.Force.KINDS[kind].__mro__ for name in vars(base) if base != pg.Force}
    assert ("_bounds" in own) == ("_stops" in own)
