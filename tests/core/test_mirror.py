"""The laws of a reflection: the mirror image of a mechanism moves as its mirror image."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.model.copies import Mirror

from .trees import random_model

PLANES = ("x", "y", "z")


def image(model: pg.Model, plane) -> pg.Model:
    root = model.bodies[0].name
    both = model.mirror(root, plane=plane)
    alone = both.remove(root, children="delete")
    return alone.replace(gravity=Mirror(PLANES.index(plane)).point(model.gravity))


def reflected(model: pg.Model, mech: pg.Mechanism, field: str, x, plane) -> np.ndarray:
    mirror, found, start = Mirror(PLANES.index(plane)), [], 0
    for name in mech.names:
        body = model.body(name)
        size = len(getattr(body, field))
        found += mirror.coordinates(field, x[start : start + size], body.sequence)
        start += size
    return np.array(found)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("seed", range(2))
def test_the_mirror_image_of_a_mechanism_moves_as_its_mirror_image(seed: int, plane):
    rng = np.random.default_rng(seed)
    model = random_model(rng, 9)
    mech, other = pg.Mechanism(model), pg.Mechanism(image(model, plane))
    q, _ = mech.home()
    v, tau = rng.normal(size=(2, mech.nv))
    q_, _ = other.home()
    v_, tau_ = (reflected(model, mech, "v", x, plane) for x in (v, tau))
    sign = reflected(model, mech, "v", np.ones(mech.nv), plane)
    M = mech.mass_matrix(q)
    tolerance = {"rtol": 1e-11, "atol": 1e-11 * np.abs(M).max()}  # sums of other signs
    assert np.allclose(other.mass_matrix(q_), sign[:, None] * M * sign, **tolerance)
    assert other.energy(q_, v_) == pytest.approx(mech.energy(q, v), rel=1e-11)
    vdot = mech.forward_dynamics(q, v, tau)
    scale = np.abs(vdot).max()
    assert np.allclose(other.forward_dynamics(q_, v_, tau_), sign * vdot, atol=1e-9 * scale)


@pytest.mark.parametrize("plane", PLANES)
def test_two_reflections_are_none(plane):
    model = random_model(np.random.default_rng(7), 8)
    twice = image(image(model, plane), plane)
    for a, b in zip(model.bodies, twice.bodies):
        for field in ("axes", "link", "com", "inertia", "tip", "q", "v", "rotation"):
            assert np.allclose(getattr(a, field), getattr(b, field), atol=1e-15)


@pytest.mark.parametrize("plane", PLANES)
def test_constraints_and_forces_are_reflected_with_the_mechanism(plane):
    """Points, axes, springs and wrenches of the image give the image of the motion."""
    rng = np.random.default_rng(3)
    rows = random_model(rng, 5, kinds=("revolute", "universal", "spherical")).bodies
    model = pg.Model(
        bodies=rows,
        gravity=(1.0, 2.0, -3.0),
        constraints=(
            pg.Constraint(name="pin", kind="point", body="b4", point=(0.1, 0.2, 0.3)),
            pg.Constraint(name="blade", kind="skate", body="b3", axis=(1.0, 0.3, 0.2)),
        ),
        forces=(
            pg.Force(name="push", kind="wrench", body="b2", torque=(1, 2, 3), force=(4, 5, 6)),
            pg.Force(name="pull", kind="spring", body="b4", other="b1", stiffness=40.0,
                     other_point=(0.0, 0.1, 0.2), rest=0.1),
            pg.Force(name="twist", kind="torsion", body="b3", other="b1", axis=(1, 2, 2),
                     stiffness=3.0),
        ),
    )  # fmt: skip
    other = image(model, plane)
    assert {c.name for c in other.constraints} == {"pin_2", "blade_2"}
    runs = [pg.simulate(pg.Mechanism(m), t_end=0.05, step=1e-3, method="rk4")
            for m in (model, other)]  # fmt: skip
    mech = pg.Mechanism(model)
    expected = reflected(model, mech, "q", runs[0].q[-1], plane)
    assert np.abs(expected - runs[0].q[0]).max() > 1e-3
    assert np.allclose(runs[1].q[-1], expected, atol=1e-8)
