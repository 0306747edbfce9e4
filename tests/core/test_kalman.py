"""Steady Kalman filters: closed forms, the Riccati equation, and errors of simulated samples."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.result.measured import errors

from ..refusals import assert_names, refusal


def cart(density=1e-3, sample=0.01, mass=2.0, kind="joint_position", **fields):
    body = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], mass=mass)
    noisy = pg.Imperfect(sample=sample, density=density, **fields)
    place = pg.Output(name="place", kind=kind, at="cart", imperfect=noisy)
    return pg.Model(bodies=[body], outputs=[place], gravity=(0, 0, 0))


def pole():
    base = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)])
    rod = pg.Body(name="rod", parent="cart", axes=[(0, 1, 0)], com=(0, 0, 0.5), q=(0.0,))
    encoder = pg.Imperfect(sample=0.01, quantum=2e-3, density=1e-4)
    outputs = [
        pg.Output(name="place", kind="joint_position", at="cart", imperfect=encoder),
        pg.Output(name="gyro", kind="gyro", at="rod", imperfect={"sample": 0.01, "density": 2e-3}),
    ]
    return pg.Model(bodies=[base, rod], outputs=outputs)


def test_a_double_integrator_has_the_matrices_and_the_riccati_equation_in_closed_form():
    h, q = 0.01, (0.3 / 2.0) ** 2
    found = pg.kalman(cart(), "place", 0.3)
    assert np.allclose(found.A, [[1, h], [0, 1]], rtol=0, atol=1e-12)
    assert np.allclose(found.B.ravel(), [h * h / 4, h / 2], rtol=0, atol=1e-12)
    Q = q * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    assert np.abs(found.Q - Q).max() < 1e-10 * Q.max()
    P, r = found.predicted, 1e-3**2 / h
    assert np.allclose(found.C, [[1, 0]], rtol=0, atol=1e-11)
    K = P[:, 0] / (P[0, 0] + r)
    assert np.allclose(found.K[:, 0], K, rtol=1e-10)
    after = P - np.outer(K, P[0])
    A = np.array([[1, h], [0, 1]])
    assert np.abs(A @ after @ A.T + Q - P).max() < 1e-10 * P.max()
    assert np.abs(found.covariance - after).max() < 1e-10 * P.max()


def test_many_samples_are_the_filter_of_continuous_measurements():
    """P = [[√2 r^(3/4) q^(1/4), √(r q)], [√(r q), √2 r^(1/4) q^(3/4)]] for densities q and r."""
    q, r, size = (0.3 / 2.0) ** 2, 1e-3**2, np.sqrt(2.0)
    wanted = [
        [size * r**0.75 * q**0.25, (r * q) ** 0.5],
        [(r * q) ** 0.5, size * r**0.25 * q**0.75],
    ]
    off = [
        np.abs(pg.kalman(cart(sample=h), "place", 0.3).covariance / wanted - 1.0).max()
        for h in (1e-3, 1e-4)
    ]
    assert off[1] < 0.01
    assert off[1] < 0.11 * off[0]


def test_errors_of_a_cart_pole_have_the_covariance_of_the_filter():
    """LQG: 1000 runs with the noise of their outputs, beside the solution of Riccati's equation."""
    model, runs, steps = pole(), 1000, 101
    found = pg.kalman(model, ["place", "gyro"], {"cart": 0.2, "rod": 0.05})
    lqr = pg.lqr(model, 1.0, 0.1)
    noise = np.zeros((runs, steps, len(found.outputs)))
    for j, name in enumerate(found.outputs):
        head, _, part = name.partition(".")
        given = next(o.imperfect for o in model.outputs if o.name == head)
        for k in range(runs):
            seeded = given.model_copy(update={"seed": k})
            noise[k, :, j] = errors(seeded, f"{head}\0{part}", 0, steps - 1)
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(found.Q + 1e-30 * np.eye(4))
    begun = np.linalg.cholesky(found.predicted)  # the errors are stationary from the start
    x, guess = rng.normal(size=(runs, 4)) @ begun.T, np.zeros((runs, 4))
    total, count, inside = np.zeros((4, 4)), 0, []
    inverse = np.linalg.inv(found.covariance)
    for k in range(steps):
        quantised = x @ found.C.T + noise[:, k]
        place = found.outputs.index("place")
        quantised[:, place] = 2e-3 * np.rint(quantised[:, place] / 2e-3)
        guess = guess + (quantised - guess @ found.C.T) @ found.K.T
        if k % 10 == 0:
            off = x - guess
            total, count = total + off.T @ off, count + runs
            inside.append(np.mean(np.einsum("ni,ij,nj->n", off, inverse, off) < 9.488))  # 95 %
        torques = -guess @ np.asarray(lqr).T
        x = x @ found.A.T + torques @ found.B.T + rng.normal(size=(runs, 4)) @ root.T
        guess = guess @ found.A.T + torques @ found.B.T
    shares = np.diag(total / count) / np.diag(found.covariance)
    assert np.abs(shares - 1.0).max() < 0.05
    assert 0.93 < np.mean(inside) < 0.97


def test_what_the_filter_does_not_know_is_told():
    (text,) = pg.kalman(cart(bias=0.1, correlation=5.0, latency=0.01), "place", 1.0).notices
    assert_names(text, "'place'", "latency", "bias")
    assert not pg.kalman(cart(), "place", 1.0).notices


def test_refusals():
    def refused(make, *facts):
        assert_names(str(refusal(make)), *facts)

    refused(lambda: pg.kalman(cart(), "plaice", 1.0), "plaice", "place")
    refused(lambda: pg.kalman(cart(), [], 1.0), "outputs", "place")
    refused(lambda: pg.kalman(cart(density=0.0), "place", 1.0), "place", "density", "quantum")
    refused(lambda: pg.kalman(cart(kind="accelerometer"), "place", 1.0), "accelerometer", "veloc")
    refused(lambda: pg.kalman(cart(), "place", -1.0), "disturbance", "-1")
    refused(lambda: pg.kalman(cart(), "place", {"card": 1.0}), "card", "cart")
    refused(lambda: pg.kalman(cart(), "place", "much"), "disturbance", "much")
    refused(lambda: pg.kalman(cart(kind="joint_velocity"), "place", 1.0), "outputs", "q.cart")
    one = pole()
    two = one.edit("gyro", imperfect={"sample": 0.02, "density": 1.0})
    refused(lambda: pg.kalman(two, ["place", "gyro"], 1.0), "0.02 s", "0.01 s", "place")
    refused(lambda: pg.kalman(one, ["place"], 1.0, q=[0.0, 0.5]), "equilibrium")


def two_carts():
    other = pg.Body(name="other", joint="prismatic", axes=[(0, 1, 0)])
    return cart().add(other)


def test_only_states_that_no_output_shows_are_named():
    text = str(refusal(lambda: pg.kalman(two_carts(), "place", 1.0)))
    assert_names(text, "outputs", "q.other", "v.other")
    assert "q.cart" not in text
    assert "v.cart" not in text
    text = str(refusal(lambda: pg.kalman(cart(kind="joint_velocity"), "place", 1.0)))
    assert_names(text, "q.cart")
    assert "v.cart" not in text


def test_states_that_nothing_disturbs_are_named():
    at = pg.Output(
        name="at", kind="joint_position", at="other", imperfect=cart().outputs[0].imperfect
    )
    model = two_carts().add(at)
    text = str(refusal(lambda: pg.kalman(model, ["place", "at"], {"cart": 1.0})))
    assert_names(text, "disturbance", "q.other", "v.other")
    assert "q.cart" not in text


def test_hidden_states_that_decay_need_no_output():
    other = pg.Spring(name="pull", body="other", stiffness=4.0, damping=1.0)
    found = pg.kalman(two_carts().add(other), "place", 1.0)
    assert np.isfinite(found.K).all()


@pytest.mark.parametrize("kind", ["position", "velocity", "velocimeter", "subtree_position"])
def test_outputs_of_frames_are_differentiated(kind):
    found = pg.kalman(
        cart(kind=kind).add(cart().outputs[0].model_copy(update={"name": "x"})), ["place", "x"], 1.0
    )
    row = [1, 0] if kind.endswith("position") else [0, 1]
    assert np.allclose(found.C[0], row, rtol=0, atol=1e-10)


def test_the_state_of_a_filter_is_that_of_the_coordinates_it_names():
    noise = pg.Imperfect(sample=0.01, density=1e-3)
    a, b = (
        pg.Body(name=name, axes=[(0, 1, 0)], inertia=(0.1,) * 3, q=(q,))
        for name, q in (("a", 0.0), ("b", 1.0))
    )
    law = pg.Relation(name="law", body="b", other="a", curve="=1+2*q.a")
    outputs = [pg.Output(name=f"o{x}", kind="joint_position", at=x, imperfect=noise) for x in "ab"]
    model = pg.Model(bodies=[a, b], constraints=[law], outputs=outputs, gravity=(0, 0, 0))
    found = pg.kalman(model, ["oa", "ob"], 0.1)
    now = {"q.a": 0.0, "q.b": 1.0, "v.a": 0.0, "v.b": 0.0}
    np.testing.assert_allclose(found.at, [now[name] for name in found.states], atol=1e-12)


def test_an_expression_that_reads_an_imperfect_output_is_told():
    noise = pg.Imperfect(sample=0.01, density=1e-3)
    angle = pg.Output(name="angle", kind="joint_position", at="rod", imperfect=noise)
    drive = pg.Motor(name="drive", body="rod", torque="=-1.0*out.angle")
    run = pg.simulate(pg.load("pendulum").add(angle).add(drive), t_end=0.1)
    assert any("'drive'" in text and "'angle'" in text for text in run.notices)
