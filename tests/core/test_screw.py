"""The screw joint: one degree of freedom that turns and slides, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.model.body import Body
from pgraph_core.paper import Operators

from .rescaling import rescaled

G = 9.81
PITCH = 0.3  # [m a turn]


def nut(pitch: float = PITCH, **fields) -> Body:
    """A nut on a vertical thread, off its axis."""
    given = {"axes": (0, 0, 1), "mass": 2.0, "com": (0.1, 0, 0), "inertia": (0.02, 0.03, 0.04)}
    return pg.Body(**{"name": "nut", "joint": "screw", "pitch": pitch, **given, **fields})


def fall(pitch: float) -> float:
    """q'' of the nut: m p g = -(I + m p²) q'' with the pitch p a radian."""
    p, inertia = pitch / (2 * math.pi), 0.04 + 2.0 * 0.1**2
    return -2.0 * p * G / (inertia + 2.0 * p * p)


@pytest.mark.parametrize("pitch", [PITCH, -PITCH, 1e-3, 50.0])
@pytest.mark.parametrize("method", ["rk4", "dop853", "gauss6", "radau5", "semi_implicit_euler"])
def test_a_nut_falls_as_the_closed_form_says(pitch, method):
    given = {"t_end": 0.5, "method": method, "estimate": False}
    run = pg.simulate(pg.Model(bodies=[nut(pitch)]), **given)
    late = run.header["step"] if method == "semi_implicit_euler" else 0.0  # h n (n + 1) / 2
    expected = 0.5 * fall(pitch) * run.t * (run.t + late)
    np.testing.assert_allclose(run.q[:, 0], expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.body_pose[:, 0, 2], pitch / math.tau * run.q[:, 0], rtol=1e-9)


def chain(joint: str) -> pg.Model:
    """A screw, or a cylindrical joint with a coupling, between two hinges out of line."""
    common = {"mass": 1.0, "inertia": (0.02, 0.03, 0.04), "com": (0.1, 0.05, 0.2)}
    arm = pg.Body(name="arm", axes=(0.2, 1, 0.1), **common)
    screw = nut(parent="arm", link=(0.3, 0.1, 0), axes=(1, 0.3, 0.2), **common)
    if joint != "screw":
        screw = pg.Body(name="nut", joint="cylindrical", parent="arm", link=(0.3, 0.1, 0),
                        axes=[(1, 0.3, 0.2)] * 2, **common)  # fmt: skip
    hand = pg.Body(name="hand", parent="nut", link=(0, 0.2, 0), axes=(0, 1, 1), **common)
    tie = pg.Coupling(name="thread", body="nut", coefficients={"nut": (-PITCH / math.tau, 1.0)})
    return pg.Model(bodies=[arm, screw, hand], constraints=[] if joint == "screw" else [tie])


def test_a_screw_moves_as_a_cylindrical_joint_with_a_coupling():
    given = {"t_end": 1.0, "method": "dop853", "rtol": 1e-12, "estimate": False, "frames": 11}
    one = pg.simulate(chain("screw"), v=[1.0, 4.0, -2.0], **given)
    slide = 4.0 * PITCH / math.tau
    other = pg.simulate(chain("both"), v=[1.0, 4.0, slide, -2.0], **given)
    np.testing.assert_allclose(one.q, other.q[:, [0, 1, 3]], atol=1e-8)
    np.testing.assert_allclose(one.energy, one.energy[0], rtol=1e-9)


def test_dynamics_of_a_tree_with_a_screw_agree_with_each_other():
    """M, C, Jacobians, derivatives and the paper's operators."""
    mech = pg.Mechanism(chain("screw"))
    rng = np.random.default_rng(1)
    q, v, tau = rng.normal(size=(3, mech.nv))
    vdot = mech.forward_dynamics(q, v, tau)
    np.testing.assert_allclose(mech.inverse_dynamics(q, v, vdot), tau, atol=1e-12)
    M, C = mech.mass_matrix(q), mech.bias_force(q, v)
    np.testing.assert_allclose(M @ vdot + C, tau, atol=1e-12)
    ops = Operators(mech.model, mech.topology, q, v)
    np.testing.assert_allclose(ops.mass_matrix, M, atol=1e-12)
    np.testing.assert_allclose(ops.bias_force, C, atol=1e-11)
    kinetic = mech.energy(q, v)[0]
    assert kinetic == pytest.approx(0.5 * v @ M @ v, rel=1e-13)
    by_q, by_v, _ = mech.forward_derivatives(q, v, tau)
    h, each = 1e-6, np.eye(mech.nv)
    for k, e in enumerate(each):
        moved = [mech.forward_dynamics(q + s * h * e, v, tau) for s in (1, -1)]
        faster = [mech.forward_dynamics(q, v + s * h * e, tau) for s in (1, -1)]
        np.testing.assert_allclose(
            by_q[:, k], (moved[0] - moved[1]) / (2 * h), rtol=1e-6, atol=1e-6
        )
        np.testing.assert_allclose(
            by_v[:, k], (faster[0] - faster[1]) / (2 * h), rtol=1e-6, atol=1e-6
        )


def test_a_loop_with_a_screw_has_one_degree_of_freedom():
    """A vice: a screw drives a slider, tied at a point that may turn."""
    slider = pg.Body(name="slider", joint="prismatic", axes=(0, 0, 1), mass=3.0)
    tie = pg.Plane(name="tie", body="nut", other="slider", axis=(0, 0, 1))
    model = pg.Model(bodies=[nut(com=(0, 0, 0)), slider], constraints=[tie])
    assert pg.Mechanism(model).mobility().dof == 1
    run = pg.simulate(model, t_end=0.3, method="dop853", rtol=1e-11, estimate=False)
    p = PITCH / math.tau
    rate = -(2.0 + 3.0) * p * G / (0.04 + (2.0 + 3.0) * p * p)
    np.testing.assert_allclose(run.q[:, 0], 0.5 * rate * run.t**2, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(run.q[:, 1], p * run.q[:, 0], atol=1e-9)


def test_a_nut_that_falls_on_the_ground_stops_there():
    foot = {"kind": "sphere", "radius": 0.1, "role": "both"}
    body = nut(link=(0, 0, 0.3), com=(0, 0, 0), shape=foot)
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="floor", body="nut", friction=0.0)])
    run = pg.simulate(model, t_end=2.0, step=1e-3)
    height = 0.3 + PITCH / math.tau * run.q[-1, 0]
    assert height == pytest.approx(0.1, abs=1e-6)


def test_a_reflected_thread_is_of_the_other_hand():
    model = pg.Model(bodies=[pg.Body(name="frame"), nut(parent="frame")])
    there = model.mirror("nut", plane="x").bodies[-1]
    assert there.pitch == (-PITCH,)


def test_a_screw_is_scaled_with_its_model():
    run = pg.simulate(pg.Model(bodies=[nut()]), t_end=0.4, method="rk4", step=0.01)
    small = rescaled(pg.Model(bodies=[nut()]), length=1e-3)
    again = pg.simulate(small, t_end=0.4, method="rk4", step=0.01)
    np.testing.assert_allclose(again.q, run.q, rtol=1e-11)


@pytest.mark.parametrize(
    ("fields", "facts"),
    [({"pitch": 0.0}, "0"), ({"joint": "revolute"}, "0.3"), ({"pitch": math.nan}, "nan")],
)
def test_a_pitch_belongs_to_a_screw(fields, facts):
    with pytest.raises(pg.ModelError, match=f"pitch.*{facts}"):
        nut(**fields)


def test_a_file_keeps_a_screw_and_other_formats_refuse_it(tmp_path):
    model = pg.Model(bodies=[nut()])
    assert pg.Model.from_json(model.to_json()) == model
    for write, name in ((pg.write_mjcf, "a.xml"), (pg.write_urdf, "a.urdf")):
        with pytest.raises(pg.ModelError, match=r"'nut', joint.*screw"):
            write(model, tmp_path / name)


@pytest.mark.parametrize("pitch", [0.1, -0.02, (0.1,)])
def test_one_pitch_is_that_of_the_screws_of_a_compound(pitch):
    motions = [("rotate", (1, 0, 0)), ("screw", (0, 0, 1)), ("translate", (1, 0, 0))]
    body = pg.Body(name="nut", joint="compound", motions=motions, pitch=pitch)
    assert body.pitch == (0.0, np.ravel(pitch)[0], 0.0)
