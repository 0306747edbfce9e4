"""Published and closed-form motions that simulations must reproduce. See static_models/cases.

Each case is run by RK4 at a step at which its error is known; the tolerance is about three
times what was measured.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

DOWN = {"gravity": (0.0, -9.81, 0.0), "up": "y"}
NONE = ((0.0,) * 3,) * 3


def case(name):
    """Times and reference of a case."""
    data = json.loads((pgraph_models.CASES / f"{name}.json").read_text(encoding="utf-8"))
    return np.array(data["t"]), data["reference"]


def mass(name, parent="ground", *, m=1.0, length=1.0, above=0.0, **fields):
    """A point mass on a rod without mass, hinged about z, hanging down at q = 0."""
    return pg.Body(
        name=name,
        parent=parent,
        link=(0, -above, 0),
        mass=m,
        com=(0, -length, 0),
        inertia=NONE,
        **fields,
    )


def rod(name, parent="ground", *, m=1.0, length=1.0, along=(1, 0, 0), link=(0, 0, 0)):
    """A uniform slender rod, hinged about z at its end."""
    along = np.array(along, dtype=float)
    inertia = m * length**2 / 12 * (np.eye(3) - np.outer(along, along))
    return pg.Body(
        name=name, parent=parent, link=link, mass=m, com=tuple(length / 2 * along), inertia=inertia
    )


def run(model, t, q, v=None, *, step=1e-3, **options):
    """The motion recorded at the times of the reference."""
    mech = pg.Mechanism(model)
    v = np.zeros(mech.nv) if v is None else v
    done = pg.simulate(mech, q, v, t_end=t[-1], t_eval=t, method="rk4", step=step, **options)
    assert done.status.ok, done.message
    return done


def place(done, name, point):
    """(n, 3) of a point of a body."""
    return np.array([x + R @ point for x, R in (done.mechanism.pose(q, name) for q in done.q)])


def worst(found, expected):
    """Largest difference."""
    return float(np.abs(np.asarray(found) - np.asarray(expected)).max())


def test_a01_simple_pendulum():
    t, reference = case("a01_simple_pendulum")
    done = run(pg.Model(bodies=(mass("a"),), **DOWN), t, np.array([-np.pi / 2]))
    places = place(done, "a", (0, -1, 0))
    assert worst(places[:, 0], reference["x"]) < 1e-9
    assert worst(places[:, 1], reference["y"]) < 1e-9
    assert done.energy_drift < 1e-10


@pytest.mark.parametrize("length", [1e-9, 1e-3, 1.0, 1e6, 1e9])
def test_pendulums_of_all_scales_are_the_same(length):
    """A quarter of the period later it passes the lowest point; no threshold has a unit."""
    _, reference = case("pendulum_scales")
    period = reference["period"][reference["L"].index(length)]
    body = mass("a", m=length**3, length=length)
    done = run(
        pg.Model(bodies=(body,), **DOWN),
        np.array([0.0, period / 4]),
        np.array([np.pi / 2]),
        step=period / 400,
    )
    speed = done.v[-1, 0] * np.sqrt(length / 9.81)
    assert abs(done.q[-1, 0]) < 1e-8
    assert speed == pytest.approx(-np.sqrt(2), abs=1e-8)


def test_double_pendulum():
    """Chaotic: 1e-13 a step grows to what is allowed here."""
    t, reference = case("double_pendulum")
    model = pg.Model(bodies=(mass("a"), mass("b", "a", above=1.0)), **DOWN)
    done = run(model, t, np.array([1.5, 0.5]), step=2.5e-4)
    assert worst(np.cumsum(done.q, axis=1), reference["theta_abs"]) < 1e-7
    first = np.cumsum(done.vdot[0])
    assert worst(first, reference["theta_ddot_at_t0"]) < 1e-13
    assert done.energy[0] == pytest.approx(reference["energy"], rel=1e-14)


@pytest.mark.parametrize(
    ("name", "ratio", "start", "tolerance"),
    [
        ("mass_ratio_light_tip_1em12", 1e-12, (0.8, -0.5), 1e-12),
        ("mass_ratio_heavy_tip_1e9", 1e9, (0.8, 0.799999 - 0.8), 2e-6),  # 10 eps times the ratio
    ],
)
def test_extreme_mass_ratios_start_with_the_right_acceleration(name, ratio, start, tolerance):
    _, reference = case(name)
    model = pg.Model(bodies=(mass("a"), mass("b", "a", m=ratio, above=1.0)), **DOWN)
    vdot = np.cumsum(pg.Mechanism(model).forward_dynamics(np.array(start), np.zeros(2)))
    expected = np.array(reference["theta_ddot_t0"])
    assert worst(vdot, expected) < tolerance * abs(expected).max()


def test_a_light_tip_does_not_disturb_the_motion():
    t, reference = case("mass_ratio_light_tip_1em12")
    model = pg.Model(bodies=(mass("a"), mass("b", "a", m=1e-12, above=1.0)), **DOWN)
    done = run(model, t, np.array([0.8, -0.5]))
    assert worst(np.cumsum(done.q, axis=1), reference["theta"]) < 1e-9


def test_spherical_pendulum():
    t, reference = case("spherical_pendulum")
    tiny = 1e-10 * np.eye(3)  # so that a turn about the rod moves something
    ball = pg.Body(name="a", joint="spherical", com=(0, 0, -1), inertia=tiny)
    q = (np.cos(-0.5), 0.0, np.sin(-0.5), 0.0)  # turned by -1 about y: (sin 1, 0, -cos 1)
    done = run(pg.Model(bodies=(ball,)), t, np.array(q), np.array([0.0, 0.0, 2.0]))
    expected = np.transpose([reference[axis] for axis in "xyz"])
    assert worst(place(done, "a", (0, 0, -1)), expected) < 1e-8


def test_heavy_top():
    t, reference = case("heavy_top")
    top = pg.Body(
        name="top",
        joint="spherical",
        mass=15.0,
        com=(0, 1, 0),
        inertia=np.diag([0.234375, 0.46875, 0.234375]),
    )
    q, v = np.array([1.0, 0, 0, 0]), np.array([0.0, 150.0, -4.61538])
    done = run(pg.Model(bodies=(top,)), t, q, v, step=2e-4)
    assert worst(place(done, "top", (0, 1, 0)), reference["com_position"]) < 3e-6
    assert done.energy[0] == pytest.approx(reference["energy"], rel=1e-14)


def test_a_body_that_turns_over_about_its_middle_axis():
    t, reference = case("free_rigid_body_dzhanibekov")
    body = pg.Body(name="a", joint="free", inertia=np.diag([1.0, 2.0, 3.0]))
    q = np.array([0.0, 0, 0, 1, 0, 0, 0])
    v = np.array([0.01, 5.0, 0.01, 0, 0, 0])
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0))
    done = run(model, t, q, v, step=5e-4)
    turned = np.array([done.mechanism.pose(q, "a")[1] for q in done.q])
    assert worst(turned.reshape(-1, 9), np.reshape(reference["R"], (-1, 9))) < 1e-5
    omega = np.einsum("nji,nj->ni", turned, done.v[:, :3])
    assert worst(omega, reference["omega_body"]) < 1e-5


@pytest.mark.parametrize(
    ("n", "step", "tolerance"),
    [
        (10, 2.5e-4, 1e-9),
        (100, 2.5e-4, 1e-9),
        pytest.param(1000, 1e-4, 1e-8, marks=pytest.mark.nightly),
    ],
)
def test_chain(n, step, tolerance):
    t, reference = case("chain_n_links")
    link = {"m": 1 / n, "length": 1 / n}
    bodies = [mass("1", **link)]
    bodies += [mass(str(i), str(i - 1), above=1 / n, **link) for i in range(2, n + 1)]
    done = run(pg.Model(bodies=tuple(bodies), **DOWN), t, np.pi / 4 * np.eye(n)[0], step=step)
    tip = place(done, str(n), (0, -1 / n, 0))[:, :2]
    assert worst(tip, reference[str(n)]["tip_xy"]) < tolerance


def built_in(name, t, step, *, v=None, **changes):
    """A built-in model from its first position, run by its own scenario."""
    model = pg.Model.load(pgraph_models.path(name)).replace(**changes)
    mech = pg.Mechanism(model)
    scenario = model.scenarios[0].name
    options = {"t_end": t[-1], "t_eval": t, "scenario": scenario, "step": step}
    done = pg.simulate(mech, v=v, **options)
    assert done.status.ok, done.message
    return done


def test_slider_crank():
    """Spatial joints: three rows of the loop are redundant; several turns past the dead points."""
    t, reference = case("slider_crank_rigid")
    done = built_in("slider_crank", t, 1e-4)
    assert worst(done.q[:, 0], reference["theta"]) < 3e-8
    assert worst(done.q[:, 2], reference["slider_x"]) < 1e-8
    assert done.constraint_drift.max() < 1e-9
    assert len(done.mechanism.mobility().redundant) == 3


def test_a04_bricard():
    """By counting it has no degree of freedom left: one row is redundant, and named."""
    t, reference = case("a04_bricard")
    done = built_in("bricard", t, 1e-3)
    assert worst(place(done, "rod 4", (0, 0, 0)), reference["P3"]) < 1e-10
    (row,) = done.mechanism.mobility().redundant
    assert str(row) == "rotation about (0, 0.707, -0.707) of constraint 'loop'"


def test_andrews_squeezer():
    t, reference = case("andrews_squeezer")
    t = t[t < 0.0301]
    done = built_in("andrews", t, 1e-5)
    angles = [done.mechanism.joints[name].q for name in ("K1", "K2", "K3", "K4", "K5", "K6", "K7")]
    found = np.column_stack([done.q[:, place] for place in angles])
    assert worst(found, np.array(reference["q"])[: len(t)]) < 1e-9


def test_rolling_disc():
    """A wobbling coin; its places are five, its velocities three."""
    t, reference = case("rolling_disc")
    done = built_in("rolling_disc", t, 1e-3)
    turned = np.array([done.mechanism.pose(q, "disc")[1] for q in done.q])
    tilt = np.arccos(turned[:, 2, 2])
    heading = np.unwrap(np.arctan2(turned[:, 0, 2], -turned[:, 1, 2]))
    angles = np.array(reference["psi_theta_phi"])
    assert worst(tilt, angles[:, 1]) < 1e-10
    assert worst(heading, angles[:, 0]) < 1e-10
    assert worst(place(done, "disc", (0, 0, 0)), reference["centre"]) < 1e-9


def test_skate_on_incline():
    """It drifts across and comes back up: a blade forbids a velocity, not a place."""
    t, reference = case("skate_on_incline")
    body = pg.Body(name="a", joint="planar", inertia=0.1 * np.eye(3))
    blade = pg.Constraint(name="blade", kind="skate", body="a", point=(0, 0, 0), axis=(0, 1, 0))
    down = (9.81 / 2, 0, -9.81 * np.sqrt(0.75))
    model = pg.Model(bodies=(body,), constraints=(blade,), gravity=down)
    done = run(model, t, np.zeros(3), np.array([0, 0, 2.0]))
    assert worst(done.q[:, 0], reference["x"]) < 1e-9
    assert worst(done.q[:, 1], reference["y"]) < 1e-9


@pytest.mark.parametrize("windows", [1, 2, 10, pytest.param(40, marks=pytest.mark.nightly)])
def test_a02_four_bar_windows_pass_their_singular_positions(windows):
    t, reference = case("a02_n_four_bar")
    reference = reference[str(windows)]
    bodies, loops = [], []
    for i in range(windows + 1):
        bodies.append(rod(f"crank {i}", along=(0, 1, 0), link=(i, 0, 0)))
        if i < windows:
            bodies.append(rod(f"coupler {i}", f"crank {i}", link=(0, 1, 0)))
            end = {"point": (1, 0, 0), "other_point": (0, 1, 0)}
            loops.append(
                pg.Constraint(name=f"loop {i}", body=f"coupler {i}", other=f"crank {i + 1}", **end)
            )
    model = pg.Model(bodies=tuple(bodies), constraints=tuple(loops), **DOWN)
    v = np.array([-1.0 if b.name.startswith("crank") else 1.0 for b in bodies])
    done = run(model, t, np.zeros(len(bodies)), v)
    assert worst(place(done, "crank 0", (0, 1, 0))[:, 0], reference["x_B0"]) < 1e-6
    assert done.energy_drift < 1e-8
    assert "the run passed a singular position" in done.notices[1]
    assert "translation along x of constraint 'loop 0'" in done.notices[1]


def test_a_stiff_spring_pendulum_at_a_step_that_resolves_it():
    t, reference = case("stiff_spring_pendulum")
    bob = pg.Body(
        name="a",
        joint="compound",
        motions=(("rotate", (0, 0, 1)), ("translate", (0, -1, 0))),
        com=(0, -1, 0),
        inertia=NONE,
        stiffness=(0.0, 1e3),
    )
    q = np.array([1.0, 9.81 * np.cos(1.0) / 1e3])
    done = run(pg.Model(bodies=(bob,), **DOWN), t, q, step=5e-4)
    found = np.column_stack((1 + done.q[:, 1], done.q[:, 0], done.v[:, 1], done.v[:, 0]))
    expected = reference["undamped"]["k=1e3"]["r_theta_rdot_thetadot"]
    assert worst(found, expected) < 1e-7
