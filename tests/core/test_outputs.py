"""Outputs equal the motion's own derivatives and weights, and edits keep them consistent."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.rotation import matrix

G = np.array([0.0, 0.0, -9.81])
FRAMES = ("position", "rotation", "velocity", "angular_velocity", "velocimeter", "gyro")
INSTRUMENTS = ("accelerometer", "force", "torque")


def arm():
    return pg.Model(
        up="z",
        bodies=[
            pg.Body(name="upper", joint="revolute", axes=(0, 1, 0), mass=2.0, tip=(0.4, 0, 0)),
            pg.Body(name="lower", parent="upper", joint="spherical", link=(0.4, 0, 0), mass=1.0,
                    com=(0.1, 0, 0), inertia=np.diag([0.02, 0.03, 0.04]), v=(1.0, 2.0, -1.0)),
            pg.Body(name="tool", parent="lower", link=(0.2, 0, 0), mass=0.5, joint="weld",
                    inertia=np.diag([0.01, 0.01, 0.01])),
        ],
        sites=[pg.Site(name="imu", body="tool", point=(0.1, 0.2, 0.3), rotation=(1, 2, 3, 4))],
        outputs=[
            *({"name": kind, "kind": kind, "at": "imu"} for kind in (*FRAMES, *INSTRUMENTS)),
            pg.Output(name="angle", kind="joint_position", at="upper"),
            pg.Output(name="spin", kind="joint_velocity", at="lower", coordinate=2),
        ],
    )  # fmt: skip


def loaded():
    forces = [
        pg.Spring(name="spring", body="tool", other_point=(0, 1, 1), stiffness=40.0, damping=1.0),
        pg.Wrench(name="push", body="lower", point=(0.1, 0, 0), force=(1, 2, 3)),
        pg.Spring(name="inside", body="tool", other="upper", stiffness=10.0, rest=0.0),
    ]
    rail = pg.Distance(name="rail", body="tool", other_point=(0.3, 0.5, 1.0))
    soft = {"law": "soft", "stiffness": 500.0, "damping": 0.1}
    touch = pg.Contact(name="floor", body="tool", points=[(0, 0, -0.01)], **soft)
    return arm().replace(forces=forces, constraints=[rail], contacts=[touch])


def test_outputs_are_derivatives_of_the_motion():
    run = pg.simulate(arm(), t_end=0.2, frames=5001, rtol=1e-12)
    out, h = run.outputs, run.t[1]

    def rate(x):  # of fourth order, at the frames 2 to n - 3
        return (x[:-4] - 8 * x[1:-3] + 8 * x[3:-1] - x[4:]) / (12 * h)

    turn = np.array([matrix(q) for q in out["rotation"].tolist()])
    inner = slice(2, -2)
    np.testing.assert_allclose(rate(out["position"]), out["velocity"][inner], atol=1e-7)
    spin = rate(turn) @ turn[inner].transpose(0, 2, 1)  # R' Rᵀ
    spin = np.stack((spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]), axis=1)
    np.testing.assert_allclose(spin, out["angular_velocity"][inner], atol=1e-7)
    felt = np.einsum("nji,nj->ni", turn[inner], rate(out["velocity"]) - G)  # Rᵀ (a - g)
    np.testing.assert_allclose(felt, out["accelerometer"][inner], atol=1e-6)
    for mine, world in (("velocimeter", "velocity"), ("gyro", "angular_velocity")):
        own = np.einsum("nji,nj->ni", turn, out[world])
        np.testing.assert_allclose(out[mine], own, atol=1e-12)
    np.testing.assert_array_equal(out["angle"], run["upper"])
    np.testing.assert_array_equal(out["spin"], run.v[:, 3])
    force = np.einsum("nij,nj->ni", turn, out["force"])
    momentum = 0.5 * run.body_acceleration[:, 2, 3:]  # of the tool, whose centre is its origin
    np.testing.assert_allclose(force, momentum - 0.5 * G, atol=1e-9)
    np.testing.assert_array_equal(run.columns()["gyro.x"], out["gyro"][:, 0])
    with pytest.raises(KeyError, match=r"'gyr'.*gyro"):
        out["gyr"]


@pytest.mark.parametrize("make", [arm, loaded])
def test_steppers_and_batches_have_the_outputs_of_a_run(make):
    model = make()
    stepper = pg.Stepper(model, step=1e-3, method="rk4")
    stepper.step(n=50)
    run = pg.simulate(model, t_end=0.05, step=1e-3, method="rk4")
    batch = pg.BatchStepper(model, 3, step=1e-3, method="rk4", threads=1)
    batch.step(n=50)
    for name, value in stepper.outputs.items():
        np.testing.assert_allclose(value, run.outputs[name][-1], rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(batch.outputs[name], [value] * 3, rtol=1e-9, atol=1e-10)


def test_instances_of_a_batch_have_their_own_outputs():
    masses = np.array([0.5, 1.0, 0.5])
    batch = pg.BatchStepper(arm(), 3, step=1e-3, set={"bodies.tool.mass": masses}, threads=2)
    batch.step(n=20)
    for i, mass in enumerate(masses):
        stepper = pg.Stepper(arm().edit("tool", mass=mass), step=1e-3)
        stepper.step(n=20)
        for name, value in stepper.outputs.items():
            np.testing.assert_allclose(batch.outputs[name][i], value, rtol=1e-9, atol=1e-10)


def test_edits_take_outputs_along():
    model = arm()
    assert pg.Model.from_json(model.to_json()) == model
    named = model.edit("imu", name="head").edit("upper", name="arm")
    assert {o.at for o in named.outputs} == {"head", "arm", "lower"}
    fewer = model.remove("imu")
    assert [o.name for o in fewer.outputs] == ["angle", "spin"]
    assert any("'gyro'" in text for text in fewer.notices)
    assert [o.name for o in model.remove("tool").outputs] == ["angle", "spin"]
    welded = model.edit("lower", joint="revolute")
    assert "spin" not in [o.name for o in welded.outputs]
    twice = model.duplicate("lower")
    copies = {o.name: o.at for o in twice.outputs if o not in model.outputs}
    assert len(copies) == 10
    assert set(copies.values()) == {"imu_2", "lower_2"}


WRONG = [
    ({"kind": "gyro", "at": "elbow"}, "'elbow'.*imu"),
    ({"kind": "joint_position", "at": "imu"}, "'imu'"),
    ({"kind": "joint_position", "at": "lower"}, "'rotation'"),
    ({"kind": "joint_velocity", "at": "upper", "coordinate": 1}, "coordinate"),
    ({"kind": "force", "at": "ground"}, "ground"),
    ({"kind": "gyro", "at": "imu", "coordinate": 1}, "coordinate"),
    ({"kind": "smell", "at": "imu"}, "joint_position, joint_velocity"),
]


@pytest.mark.parametrize(("fields", "text"), WRONG)
def test_outputs_that_cannot_be_read_are_refused(fields, text):
    with pytest.raises(pg.ModelError, match=text):
        arm().add(pg.Output(name="new", **fields))
