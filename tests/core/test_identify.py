"""Masses, mass centres and inertias from motions and torques (`identify_inertia`)."""

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.many import torques

from ..refusals import assert_names, refusal
from .test_tracking import four_bar, turned_crank


def excited(mech, n=400, seed=0):
    """Sums of sines of every joint, as (q, v, a)."""
    rng, t = np.random.default_rng(seed), np.linspace(0, 10, n)[:, None]
    w = 2 * np.pi * np.array([0.1, 0.3, 0.5])[:, None, None]
    size = rng.normal(size=(3, 1, mech.nv)) * 0.7
    phase = rng.uniform(0, 6, size=(3, 1, mech.nv))
    q = (size * np.sin(w * t + phase)).sum(axis=0)
    v = (size * w * np.cos(w * t + phase)).sum(axis=0)
    return q, v, -(size * w**2 * np.sin(w * t + phase)).sum(axis=0)


def link(name, parent, axis, place, rng):
    points = rng.normal(size=(6, 3)) * [0.08, 0.06, 0.15]
    points -= points.mean(axis=0)
    spread = points.T @ points / 6
    mass = float(rng.uniform(1, 4))
    return pg.Body(
        name=name, parent=parent, axes=axis, link=place, mass=mass,
        com=tuple(rng.normal(0, 0.05, 3)),
        inertia=mass * (np.trace(spread) * np.eye(3) - spread),
    )  # fmt: skip


def seven_axes():
    rng, bodies = np.random.default_rng(7), []
    for k in range(7):
        axis = (0, 0, 1) if k % 2 == 0 else (0, 1, 0)
        parent = bodies[-1].name if bodies else "ground"
        bodies.append(link(f"link{k + 1}", parent, axis, (0, 0, 0.2), rng))
    return pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, 0, -9.81)))


def wrong(mech):
    """The same mechanism with other masses and inertias, as a first guess."""
    model = mech.model
    for body in model.bodies:
        model = model.edit(body.name, mass=2.0, com=(0, 0, 0.01), inertia=[0.02] * 3)
    return pg.Mechanism(model)


def test_inertias_of_a_seven_axis_arm_are_within_three_standard_errors():
    """All that the data determine: 99.7 % of normal errors; the seed is one of nine in ten that
    have none beyond."""
    mech, rng = seven_axes(), np.random.default_rng(1)
    state = excited(mech)
    noise = np.array([0.5, 0.5, 0.2, 0.2, 0.05, 0.05, 0.02])
    tau = torques(mech, *state) + noise * rng.normal(size=(400, 7))
    found = pg.identify_inertia(wrong(mech), *state, tau)
    exact = pg.identify_inertia(mech, *state, torques(mech, *state))
    assert found.combinations.keys() == exact.combinations.keys()
    for text, (value, error) in found.combinations.items():
        assert abs(value - exact.combinations[text][0]) <= 3 * error, text
    assert np.allclose(found.noise, noise, rtol=0.15)
    known = np.isfinite(found.errors)
    apart = np.abs(found.parameters - mech.inertial_parameters())
    assert known.sum() >= 20
    assert (apart[known] <= 3 * found.errors[known]).all()
    # 43 of 70: by hand, one of the first link, whose axis is along gravity, and seven of each other
    assert len(found.combinations) == 1 + 6 * 7


def test_a_model_with_numbers_found_has_the_torques():
    mech = seven_axes()
    state, other = excited(mech), excited(mech, 50, seed=9)
    found = pg.identify_inertia(wrong(mech), *state, torques(mech, *state))
    tau, wanted = torques(pg.Mechanism(found.model), *other), torques(mech, *other)
    assert np.abs(tau - wanted).max() < 1e-8 * np.abs(wanted).max()
    for body in found.model.bodies:
        assert np.linalg.eigvalsh(body.inertia)[0] >= 0


def pendulum(n):
    bodies = []
    for k in range(n):
        place = (0.3, 0, 0) if k else (0, 0, 0)
        parent = f"p{k}" if k else "ground"
        bodies.append(pg.Body(name=f"p{k + 1}", parent=parent, axes=(0, 1, 0), link=place, mass=2,
                              com=(0.1, 0.02, 0.03), inertia=[0.03, 0.04, 0.05]))  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=bodies))


def test_combinations_of_a_plane_arm_are_those_by_hand():
    """Of link 1 of length l: m1 c1 + m2 l, I1 + m2 l², and c_z; of link 2 its m c and I_yy."""
    mech = pendulum(2)
    state = excited(mech)
    found = pg.identify_inertia(mech, *state, torques(mech, *state))
    m1, m2 = 2.0, 2.0
    inertia = 0.04 + m1 * (0.1**2 + 0.03**2)
    wanted = {  # mass 1 has no effect, and the mass of link 2 acts at its joint
        "m c_x of 'p1'": m1 * 0.1 + m2 * 0.3, "m c_z of 'p1'": m1 * 0.03,
        "I_yy of 'p1'": inertia + m2 * 0.3**2, "m c_x of 'p2'": m2 * 0.1,
        "m c_z of 'p2'": m2 * 0.03, "I_yy of 'p2'": inertia,
    }  # fmt: skip
    assert [text.split(" +")[0] for text in found.combinations] == [*wanted]
    for (value, _), exact in zip(found.combinations.values(), wanted.values()):
        assert abs(value - exact) < 1e-8
    texts = [*found.combinations]
    assert "0.3 mass of 'p2'" in texts[0]
    assert "0.09 mass of 'p2'" in texts[2]
    assert_names(found.undetermined[0], "mass of 'p1'", "I_xx of 'p1'", "m c_y of 'p2'")
    assert_names(found.undetermined[1], "m c_x of 'p1'", "I_yy of 'p1'", "mass of 'p2'")


def test_bodies_stay_possible_where_noise_would_make_them_impossible():
    mech, rng = pendulum(1), np.random.default_rng(0)
    model = mech.model.edit("p1", com=(0.3, 0, 0), inertia=[1e-4] * 3)
    mech = pg.Mechanism(model)
    state = excited(mech, 30)
    tau = torques(mech, *state)
    tau -= 0.06 * state[2]  # as of an inertia that a mass at its centre cannot have
    found = pg.identify_inertia(mech, *state, tau + 1e-3 * rng.normal(size=tau.shape))
    assert_names(repr(found), "p1 would be no possible body")
    (body,) = found.model.bodies
    least = np.linalg.eigvalsh(body.inertia)[0]
    assert least > -1e-9
    assert body.mass > 0


def test_loops_show_what_they_permit():
    mech = four_bar()
    mech = pg.Mechanism(mech.model.edit("rocker", com=(0.2, 0, 0.03), mass=3.0))
    q = turned_crank(mech, 60)
    rng, states = np.random.default_rng(4), []
    for x in q:
        _, v, _ = mech.assemble(x, rng.normal(size=3))
        tau = rng.normal(size=3) * 5
        states.append((x, v, mech.constrained_dynamics(x, v, tau)[0], tau))
    state = [np.array(x) for x in zip(*states)]
    start = pg.Mechanism(mech.model.edit("rocker", com=(0.1, 0, 0), inertia=[0.2] * 3))
    found = pg.identify_inertia(start, *state, bodies=["rocker"])
    values = {text.partition(" +")[0]: pair[0] for text, pair in found.combinations.items()}
    assert abs(values["m c_x of 'rocker'"] - 0.6) < 1e-6
    assert abs(values["I_yy of 'rocker'"] - (0.1 + 3 * (0.2**2 + 0.03**2))) < 1e-6


def test_data_that_do_not_fit_are_refused():
    mech = pendulum(2)
    q, v, a = excited(mech, 10)
    tau = torques(mech, q, v, a)
    for call, *facts in (
        (lambda: pg.identify_inertia(mech, q, v, a, tau[:, :1]), "torque", "(10, 2)"),
        (lambda: pg.identify_inertia(mech, q, v[:3], a, tau), "v", "(10, 2)"),
        (lambda: pg.identify_inertia(mech, q, v, a, tau * np.nan), "torque", "finite"),
        (lambda: pg.identify_inertia(mech, q, v, a, tau, bodies=["x"]), "bodies", "'x'", "p1"),
        (lambda: pg.identify_inertia(mech, q[:1], v[:1], a[:1], tau[:1]), "more samples"),
    ):
        assert_names(str(refusal(call)), *facts)
