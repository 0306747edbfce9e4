"""Methods that choose their steps: accuracy, stiffness, dense output, symplectic steps."""

import numpy as np
import pytest
from scipy.integrate._ivp import dop853_coefficients as theirs

import pgraph_core as pg
from pgraph_core.analysis.rows import apart
from pgraph_core.integrators import DOP853, METHODS

from .test_cases import DOWN, case, mass, rod, worst
from .trees import moved

EXPLICIT = ("dopri5", "dop853")


def double_pendulum():
    return pg.Mechanism(pg.Model(bodies=(mass("a"), mass("b", "a", above=1.0)), **DOWN))


def slider_crank():
    slider = pg.Body(name="slider", joint="prismatic", axes=((1, 0, 0),), mass=3.0)
    coupler = rod("rod", "crank", m=2.0, length=0.5, link=(0.2, 0, 0))
    ends = {"point": (0.5, 0, 0), "other_point": (0, 0, 0)}
    pin = pg.Constraint(name="pin", body="rod", other="slider", **ends)
    bodies = (rod("crank", length=0.2), coupler, slider)
    return pg.Mechanism(pg.Model(bodies=bodies, constraints=(pin,), **DOWN))


def crank_start():
    beta = np.arcsin(0.4 * np.sin(0.5))
    return np.array([0.5, -beta - 0.5, 0.2 * np.cos(0.5) + 0.5 * np.cos(beta)])


@pytest.mark.parametrize("method", EXPLICIT)
def test_pendulums_of_all_scales_take_the_same_steps(method):
    """At default tolerances, which have no unit."""
    _, reference = case("pendulum_scales")
    steps = set()
    for length in (1e-9, 1e-3, 1.0, 1e9):
        quarter = reference["period"][reference["L"].index(length)] / 4
        mech = pg.Mechanism(pg.Model(bodies=(mass("a", m=length**3, length=length),), **DOWN))
        done = pg.simulate(mech, np.array([np.pi / 2]), t_end=quarter, frames=2, method=method)
        assert abs(done.q[-1, 0]) < 3e-8
        steps.add(done.counters["steps"])
    assert len(steps) == 1


def test_the_tableau_of_dop853_is_that_of_scipy():
    ours = DOP853.tableau
    np.testing.assert_allclose(ours.a, theirs.A, rtol=0, atol=0)
    np.testing.assert_allclose(ours.error, [theirs.E5[:12], theirs.E3[:12]], rtol=0, atol=1e-17)


def stiff_pendulum(k):
    """The mechanism and initial q of a bob on a rod of stiffness k."""
    bob = pg.Body(
        name="a", joint="compound", motions=(("rotate", (0, 0, 1)), ("translate", (0, -1, 0))),
        com=(0, -1, 0), inertia=np.zeros((3, 3)), stiffness=(0.0, k),
    )  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=(bob,), **DOWN)), np.array([1.0, 9.81 * np.cos(1.0) / k])


def swing(reference, k):
    """Return the reference's θ over time, from k = 1e8 on by the limit of a rigid rod."""
    name = f"k=1e{round(np.log10(k))}"
    if name in reference["undamped"]:
        return np.array(reference["undamped"][name]["r_theta_rdot_thetadot"])[:, 1]
    slope = np.array(reference["slope_a_estimated_from_k1e6"])
    return np.array(reference["rigid_limit_theta"]) + slope / k


@pytest.mark.parametrize("k", [1e4, 1e6, 1e8, 1e10, 1e12])
def test_gauss_steps_are_solved_at_any_stiffness(k):
    """Up to 1e4 rad of the spring per step. The bob swings on a rod that its load stretches."""
    mech, q = stiff_pendulum(k)
    run = pg.simulate(mech, q, t_end=0.5, step=0.01, method="gauss6", frames=11, estimate=False)
    assert (run.counters["steps"], run.counters["rejected_steps"]) == (50, 0)
    assert run.counters["newton_iterations"] < 6 * 50
    assert run.counters["evaluations"] < 1000
    assert run.energy_drift < 1e-12
    theta, turning = run.q[:, 0], run.v[:, 0]
    pull = 9.81 * np.cos(theta) + turning**2
    np.testing.assert_allclose(k * run.q[:, 1], pull, atol=max(30 / np.sqrt(k), 0.05))


def test_gauss_steps_over_a_stiff_spring_conserve_energy_for_long():
    """8000 rad of the excited spring. Its energy stays within a bound."""
    mech, q = stiff_pendulum(1e6)
    start = q + np.array([0.0, 1e-4])
    run = pg.simulate(mech, start, t_end=100.0, step=0.05, method="gauss6", estimate=False)
    assert run.counters["rejected_steps"] == 0
    energy = run.energy - run.energy[0]
    assert np.abs(energy).max() < 1e-3 * np.ptp(run.kinetic_energy)
    halves = np.array_split(np.abs(energy), 2)
    assert halves[1].max() < 2.0 * halves[0].max()


@pytest.mark.parametrize("k", [1e3, 1e6, 1e9, 1e12])
def test_radau_swings_right_however_stiff(k):
    """The method chooses its steps. `test_verify` has given ones."""
    t, reference = case("stiff_spring_pendulum")
    mech, q = stiff_pendulum(k)
    done = pg.simulate(mech, q, t_end=2.0, t_eval=t, method="radau5", rtol=1e-8)
    assert done.status.ok
    assert worst(done.q[:, 0], swing(reference, k)) < 1e-8
    assert done.counters["steps"] < 1000


@pytest.mark.parametrize("tau", [None, [1.0, 0.0], lambda t, q, v: np.array([1.0, 0.0])])
def test_torques_of_any_form_leave_the_method_that_stiff_forces_need(tau):
    """With a function, dop853 took 500 times as many steps."""
    mech, q = stiff_pendulum(1e12)
    run = pg.simulate(mech, q, t_end=0.2, tau=tau, estimate=False)
    assert run.header["method"] == "radau5"
    at_steps = pg.simulate(mech, q, t_end=0.02, step=1e-3, tau=tau, method="rk4", estimate=False)
    assert any("radau5" in text for text in at_steps.notices)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "dopri5", "dop853"])
def test_steps_too_wide_for_an_explicit_method_are_reported(method):
    """The limit is that of the method. A run 20 % above it fails or knows its error."""
    mech, q = stiff_pendulum(1e6)
    q = q + np.array([0.0, 1e-9])
    limit = METHODS[method].limit / 1e3
    options = {"method": method, "frames": 2}
    calm = pg.simulate(mech, q, t_end=500 * limit, step=0.9 * limit, **options)
    wild = pg.simulate(mech, q, t_end=500 * limit, step=1.2 * limit, **options)
    assert calm.status.ok
    assert all("energy balance" in notice for notice in calm.notices)
    assert any("radau5" in notice for notice in wild.notices)
    fine = pg.simulate(mech, q, t_end=500 * limit, t_eval=wild.t, rtol=1e-12, estimate=False)
    assert not wild.status.ok or wild.error_estimate > 0.2 * worst(wild.q, fine.q)


@pytest.mark.parametrize("method", EXPLICIT)
def test_steps_end_at_the_corners_of_tables(method):
    table = pg.Table(t=(0.0, 0.11, 0.2, 0.37, 0.5), value=(0.0, 3.0, -2.0, 4.0, 0.0))
    motor = pg.Motor(name="motor", body="a", torque=table)
    model = pg.Model(bodies=(mass("a", damping=0.3, stiffness=2.0),), forces=(motor,), **DOWN)
    loose, tight = (
        pg.simulate(model, t_end=0.6, method=method, rtol=rtol) for rtol in (1e-8, 1e-13)
    )
    assert loose.counters["rejected_steps"] <= 2
    assert worst(loose.q, tight.q) < 1e-8
    assert tight.dissipation[-1] > 1e-2
    assert loose.energy_drift < 1e-6
    assert tight.energy_drift < 1e-11


def spinning_chain():
    """A ball joint that carries a slide and a hinge: no part of M is constant."""
    top = {"name": "top", "joint": "spherical", "com": (0, 0, 0.3), "v": (0.4, 0.2, 3.0)}
    bead = {"name": "bead", "joint": "prismatic", "axes": (1, 0, 0), "link": (0, 0, 0.3)}
    arm = {"name": "arm", "axes": (0, 1, 0), "link": (0, 0, 0.5), "com": (0, 0, -0.2), "v": 2.0}
    bodies = (
        pg.Body(mass=1.0, inertia=np.diag([0.05, 0.06, 0.03]), **top),
        pg.Body(parent="top", mass=0.3, inertia=0.01 * np.eye(3), stiffness=40.0, q=0.05, **bead),
        pg.Body(parent="top", mass=0.4, inertia=np.diag([0.01, 0.01, 0.002]), **arm),
    )
    return pg.Mechanism(pg.Model(bodies=bodies))


def test_the_symplectic_method_keeps_the_energy_where_others_lose_it():
    """Over 500 s the error of gauss6 is bounded, and that of rk4 grows."""

    def ends(method):
        options = {"t_end": 5e2, "frames": 1001, "estimate": False, "step": 0.1}
        run = pg.simulate(double_pendulum(), [0.5, 0.2], method=method, **options)
        off = np.abs(run.energy - run.energy[0]) / np.ptp(run.potential_energy)
        return off[:100].max(), off[-100:].max()

    first, last = ends("gauss6")
    assert last < min(1.5 * first, 1e-7)
    first, last = ends("rk4")
    assert last > 3 * first


def test_a_step_of_the_symplectic_method_is_symplectic():
    """Dᵀ Ω D = Ω in coordinates (ξ, p = M v), by differences of a step of a ball and two joints."""
    mech, h, move = spinning_chain(), 0.02, 1e-5
    q0, v0 = mech.home()

    def bend(xi, p):
        return 0.5 * np.concatenate((np.cross(p[:3], xi[:3]), np.zeros(2)))

    def image(z):
        xi, p = z[:5], z[5:]
        q = moved(mech.model, q0, xi)
        v = np.linalg.solve(mech.mass_matrix(q), p - bend(xi, p))
        run = pg.simulate(mech, q, v, t_end=h, step=h, method="gauss6", frames=2, estimate=False)
        return run.q[-1], run.v[-1]

    start = np.concatenate((np.zeros(5), mech.mass_matrix(q0) @ v0))
    q1, _ = image(start)

    def chart(z):
        q, v = image(z)
        xi, p = apart(mech, q1, q), mech.mass_matrix(q) @ v
        return np.concatenate((xi, p + bend(xi, p)))

    steps = move * np.eye(10)
    D = np.array([chart(start + step) - chart(start - step) for step in steps]).T / (2 * move)
    omega = np.block([[np.zeros((5, 5)), np.eye(5)], [-np.eye(5), np.zeros((5, 5))]])
    assert np.abs(D.T @ omega @ D - omega).max() < 1e-7


@pytest.mark.parametrize("step", [0.02, 1e-3])
@pytest.mark.parametrize("start", [0.0, -0.0981])
def test_gauss_steps_go_on_where_motion_comes_to_rest_under_load(step, start):
    held = {"stiffness": 100.0, "damping": 10.0, "q": start}
    body = pg.Body(name="a", joint="prismatic", axes=(0, 0, 1), **held)
    given = {"t_end": 10.0, "method": "gauss6", "step": step, "estimate": False}
    run = pg.simulate(pg.Model(bodies=[body]), **given)
    assert run.status is pg.Status.DONE
    assert abs(run.q[-1, 0] + 0.0981) < 1e-13
