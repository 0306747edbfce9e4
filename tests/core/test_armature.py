"""Armature and friction of ball and free joints: the same laws as for hinges and sliders."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from peers.mujoco import coordinates
from peers.rows import rows_of

from ..nights import combined
from ..random_models import random_state

ADDED = 0.3  # armature [kg m², kg]
LINKS = """<mujoco><worldbody>
 <body pos="0 0 1"><joint type="{root}" armature="{a}"/>
  <inertial pos=".1 .02 -.03" mass="2" diaginertia=".1 .2 .25"/>
  <body name="b" pos=".3 .1 0"><joint type="ball" armature="{b}"/>
   <inertial pos=".1 .1 .2" mass="1" diaginertia=".01 .02 .025"/>
   <body pos=".2 0 .3"><joint type="hinge" axis="0 1 0" armature=".03"/>
    <inertial pos=".1 0 .2" mass=".7" diaginertia=".01 .02 .025"/></body>
   <body pos=".2 0 -.3"><joint type="ball" armature="{b}"/>
    <inertial pos=".1 0 .2" mass=".7" diaginertia=".01 .02 .025"/></body>
  </body>
 </body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("root", ["ball", "free"])
@pytest.mark.parametrize(("a", "b"), [(0.0, 0.2), (0.3, 0.0), (5.0, 1e-3), (1e-6, 1e3)])
def test_accelerations_are_those_of_mujoco(tmp_path, root, a, b):
    mujoco = pytest.importorskip("mujoco")
    text = LINKS.format(root=root, a=a, b=b)
    (tmp_path / "a.xml").write_text(text)
    model, peer = pg.load(tmp_path / "a.xml"), mujoco.MjModel.from_xml_string(text)
    mech, data, rng = pg.Mechanism(model), mujoco.MjData(peer), np.random.default_rng(3)
    for _ in range(3):
        _, topology, q, v, tau, *_ = random_state(rng, model)
        data.qpos[:], turn = coordinates(rows_of(model, topology), q, v)
        data.qvel[:], data.qfrc_applied[:] = turn @ v, turn @ tau
        mujoco.mj_forward(peer, data)
        found, expected = mech.forward_dynamics(q, v, tau), turn.T @ data.qacc
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
        np.testing.assert_allclose(mech.inverse_dynamics(q, v, expected), tau, atol=1e-9 * (1 + b))
        mujoco.mj_energyVel(peer, data)
        assert mech.energy(q, v)[0] == pytest.approx(data.energy[1], rel=1e-12)


def two(root, inertia=(0.1, 0.2, 0.25), **more):
    """A body with a fast rotor or a ball on it, without gravity."""
    base: dict[str, Any] = {"name": "base", "joint": root, "mass": 2.0, "com": (0.05, 0.02, -0.03)}
    speeds = (2.0, -1.0, 0.5, 0.3, 0.2, 0.1)[: 3 if root == "spherical" else 6]
    return [pg.Body(**base, inertia=np.diag(inertia), v=speeds, **more)]


def beside(kind):
    """What the base carries, and what makes runs step in time: a slider that its friction holds."""
    held = pg.Body(name="held", joint="prismatic", friction=1.0)
    if kind == "none":
        return [held]
    turn: dict[str, Any] = (
        {"joint": "spherical", "v": (1.0, 2.0, 3.0)} if kind == "ball" else {"v": (300.0,)}
    )
    carried = pg.Body(
        name="c", parent="base", mass=0.5, link=(0.2, 0.1, 0), com=(0, 0, 0.1),
        inertia=np.diag((0.01, 0.012, 0.02)), **turn,
    )  # fmt: skip
    return [carried, held]


@pytest.mark.parametrize(
    ("root", "kind", "method"),
    combined(
        ["free", "spherical"], ["none", "rotor", "ball"],
        ["moreau_jean", "gauss6", "dop853", "radau5", "rk4"],
    ),
)  # fmt: skip
def test_armature_on_the_ground_is_a_body_without_weight(root, kind, method):
    """Of that mass and those moments, at the origin: without gravity both move alike.

    Time stepping follows them to its own error, the others to rounding.
    """
    solid = pg.Body(
        name="solid", parent="base", joint="weld", mass=ADDED, inertia=np.diag([ADDED] * 3)
    )
    models = [
        pg.Model(bodies=[*two(root, armature=(ADDED,)), *beside(kind)], gravity=(0, 0, 0)),
        pg.Model(bodies=[*two(root), solid, *beside(kind)], gravity=(0, 0, 0)),
    ]
    steps: dict[str, Any] = {"step": 1e-3} if method != "dop853" else {"rtol": 1e-11}
    runs = [
        pg.simulate(m, t_end=0.1, method=method, estimate=False, frames=3, **steps) for m in models
    ]
    assert all(run.status.ok for run in runs)
    for a, b in ((runs[0].q, runs[1].q), (runs[0].v, runs[1].v)):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(runs[0].energy, runs[1].energy, rtol=1e-9)
    assert abs(runs[0].energy - runs[0].energy[0]).max() < 1e-3 * runs[0].energy[0]


def test_armature_has_no_weight():
    """A body of mass m with the armature a falls with g m / (m + a)."""
    body = pg.Body(name="b", joint="free", mass=2.0, armature=(ADDED,), inertia=(1, 1, 1))
    mech = pg.Mechanism(pg.Model(bodies=[body]))
    vdot = mech.forward_dynamics(np.array(body.q), np.zeros(6))
    np.testing.assert_allclose(vdot, [0, 0, 0, 0, 0, -9.81 * 2.0 / (2.0 + ADDED)], atol=1e-14)


def test_armature_of_a_free_joint_on_a_moving_body_is_refused():
    base = pg.Body(name="base", joint="spherical", inertia=(1, 1, 1))
    with pytest.raises(pg.ModelError) as error:
        pg.Body(name="b", parent="base", joint="free", armature=(ADDED,))
    for fact in ("'b'", "armature", "'base'", "[0.3]", "'ground'", "compound"):
        assert fact in str(error.value)
    ways = [("translate", axis) for axis in np.eye(3)]
    remedy = pg.Body(
        name="b", parent="base", joint="compound", motions=[*ways, ("ball", (0, 0, 1))],
        armature=ADDED, inertia=(1, 1, 1),
    )  # fmt: skip
    assert pg.Model(bodies=[base, remedy]).body("b").armature == (ADDED,) * 4


@pytest.mark.parametrize("method", ["moreau_jean", "rk4"])
@pytest.mark.parametrize("path", ["bodies.base.armature.0", "bodies.c.armature.0"])
def test_derivatives_in_armature_are_those_of_differences(method, path):
    model = pg.Model(bodies=[*two("free", armature=(ADDED,)), *beside("ball")])
    model = model.edit("c", armature=(0.1,))
    given: dict[str, Any] = {"t_end": 0.05, "method": method, "step": 1e-3, "estimate": False}
    run = pg.simulate(model, wrt=[path], **given)
    here = ADDED if "base" in path else 0.1
    ends = [pg.simulate(model.edit(path, here + x), **given).v[-1] for x in (1e-4, -1e-4)]
    slope = (ends[0] - ends[1]) / 2e-4
    found = run.sensitivity(path)[-1, -len(slope) :]
    np.testing.assert_allclose(found, slope, atol=1e-6 * max(1.0, np.abs(slope).max()))


# -- friction --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("root", "axis", "step"), combined(["free", "spherical"], range(3), [1e-3, 7e-3])
)
def test_friction_stops_a_turn_about_an_axis_and_holds_it(root, axis, step):
    """A spin ω of the moment I stops after I ω / f, and a torque below f does not move it again."""
    inertia, friction, speed = (0.1, 0.2, 0.25), 0.5, 2.0
    v = np.zeros(6 if root == "free" else 3)
    v[axis] = speed
    body = pg.Body(name="b", joint=root, mass=1.0, inertia=inertia, friction=friction, v=tuple(v))
    torque = np.zeros(3)
    torque[axis] = 0.9 * friction
    push = pg.Force(name="f", kind="wrench", body="b", torque=tuple(torque))
    mech = pg.Mechanism(pg.Model(bodies=[body], gravity=(0, 0, 0)))
    stop = inertia[axis] * speed / friction
    run = pg.simulate(mech, t_end=2 * stop, step=step)
    k = int(np.searchsorted(run.t, 0.5 * stop))
    assert run.v[k, axis] == pytest.approx(speed - friction / inertia[axis] * run.t[k], abs=1e-9)
    np.testing.assert_allclose(run.v[-1], 0.0, atol=1e-12)
    assert run.dissipation[-1] == pytest.approx(0.5 * inertia[axis] * speed**2, rel=2e-2)
    pushed = pg.Model(bodies=[body], forces=[push], gravity=(0, 0, 0))
    held = pg.simulate(pushed, v=np.zeros(len(v)), t_end=0.5, step=step)
    np.testing.assert_allclose(held.v, 0.0, atol=1e-12)


def test_friction_of_a_free_joint_carries_a_weight_up_to_its_limit():
    body: dict[str, Any] = {"name": "b", "joint": "free", "mass": 2.0, "inertia": (1, 1, 1)}
    for share, falls in ((1.001, 0.0), (0.9, 0.1 * 9.81)):
        model = pg.Model(bodies=[pg.Body(**body, friction=share * 2.0 * 9.81)])
        run = pg.simulate(model, t_end=0.5, step=1e-3)
        assert run.v[-1, 5] == pytest.approx(-0.5 * falls, abs=1e-9)


@pytest.mark.parametrize("kind", ["ball", "free"])
def test_mjcf_keeps_armature_and_friction(tmp_path, kind):
    pytest.importorskip("mujoco")
    (tmp_path / "a.xml").write_text(
        f"""<mujoco><worldbody><body name="b"><joint type="{kind}" armature=".1" frictionloss=".2"
        damping=".3"/><geom type="box" size=".1 .2 .3" mass="1"/></body></worldbody></mujoco>"""
    )
    model, report = pg.read_mjcf(tmp_path / "a.xml")
    pg.write_mjcf(model, tmp_path / "b.xml")
    again, _ = pg.read_mjcf(tmp_path / "b.xml")
    for one in (model.body("b"), again.body("b")):
        assert (one.armature, one.friction, one.damping) == ((0.1,), (0.2,), (0.3,))
    assert "axes of the parent" in " ".join(str(entry) for entry in report.of("converted"))
    assert not [entry for entry in report.of("left out") if entry.acts]


@pytest.mark.parametrize("damping", [0.1, 10.0, 1e4])
@pytest.mark.parametrize("joint", ["spherical", "free"])
def test_damping_of_any_size_is_stable_and_of_second_order_in_time_stepping(joint, damping):
    """It was evaluated at the start of a step, which ended the run at 10 N m s and 0.01 kg m²."""
    speeds = (3.0, 1.0, 2.0, 0.5, 0.0, 0.3)[: 3 if joint == "spherical" else 6]
    com = (0.0, 0.0, -0.1) if joint == "spherical" else (0.0, 0.0, 0.0)
    body = pg.Body(
        name="b", joint=joint, mass=1.0, inertia=(0.01, 0.02, 0.03), com=com, damping=damping,
        v=speeds,
    )  # fmt: skip
    model = pg.Model(
        bodies=[body, pg.Body(name="held", joint="prismatic", axes=(1, 0, 0), friction=1.0)]
    )
    right = pg.simulate(model, t_end=0.1, method="radau5", rtol=1e-9, estimate=False)
    runs = [
        pg.simulate(model, t_end=0.1, method="moreau_jean", step=h, estimate=False)
        for h in (2e-3, 1e-3)
    ]
    errors = [np.abs(run.v[-1] - right.v[-1]).max() for run in runs]
    assert all(run.status is pg.Status.DONE for run in runs)
    assert errors[1] < 0.02
    assert errors[1] < errors[0] / 3.4 or errors[1] < 1e-6 or damping > 1.0
    batch = pg.BatchStepper(model, 3, step=1e-3, method="moreau_jean")
    batch.step(n=100)
    np.testing.assert_array_equal(batch.v[1], runs[1].v[-1])


def test_damping_of_a_free_joint_on_a_moving_body_is_told():
    """The parent cannot feel an armature there, so that time stepping takes it explicitly."""
    arm = pg.Body(name="a", axes=(0, 1, 0), com=(0, 0, -0.2), mass=1, inertia=(0.1, 0.1, 0.1),
                  friction=0.1, v=1)  # fmt: skip
    body = pg.Body(name="b", parent="a", joint="free", mass=1, inertia=(0.01, 0.02, 0.03),
                   damping=100, v=(3, 1, 2, 1, 0, 0))  # fmt: skip
    model = pg.Model(bodies=[arm, body])
    wide = pg.simulate(model, t_end=0.02, step=1e-3)
    assert not wide.success
    assert "5.9e-05 s" in wide.message
    fine = pg.simulate(model, t_end=0.02, step=5.9e-5)
    right = pg.simulate(model, t_end=0.02, method="radau5", rtol=1e-8)
    np.testing.assert_allclose(fine.v[-1], right.v[-1], atol=1e-3)


@pytest.mark.parametrize("damping", [0.1, 10.0, 1e3])
@pytest.mark.parametrize("joint", ["revolute", "spherical", "free"])
def test_time_stepping_books_what_damping_takes_as_a_loss(joint, damping):
    """What damping adds to the inertia was work, which made the loss negative."""
    speeds = {"revolute": (0.6,), "spherical": (3.0, 1.0, 2.0)}.get(joint, (3, 1, 2, 0.5, 0, 0.3))
    body = pg.Body(name="a", joint=joint, inertia=(0.02, 0.02, 0.02), v=speeds, damping=damping)
    held = pg.Body(name="held", joint="prismatic", axes=(1, 0, 0), link=(0, 3, 0), friction=1.0)
    model = pg.Model(bodies=[body, held], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.1, step=1e-3, method="moreau_jean", estimate=False)
    assert np.abs(run.work).max() < 1e-12 * run.energy[0]
    np.testing.assert_allclose(run.dissipation, run.energy[0] - run.energy, atol=1e-12)
    batch = pg.BatchStepper(model, 2, step=1e-3, method="moreau_jean")
    batch.step(n=100)
    assert batch.work[1] == run.work[-1]


def test_work_of_a_motor_is_apart_from_the_loss_in_a_stiff_damper_of_its_joint():
    body = pg.Body(name="a", inertia=(0.02, 0.02, 0.02), v=(0.6,), damping=1e3)
    held = pg.Body(name="held", joint="prismatic", axes=(1, 0, 0), link=(0, 3, 0), friction=1.0)
    model = pg.Model(bodies=[body, held], forces=[pg.Motor("m", body="a", torque=0.3)])
    run = pg.simulate(model, t_end=0.5, step=1e-3, method="moreau_jean", estimate=False)
    right = pg.simulate(model, t_end=0.5, method="radau5", rtol=1e-9, estimate=False)
    np.testing.assert_allclose(run.work[-1], right.work[-1], atol=1e-4)
    np.testing.assert_allclose(run.dissipation[-1], right.dissipation[-1], atol=1e-4)
