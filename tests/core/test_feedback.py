"""State feedback: gains against SciPy's Riccati solution, closed loops against SciPy's runs."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

import pgraph_core as pg

G = 9.81
X, Z = (1, 0, 0), (0, 0, 1)


def cart_pole(m=0.2, l=0.5, i=0.017, cart=1.0):  # noqa: E741 — as in the equations
    bodies = [
        pg.Body(name="cart", joint="prismatic", axes=[X], mass=cart),
        pg.Body(name="pole", parent="cart", axes=[Z], mass=m, com=(0, l, 0), inertia=(i, 1e-3, i)),
    ]
    model = pg.Model(bodies=bodies, gravity=(0, -G, 0), forces=[pg.Motor(name="push", body="cart")])

    def rates(x, theta, v, w, u):
        M = np.array([[cart + m, -m * l * np.cos(theta)], [-m * l * np.cos(theta), i + m * l * l]])
        return M, np.array([u - m * l * np.sin(theta) * w * w, m * G * l * np.sin(theta)])

    return model, rates, ("cart", "pole"), (0.0, 0.15)


def wheeled(m=1.0, l=0.4, i=0.05, wheel=0.5, r=0.1, spin=0.004):  # noqa: E741
    """A rod on an axle whose wheel rolls; the motor turns the wheel against the rod."""
    bodies = [
        pg.Body(name="axle", joint="prismatic", axes=[X], mass=0.3),
        pg.Body(name="rod", parent="axle", axes=[Z], mass=m, com=(0, l, 0), inertia=(i, 1e-3, i)),
        pg.Body(name="wheel", parent="axle", axes=[Z], mass=wheel, inertia=(spin, spin, spin)),
    ]
    rolls = pg.Coupling(name="rolls", coefficients={"axle": 1.0, "wheel": r})
    motor = pg.Motor(name="push", body="wheel", coefficients={"wheel": 1.0, "rod": -1.0})
    model = pg.Model(bodies=bodies, gravity=(0, -G, 0), forces=[motor], constraints=[rolls])

    def rates(x, theta, v, w, u):
        heavy = 0.3 + wheel + spin / r**2 + m
        M = np.array([[heavy, -m * l * np.cos(theta)], [-m * l * np.cos(theta), i + m * l * l]])
        return M, np.array([-u / r - m * l * np.sin(theta) * w * w, m * G * l * np.sin(theta) - u])

    return model, rates, ("axle", "rod"), (0.0, 0.1)


def ball_on_beam(m=0.1, r=0.02, beam=0.05):
    """A ball rolls on top of a beam that a motor tilts."""
    j = 0.4 * m * r * r
    bodies = [
        pg.Body(name="beam", axes=[Z], mass=1.0, inertia=(1e-3, beam, beam)),
        pg.Body(
            name="seat", parent="beam", joint="prismatic", axes=[X], link=(0, r, 0), mass=0.0,
            inertia=(0, 0, 0),
        ),
        pg.Body(name="ball", parent="seat", axes=[Z], mass=m, inertia=(j, j, j)),
    ]  # fmt: skip
    rolls = pg.Coupling(name="rolls", coefficients={"seat": 1.0, "ball": r})
    model = pg.Model(
        bodies=bodies, gravity=(0, -G, 0), constraints=[rolls],
        forces=[pg.Motor(name="push", body="beam")],
    )  # fmt: skip

    def rates(s, theta, v, w, u):
        across = -m * r - j / r
        M = np.array([[m + j / r**2, across], [across, beam + m * r * r + m * s * s + j]])
        sin, cos = np.sin(theta), np.cos(theta)
        tilt = u - 2 * m * s * v * w - m * G * (s * cos - r * sin)
        return M, np.array([m * s * w * w - m * G * sin, tilt])

    return model, rates, ("seat", "beam"), (0.1, 0.0)


PLANTS = [cart_pole, wheeled, ball_on_beam]
WEIGHTS = np.array([1.0, 10.0, 0.5, 2.0])


def slope(of, k):
    """The derivative of of(y), y = (place, angle, rates, u) = 0, by complex steps where exact."""
    h = 1e-3
    e = np.eye(5)[k]
    odd = [of(*(n * h * e)) - of(*(-n * h * e)) for n in (1, 2, 3)]
    return (45 * odd[0] - 9 * odd[1] + odd[2]) / (60 * h)


def linear(rates):
    def acceleration(*y):
        return np.linalg.solve(*rates(*y))

    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    A[2:] = np.array([slope(acceleration, k) for k in range(4)]).T
    B[2:, 0] = slope(acceleration, 4)
    return A, B


def names_of(chosen):
    return [f"{group}.{name}" for group in "qv" for name in chosen]


@pytest.mark.parametrize("plant", PLANTS)
def test_gains_are_those_of_the_riccati_equation(plant):
    model, rates, chosen, _ = plant()
    A, B = linear(rates)
    P = solve_continuous_are(A, B, np.diag(WEIGHTS), [[0.3]])
    names = names_of(chosen)
    found = pg.lqr(model, WEIGHTS, 0.3, states=chosen)
    wanted = B.T @ P / 0.3
    assert found.states == tuple(names)
    assert np.allclose(found.K, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
    assert found.stable
    assert np.allclose(
        np.sort_complex(found.poles), np.sort_complex(np.linalg.eigvals(A - B @ wanted)), rtol=1e-7
    )


@pytest.mark.parametrize("plant", PLANTS)
def test_the_closed_loop_moves_as_in_scipy(plant):
    model, rates, chosen, start = plant()
    found = pg.lqr(model, WEIGHTS, 0.3, states=chosen)
    gains = found.K[0]

    def rate(t, y):
        return (*y[2:], *np.linalg.solve(*rates(*y, -gains @ y)))

    wanted = solve_ivp(rate, (0, 2), (*start, 0, 0), rtol=1e-11, atol=1e-12, method="DOP853")
    mech = pg.Mechanism(found.model)
    q = np.zeros(mech.nq)
    for name, x in zip(chosen, start, strict=True):
        q[mech.joints[name].q] = x
    for c in model.constraints:  # what rolls
        (first, (by,)), (last, (radius,)) = c.coefficients.items()
        q[mech.joints[last].q] = -by * q[mech.joints[first].q] / radius
    run = pg.simulate(found.model, t_end=2.0, q=q, rtol=1e-10)
    assert run.status.ok
    at = [mech.joints[name].q.start for name in chosen]
    assert np.allclose(run.q[-1, at], wanted.y[:2, -1], rtol=0, atol=1e-7)
    again = pg.Model.from_json(found.model.to_json())
    assert again == found.model
    assert np.linalg.eigvals(pg.Mechanism(again).linearise().A).real.max() < 0


@pytest.mark.parametrize("drives", [(), (pg.Motor(name="push", body="cart"),)])
@pytest.mark.parametrize("word", ["tau", "controller"])
def test_a_feedback_is_given_as_torques(drives, word):
    bare = cart_pole()[0].replace(forces=drives)
    found = pg.lqr(bare, 1.0, inputs=["cart"])
    there = {"q": found.at[:2] + 0.1, "v": np.zeros(2)}
    wanted = pg.simulate(found.model, t_end=0.2, step=1e-3, **there)
    run = pg.simulate(bare, t_end=0.2, step=1e-3, **there, **{word: found})
    assert np.array_equal(run.q, wanted.q)
    stepper = pg.Stepper(bare, tau=found, step=1e-3, **there)
    for _ in range(200):
        stepper.step()
    assert np.allclose(stepper.q, run.q[-1], rtol=0, atol=1e-12)


def test_the_closed_loop_has_the_poles_asked_for():
    poles = [-2.0, -3.0, -4 + 1j, -4 - 1j]
    found = pg.place_poles(cart_pole()[0], poles)
    assert np.allclose(np.sort_complex(found.poles), np.sort_complex(poles), rtol=1e-9)
    closed = np.linalg.eigvals(pg.Mechanism(found.model).linearise().A)
    assert np.allclose(np.sort_complex(closed), np.sort_complex(poles), rtol=1e-6)


def test_an_arm_is_held_where_gravity_pulls():
    """Two inputs by servos and geared motors; the inputs hold what pulls at the state."""
    bodies = [
        pg.Body(name="arm", axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2)),
        pg.Body(
            name="fore arm", parent="arm", axes=[Z], link=(1, 0, 0), com=(0.3, 0, 0),
            inertia=(0.1, 0.1, 0.1),
        ),
    ]  # fmt: skip
    forces = [
        pg.Motor(name="shoulder", body="arm", gear=-3.0),
        pg.Servo(name="elbow", body="fore arm", kp=20.0, kd=1.0),
    ]
    model = pg.Model(bodies=bodies, gravity=(0, -G, 0), forces=forces)
    found = pg.lqr(model, 1.0, [1.0, 2.0], q=[0.4, -0.7])
    assert 'v["fore arm"]' in found.states
    again = pg.lqr(found.model, np.eye(4), np.diag([1.0, 2.0]), q=[0.4, -0.7])
    assert np.allclose(again.K, found.K, rtol=1e-12)  # what a drive had before does not count
    run = pg.simulate(found.model, t_end=8.0, q=[0.45, -0.8], rtol=1e-8)
    assert np.allclose(run.q[-1], (0.4, -0.7), atol=1e-4)


@pytest.mark.parametrize(
    ("call", "facts"),
    [
        (lambda m: pg.lqr(m, {"q.cart": 1.0, "q.pol": 1.0}), ("Q", "'q.pol'", "q.pole")),
        (lambda m: pg.lqr(m, [1.0, 2.0]), ("Q", "4 numbers")),
        (lambda m: pg.lqr(m, 1.0, "much"), ("R", "'much'")),
        (lambda m: pg.lqr(m, 1.0, inputs=["pull"]), ("inputs", "'pull'", "push")),
        (lambda m: pg.lqr(m.replace(forces=[]), 1.0, inputs=[]), ("inputs", "motor")),
        (lambda m: pg.lqr(m, 1.0, q=[0.0, 0.5]), ("q", "equilibrium")),
        (lambda m: pg.lqr(m, 1.0, states=["pole"]), ("states", "2 coordinates", "cart, pole")),
        (lambda m: pg.lqr(m, 1.0, states=["pole", "car"]), ("states", "'car'", "cart")),
        (lambda m: pg.place_poles(m, [-1, -2]), ("poles", "4")),
        (lambda m: pg.place_poles(m, [-1, -1, -1, -1]), ("poles",)),
    ],
)
def test_what_cannot_be_controlled_is_refused(call, facts):
    with pytest.raises(pg.InputError) as refused:
        call(cart_pole()[0])
    assert all(fact in str(refused.value) for fact in facts)


def test_an_unstable_motion_that_no_input_moves_is_named():
    model = cart_pole()[0]
    other = pg.Body(name="other", axes=[Z], mass=1.0, com=(0, 1, 0), inertia=(0.1, 0.1, 0.1))
    with pytest.raises(pg.InputError, match="other"):
        pg.lqr(model.add(other), 1.0)


def test_an_undamped_motion_that_no_input_moves_is_not_stable():
    inertia = np.eye(3) * 0.01
    cart = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], mass=2.0, damping=0.3)
    pole = pg.Body(name="pole", parent="cart", axes=[(0, 0, 1)], com=(0, 0.5, 0), inertia=inertia)
    wheel = pg.Body(name="wheel", axes=[(0, 0, 1)], link=(3, 0, 0), inertia=inertia, stiffness=1.0)
    motor = pg.Motor(name="push", body="cart")
    for bodies in ([wheel, cart, pole], [cart, pole, wheel]):
        model = pg.Model(bodies=bodies, gravity=(0, -9.81, 0), forces=[motor])
        try:
            assert not pg.lqr(model, {"q.cart": 1.0, "q.pole": 10.0}, 0.1).stable
        except pg.InputError:
            continue


@pytest.mark.parametrize(
    ("Q", "R", "facts"),
    [
        ([1, -10, 1, 1], 1.0, ("Q", "-10")),
        (np.diag([1.0, 1, 1, 1]) + 3 * np.eye(4, k=1), 1.0, ("Q", "symmetric")),
        (1.0, 0.0, ("R", "above 0")),
        (1.0, -2.0, ("R", "-2")),
    ],
)
def test_a_goal_without_a_least_value_is_refused(Q, R, facts):
    with pytest.raises(pg.InputError) as refused:
        pg.lqr(cart_pole()[0], Q, R)
    assert all(fact in str(refused.value) for fact in facts)


@pytest.mark.parametrize("v", [0.0, 0.5])
def test_joint_friction_that_holds_is_told(v):
    """It has no slope at rest, where a linear model takes it for a damper."""
    model = cart_pole()[0].edit("cart", friction=1.0)
    found = pg.Mechanism(model).linearise(v=[v, 0.0])
    assert any("friction" in text and "cart" in text for text in found.notices) == (v == 0)
    assert any("friction" in text for text in pg.lqr(model, 1.0).notices)
    assert not pg.lqr(cart_pole()[0], 1.0).notices


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    ("law", "bent"),
    [
        ("if(v.pole > 0, -1, 1)", True), ("abs(q.pole)", True), ("max(0, v.pole)", True),
        ("sqrt(abs(q.pole))", True), ("3*cos(20*q.pole) + exp(q.pole)", False),
        ("-2*v.pole*abs(v.pole)", False), ("max(0, q.pole - 1)", False),
        ("min(q.pole, 1)^3", False),
    ],
)  # fmt: skip
def test_a_force_without_a_slope_is_told(law, bent, size):
    """At a corner or a jump of an expression the sides have different slopes, or none."""
    load = pg.Wrench(name="load", body="pole", torque=[0, 0, f"={size}*({law})"])
    found = pg.Mechanism(cart_pole()[0].add(load)).linearise()
    assert any(text.startswith("pole:") and "corner" in text for text in found.notices) == bent


def test_loads_of_time_are_told_and_held_as_they_begin():
    load = pg.Wrench(name="load", body="cart", force=["=7 + t", 0, 0])
    found = pg.lqr(cart_pole()[0].add(load), 1.0)
    assert np.isclose(found.hold[0], -7.0, rtol=1e-12)
    (told,) = found.notices  # and no "not in equilibrium": both loads balance
    assert "t = 0" in told
