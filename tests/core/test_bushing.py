"""Bushings: closed forms, energy and power, mirror images and other units."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg

from .rescaling import rescaled

RNG = np.random.default_rng(7)


def psd(rng, least=0.0):
    a = rng.normal(size=(6, 6))
    return a @ a.T + least * np.eye(6)


def floating(stiffness, damping=(0.0,) * 6, mass=2.0, **fields):
    body = pg.Body(name="a", joint="free", mass=mass, inertia=(0.2, 0.3, 0.4))
    rubber = pg.Bushing(
        name="r", body="a", point=(0, 0, 0), stiffness=stiffness, damping=damping, **fields
    )
    return pg.Model(bodies=[body], forces=[rubber], gravity=(0, 0, 0))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_six_masses_on_six_springs_swing_with_their_frequencies(scale):
    """Along and about each axis: omega² = k / m, and k / I."""
    k = scale * np.array([10.0, 40.0, 90.0, 0.2, 0.6, 1.2])
    mech = pg.Mechanism(floating(k))
    found = sorted(mech.linearise().frequencies)
    of = np.sqrt(k / np.array([2.0, 2.0, 2.0, 0.2, 0.3, 0.4]))
    np.testing.assert_allclose(found, sorted(of), rtol=1e-6)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 1.0, 3.0])
def test_what_it_exerts_is_the_slope_of_what_it_stores(angle):
    """By SciPy's rotation vectors and differences of e K e / 2 between two bodies."""
    rng = np.random.default_rng(3)
    K, n = psd(rng), rng.normal(size=3)
    n /= np.linalg.norm(n)
    bodies = [
        pg.Body(name="a", joint="free", inertia=(0.01,) * 3),
        pg.Body(name="b", joint="free", com=(0.1, 0.2, 0.3), inertia=(0.01,) * 3),
    ]
    turn = Rotation.random(random_state=5)
    f = pg.Bushing(
        name="r", body="a", other="b", point=(0.1, 0, 0), other_point=(0, 0.2, 0), stiffness=K,
        rotation=turn.as_quat(scalar_first=True), other_rotation=(0.5, 0.5, 0.5, 0.5),
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=bodies, forces=[f], gravity=(0, 0, 0)))
    bare = pg.Mechanism(mech.model.replace(forces=()))
    own, other = turn, Rotation.from_quat((0.5, 0.5, 0.5, 0.5), scalar_first=True)
    place = Rotation.random(random_state=6)
    first = place * other * Rotation.from_rotvec(angle * n) * own.inv()

    def stored(q):
        (pa, qa), (pb, qb) = (np.split(x, [3]) for x in np.split(q, 2))
        Ra, Rb = (Rotation.from_quat(x, scalar_first=True) for x in (qa, qb))
        d = (Rb * other).inv().apply(pa + Ra.apply([0.1, 0, 0]) - pb - Rb.apply([0, 0.2, 0]))
        e = np.concatenate((d, ((Rb * other).inv() * Ra * own).as_rotvec()))
        return e @ K @ e / 2

    q = np.concatenate(
        (rng.normal(size=3), first.as_quat(scalar_first=True),
         rng.normal(size=3), place.as_quat(scalar_first=True))
    )  # fmt: skip
    v = rng.normal(size=12)
    assert mech.energy(q, 0 * v)[1] == pytest.approx(stored(q), rel=1e-12)
    tau = bare.inverse_dynamics(q, v, mech.forward_dynamics(q, v))
    eps = 1e-6

    def moved(v, h):
        found = []
        for k in range(2):
            p, turned = np.split(q[7 * k : 7 * k + 7], [3])
            w, u = np.split(v[6 * k : 6 * k + 6], [3])
            R = Rotation.from_rotvec(h * w) * Rotation.from_quat(turned, scalar_first=True)
            found += [p + h * u, R.as_quat(scalar_first=True)]
        return np.concatenate(found)

    slopes = [stored(moved(e, eps)) - stored(moved(e, -eps)) for e in np.eye(12)]
    np.testing.assert_allclose(tau, -np.array(slopes) / (2 * eps), atol=1e-8 * np.abs(K).max())


@pytest.mark.parametrize("method", ["rk4", "dop853", "semi_implicit_euler"])
def test_what_a_run_loses_is_what_the_damping_takes(method):
    model = floating(psd(RNG), psd(RNG, 0.1) / 10, mass=1.0)
    run = pg.simulate(
        model, t_end=1.0, method=method, estimate=False,
        v=[0.3, -0.4, 0.5, 0.2, 0.1, -0.3], **({} if method == "dop853" else {"step": 1e-4}),
    )  # fmt: skip
    total = run.kinetic_energy + run.potential_energy
    order = 1e-3 if method == "semi_implicit_euler" else 1e-6
    np.testing.assert_allclose(total + run.dissipation, total[0], rtol=order)
    assert run.dissipation[-1] > 0.01 * total[0]


def test_a_mirror_image_moves_as_the_mirror_image():
    """A bushing on the left, copied to the right: displacements are reflected."""
    left = pg.Body(
        name="left", joint="free", link=(0, 1, 0), com=(0.1, 0.2, 0.3), inertia=(0.01,) * 3
    )  # fmt: skip
    rubber = pg.Bushing(
        name="left rubber", body="left", point=(0.1, 0.1, 0.2), other_point=(0.1, 1.1, 0.2),
        other_rotation=(0.5, 0.5, 0.5, 0.5), rotation=(0.5, 0.5, 0.5, 0.5), stiffness=psd(RNG),
        damping=psd(RNG),
    )  # fmt: skip
    model = pg.Model(bodies=[left], forces=[rubber], gravity=(0, 0, -9.81))
    both = model.mirror("left", "y")
    run = pg.simulate(both, t_end=0.3, step=1e-3, method="rk4", estimate=False)
    one, other = run.body_pose[:, 0, :3], run.body_pose[:, 1, :3]
    assert np.abs(one - one[0]).max() > 0.05
    np.testing.assert_allclose(other * (1, -1, 1), one, atol=1e-9)


def test_in_other_units_it_is_the_same_motion():
    model = floating(psd(RNG), psd(RNG))
    scaled = rescaled(model, length=3.0, mass=5.0, time=0.5)
    v = np.array([0.3, -0.4, 0.5, 0.2, 0.1, -0.3])
    one = pg.simulate(model, v=v, t_end=0.2, step=1e-3, method="rk4", estimate=False)
    v = v * np.array([2.0, 2.0, 2.0, 6.0, 6.0, 6.0])
    two = pg.simulate(scaled, v=v, t_end=0.1, step=5e-4, method="rk4", estimate=False)
    np.testing.assert_allclose(two.q[-1, :3], 3.0 * one.q[-1, :3], atol=1e-10)
    np.testing.assert_allclose(two.q[-1, 3:], one.q[-1, 3:], atol=1e-10)


def test_files_hold_it_and_older_versions_refuse_them():
    model = floating(psd(RNG))
    text = model.to_json()
    assert '"schema_version": 5' in text
    assert pg.Model.from_json(text) == model


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"stiffness": np.arange(36.0).reshape(6, 6)}, "symmetric"),
        ({"stiffness": (1, 1, 1, 1, 1, -1)}, "eigenvalue"),
        ({"damping": (1, 2, 3)}, "damping"),
        ({"rotation": (0, 0, 0, 0)}, "quaternion"),
        ({"other_rotation": (0, 0, 0, 0)}, "quaternion"),
    ],
)
def test_what_would_not_be_passive_is_refused(fields, named):
    with pytest.raises(pg.ModelError, match=named):
        pg.Bushing(name="r", body="a", **fields)
