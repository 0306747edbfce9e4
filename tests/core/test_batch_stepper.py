"""BatchStepper: each instance takes the steps that it takes alone, whatever the others do."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from numba import njit

import pgraph_core as pg
import pgraph_models
from pgraph_core.batches.feet import FeetLanes
from pgraph_core.batches.loops import LoopLanes
from pgraph_core.batches.paths import Path
from pgraph_core.engine.compiler.lane import LANE_WIDTH

SIZE = 5


def built_in(name: str) -> pg.Model:
    return pg.Model.load(pgraph_models.path(name))


def pendulum() -> pg.Model:
    """A rod of one metre on a sprung hinge; a stiffness of 1e12 N m/rad is too much for rk4."""
    rod = pg.Body(
        name="rod", mass=1.0, tip=(1, 0, 0), com=(0.5, 0, 0), inertia=np.eye(3) / 12,
        axes=(0, 1, 0), stiffness=1.0, damping=0.1,
    )  # fmt: skip
    return pg.Model(bodies=[rod])


def box(law: str = "complementarity") -> pg.Model:
    """A box that falls flat on the ground, with a servo that turns a lid."""
    bodies = [
        pg.Body(
            name="box", joint="free", mass=1.0, shape={"kind": "box", "size": (0.2, 0.2, 0.2)},
            q=(0, 0, 0.15, 1, 0, 0, 0),
        ),
        pg.Body(name="lid", parent="box", link=(0, 0, 0.1), mass=0.1, com=(0.05, 0, 0)),
    ]  # fmt: skip
    return pg.Model(
        bodies=bodies,
        contacts=[pg.Contact(name="sole", body="box", law=law)],
        forces=[pg.Servo(name="hinge", body="lid", kp=2.0, kd=0.1, target=0.5)],
    )


def alone(model: pg.Model, given: dict, i: int, **options) -> pg.Stepper:
    for path, values in given.items():
        model = Path(model, path).set(model, float(values[i]))
    return pg.Stepper(model, **options)


def spread(x: float) -> np.ndarray:
    return x * np.linspace(0.8, 1.2, SIZE)


CASES = {
    "walk": ("quadruped_hips", "trot", ["bodies.pelvis.mass", "contacts.left_hind_foot.friction"]),
    "gains": ("quadruped_hips", "trot", ["scenarios.trot.gait.gains.height.0", "gravity.1"]),
    "stand": ("quadruped_hips", "stand", ["bodies.pelvis.inertia.0.0", "bodies.thorax.link.0"]),
    "stance": ("quadruped", "stance", ["bodies.pelvis.mass"]),
    "loop": ("four_bar", "turn", ["bodies.coupler.mass"]),
}


@pytest.mark.parametrize("case", CASES)
def test_the_steps_of_each_instance_are_its_own_bit_for_bit(case: str):
    """The oracle is a Stepper of the edited model; threads and the order of neighbours vary."""
    name, scenario, wanted = CASES[case]
    model = built_in(name)
    given = {path: spread(Path(model, path).present) for path in wanted}
    options = {"scenario": scenario, "switches": ()}
    batches = [pg.BatchStepper(model, SIZE, set=given, threads=n, **options) for n in (1, 3)]
    turned = {path: x[::-1] for path, x in given.items()}
    batches.append(pg.BatchStepper(model, SIZE, set=turned, threads=2, **options))
    for batch in batches:
        batch.step(n=60)
        assert batch.step(n=40).all()
    for i in range(SIZE):
        stepper = alone(model, given, i, **options)
        stepper.step(n=60)
        stepper.step(n=40)
        for batch, k in zip(batches, (i, i, SIZE - 1 - i), strict=True):
            assert np.array_equal(batch.q[k], stepper.q)
            assert np.array_equal(batch.v[k], stepper.v)
            assert batch.t[k] == stepper.t
            for touch, force in stepper.contact_force.items():
                np.testing.assert_allclose(batch.contact_force[touch][k], force, atol=1e-9)
    assert len({x.tobytes() for x in batches[0].q}) == SIZE  # the numbers do differ


def tripod() -> pg.Model:
    """A box on three legs with limited motors; feet are points and a ball."""
    trunk = pg.Body(
        name="trunk", joint="free", mass=3.0, inertia=np.diag([0.02, 0.03, 0.04]),
        shape={"kind": "box", "size": (0.3, 0.2, 0.1)}, q=(0, 0, 0.35, 1, 0, 0, 0),
    )  # fmt: skip
    bodies, forces = [trunk], []
    contacts = [pg.Contact(name="belly", body="trunk")]
    for i, at in enumerate([(0.15, 0.1, 0.0), (0.15, -0.1, 0.0), (-0.15, 0.0, 0.0)]):
        leg = pg.Body(
            name=f"leg{i}", parent="trunk", link=at, axes=(0, 1, 0), mass=0.3,
            com=(0, 0, -0.1), inertia=np.diag([2e-3, 2e-3, 1e-4]),
            shape={"kind": "sphere", "radius": 0.03, "position": (0, 0, -0.25)},
        )  # fmt: skip
        bodies.append(leg)
        points = {} if i == 2 else {"points": [(0, 0, -0.28)]}
        contacts.append(pg.Contact(name=f"foot{i}", body=f"leg{i}", restitution=0.3 * i, **points))
        forces.append(
            pg.Servo(name=f"leg{i}", body=f"leg{i}", kp=30.0, kd=0.5, target=0.4, torque_limit=3.0)
        )
    return pg.Model(bodies=bodies, contacts=contacts, forces=forces, ground={"friction": 0.6})


def test_feet_in_lanes_hit_slide_and_tumble_with_the_bits_of_single_runs():
    """What falls, bounces and slides is chaotic: another rounding would soon be another motion."""
    size = LANE_WIDTH + 3
    given = {
        "bodies.trunk.mass": np.linspace(2, 4, size),
        "ground.friction": np.linspace(0.2, 0.9, size),
        "forces.leg1.kp": np.linspace(10, 50, size),
    }
    rng = np.random.default_rng(3)
    v, targets = rng.normal(0, 1.5, (size, 9)), rng.uniform(-0.8, 0.8, (size, 3))
    batches = [pg.BatchStepper(tripod(), size, set=given, threads=n) for n in (1, 2)]
    for batch in batches:
        assert isinstance(batch._many, FeetLanes)
        batch.reset(v=v)
        batch.step(n=250)
        for i in range(3):
            batch.target(f"leg{i}", targets[:, i])
        assert batch.step(n=150).all()
    assert np.array_equal(batches[0].v, batches[1].v)
    hit = 0
    for i in range(size):
        stepper = alone(tripod(), given, i)
        stepper.reset(v=v[i])
        stepper.step(n=250)
        for k in range(3):
            stepper.target(f"leg{k}", targets[i, k])
        stepper.step(n=150)
        assert np.array_equal(batches[0].q[i], stepper.q)
        assert np.array_equal(batches[0].v[i], stepper.v)
        for touch, force in stepper.contact_force.items():
            assert np.array_equal(batches[0].contact_force[touch][i], force)
        hit += len(stepper.contact_force)
    assert hit == 4 * size


def test_what_stands_deep_in_the_ground_comes_out_in_lanes_with_the_bits_of_single_runs():
    """The start is inside the ground, by more and less than what is left as it is."""
    size = LANE_WIDTH + 2
    batch = pg.BatchStepper(tripod(), size, set={"bodies.trunk.mass": np.linspace(2, 4, size)})
    assert isinstance(batch._many, FeetLanes)
    batch.step(n=400)
    deeper = np.array(batch.q)
    deeper[:, 2] -= np.append(0.0, np.geomspace(1e-9, 3e-3, size - 1))
    batch.reset(deeper)
    batch.step(n=60)
    assert batch.ok.all()
    for i in range(size):
        stepper = alone(tripod(), {"bodies.trunk.mass": np.linspace(2, 4, size)}, i)
        stepper.reset(deeper[i])
        stepper.step(n=60)
        assert np.array_equal(batch.q[i], stepper.q)
        assert np.array_equal(batch.v[i], stepper.v)
        for touch, gap in stepper.contact_gap.items():
            assert batch.contact_gap[touch][i] == gap


@pytest.mark.parametrize("name", ["trot", "crawl", "gallop", "bound"])
def test_gaits_in_lanes_have_the_bits_of_single_runs(name: str):
    """Pushed walks, in other phases and with other gaits; some fall. Damped joints are stiff."""
    model = built_in("quadruped" if name == "bound" else "quadruped_hips")
    for leg in ("left_radius", "right_tibia", "lumbar"):
        model = model.edit(leg, kind="body", damping=[0.02])
    size, gait = LANE_WIDTH + 3, f"scenarios.{name}.gait"
    start = pg.Stepper(model, scenario=name)
    given = {
        f"{gait}.clearance": np.linspace(0.9, 1.1, size) * Path(model, f"{gait}.clearance").present,
        f"{gait}.turn": np.linspace(0.0, 0.3, size),
        "bodies.pelvis.mass": np.linspace(0.8, 1.1, size) * model["pelvis"].mass,
    }
    v = np.random.default_rng(5).normal(0, 0.2, (size, len(start.v)))
    v[2] += 3.0
    batch = pg.BatchStepper(model, size, set=given, scenario=name, threads=2)
    assert isinstance(batch._many, FeetLanes)
    assert batch._many._walks[0][0]
    batch.reset(v=v)
    batch.step(n=200)
    batch.reset(v=v[:1], which=[1])  # another phase than its neighbours
    batch.step(n=200)
    fell = 0
    for i in range(size):
        stepper = alone(model, given, i, scenario=name)
        stepper.reset(v=v[i] if i != 1 else v[0])
        stepper.step(n=200 if i == 1 else 400)
        assert np.array_equal(batch.q[i], stepper.q)
        assert np.array_equal(batch.v[i], stepper.v)
        assert batch.work[i] == stepper.recording.steps.ledger[0]
        batch._many.into_worker(i)
        said = batch._first.recording.user.fallen[0]
        assert said == stepper.recording.user.fallen[0]
        fell += said >= 0.0
    assert 0 < fell < size


@pytest.mark.parametrize(
    ("name", "scenario", "path", "span"),
    [
        ("quadruped", "stance", "bodies.pelvis.mass", (7, 9)),
        ("slider_crank", "turn", "gravity.2", (-12, 3)),
        ("rolling_disc", "roll", "gravity.2", (-12, -7)),
        ("bricard", "fall", "gravity.2", (-12, -7)),  # redundant constraints: lanes give up
    ],
)
@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_constraints_in_lanes_have_the_bits_of_single_runs(name, scenario, path, span, method):
    """Instances of other numbers, one of them started again at another time than the others."""
    size = LANE_WIDTH + 3
    given = {path: np.linspace(*span, size)}
    options = {"scenario": scenario, "method": method}
    batch = pg.BatchStepper(built_in(name), size, set=given, threads=2, **options)
    assert isinstance(batch._many, LoopLanes)
    batch.step(n=40)
    states = batch.trace(n=10)
    assert np.array_equal(states[-1], np.concatenate((batch.q, batch.v), axis=1))
    batch.reset(which=[2])
    batch.step(n=20)
    for i in range(size):
        stepper = alone(built_in(name), given, i, **options)
        stepper.step(n=20 if i == 2 else 70)
        assert np.array_equal(batch.q[i], stepper.q)
        assert np.array_equal(batch.v[i], stepper.v)


@pytest.mark.parametrize("law", ["complementarity", "soft", "penalty"])
@pytest.mark.parametrize("method", ["moreau_jean", "rk4"])
def test_laws_of_contact(law: str, method: str):
    """Rigid contacts by time stepping alone; soft and penalty ones by both methods."""
    if law == "complementarity" and method == "rk4":
        with pytest.raises(pg.InputError, match="moreau_jean"):
            pg.BatchStepper(box(law), SIZE, method=method)
        return
    options = {"method": method, "step": 2e-4}
    given = {"bodies.box.mass": spread(1.0)}
    batch = pg.BatchStepper(box(law), SIZE, set=given, threads=2, **options)
    tau = np.random.default_rng(0).normal(0, 0.1, (SIZE, 7))
    batch.step(tau, 800)
    for i in range(SIZE):
        stepper = alone(box(law), given, i, **options)
        stepper.step(tau[i], 800)
        assert np.array_equal(batch.q[i], stepper.q)
        assert batch.contact_gap["sole"][i] == pytest.approx(stepper.contact_gap["sole"], abs=1e-6)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
@pytest.mark.parametrize("varied", [False, True])
def test_free_trees_equal_single_ones_to_rounding(method: str, varied: bool):
    """In lanes; 1e-9 after 1000 steps of a chain that does not tumble. Threads change no bit."""
    size = LANE_WIDTH + 2
    model = pg.Model.serial(3).edit("3", stiffness=1.0, damping=0.01)
    given = {"bodies.3.mass": np.linspace(0.2, 0.8, size)} if varied else None
    rng = np.random.default_rng(1)
    q, tau = rng.uniform(-0.3, 0.3, (size, 3)), rng.uniform(-0.01, 0.01, (size, 3))
    batches = [pg.BatchStepper(model, size, method=method, set=given, threads=n) for n in (1, 2)]
    for batch in batches:
        batch.reset(q)
        batch.inverse_dynamics(np.zeros((size, 3)))  # of lanes alone
        batch.step(tau, n=400)
        batch.step(tau, n=600)
    assert np.array_equal(batches[0].q, batches[1].q)
    for i in range(size):
        stepper = alone(model, given or {}, i, method=method)
        stepper.reset(q[i])
        stepper.step(tau[i], n=1000)
        np.testing.assert_allclose(batches[0].q[i], stepper.q, rtol=0, atol=1e-9)
        np.testing.assert_allclose(batches[0].v[i], stepper.v, rtol=0, atol=1e-8)
        assert batches[0].t[i] == stepper.t
    if varied:
        batches[0].reset(q, numbers=np.full(size, 2))
        batches[0].step(n=10)
        stepper = alone(model, given, 2, method=method)
        stepper.reset(q[0])
        stepper.step(n=10)
        np.testing.assert_allclose(batches[0].q[0], stepper.q, rtol=0, atol=1e-12)


def test_numbers_of_a_part_change_together():
    """A thin rod of another length: either moment alone would be of no rigid body."""
    length = np.array([1.0, 0.3, 2.0])
    moment = length**2 / 12
    rod = pg.Body(
        name="rod", axes=(0, 1, 0), com=(0, 0, -0.5), inertia=np.diag([1 / 12, 1 / 12, 1e-4]), q=0.3
    )
    model = pg.Model(bodies=[rod])
    numbers = {
        "bodies.rod.inertia.0.0": moment,
        "bodies.rod.inertia.1.1": moment,
        "bodies.rod.com.2": -length / 2,
    }
    batch = pg.BatchStepper(model, 3, set=numbers)
    swing = -9.81 * length / 2 * np.sin(0.3) / (length**2 / 3)
    assert batch.acceleration()[:, 0] == pytest.approx(swing, rel=1e-12)


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_steps_near_stiff_contacts_are_taken_in_parts_and_end_together(law: str):
    ball = pg.Body(
        name="b",
        joint="free",
        mass=1.0,
        shape=pg.Shape(kind="sphere", radius=0.05),
        q=(0, 0, 0.2, 1, 0, 0, 0),
    )
    touch = pg.Contact(name="c", body="b", law=law)
    model = pg.Model(bodies=[ball], contacts=[touch])
    batch = pg.BatchStepper(model, 2, set={"bodies.b.q.2": [0.08, 5.0]}, step=1e-3)
    alone = pg.Stepper(model.edit("b", q=(0, 0, 0.08, 1, 0, 0, 0)), step=1e-3)
    for _ in range(4):
        batch.step(n=50)
        alone.step(n=50)
    assert alone.t == pytest.approx(0.2, abs=1e-15)
    assert batch.t == pytest.approx([0.2, 0.2], abs=1e-15)
    assert (batch.q[0] == alone.q).all()


@pytest.mark.parametrize("threads", [1, 2])
def test_gears_and_coefficients_of_each_instance(threads: int):
    slider = pg.Body(name="x", joint="prismatic", axes=(1, 0, 0), mass=1.0)
    gears, given = [2.0, 4.0, 8.0], {"threads": threads}
    motor = pg.Motor(name="m", body="x", torque=0.5, gear=3.0)
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), forces=[motor])
    batch = pg.BatchStepper(model, 3, set={"forces.m.gear": gears}, **given)
    assert batch.acceleration()[:, 0] == pytest.approx([1.0, 2.0, 4.0], rel=1e-15)
    batch.step(n=100)
    for i, gear in enumerate(gears):
        alone = pg.Stepper(model.edit("m", gear=gear))
        alone.step(n=100)
        assert batch.v[i, 0] == alone.v[0]
    with pytest.raises(pg.InputError, match="gear of 1"):
        pg.BatchStepper(model, 2, set={"forces.m.gear": [1.0, 3.0]}, **given)
    tendon = pg.Tendon(name="t", body="x", coefficients={"x": [2.0]}, stiffness=10.0, rest=1.0)
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), forces=[tendon])
    batch = pg.BatchStepper(model, 2, set={"forces.t.coefficients.x.0": [2.0, 4.0]}, **given)
    assert batch.acceleration()[:, 0] == pytest.approx([20.0, 40.0], rel=1e-15)


def test_a_path_into_the_first_shape_leaves_the_others():
    """The mass of two boxes of 500 kg/m^3, one of which has another length."""
    boxes = [{"kind": "box", "size": (0.2, 0.2, 0.2), "position": (0, 0, z)} for z in (0, 1)]
    body = pg.Body(name="b", joint="prismatic", axes=(1, 0, 0), shapes=boxes, density=500,
                   derived=("mass", "com", "inertia"))  # fmt: skip
    model = pg.Model(bodies=[body], gravity=(1, 0, 0), forces=[
        pg.Motor(name="m", body="b", torque=3.0),
    ])  # fmt: skip
    batch = pg.BatchStepper(model, 2, set={"bodies.b.shape.size.0": [0.2, 0.4]})
    masses = np.array([8.0, 12.0])
    assert batch.acceleration()[:, 0] == pytest.approx(1.0 + 3.0 / masses, rel=1e-12)


def test_torques_by_a_compiled_function():
    @njit
    def push(t, q, v):
        return -5.0 * q - v

    batch = pg.BatchStepper(pendulum(), 3, tau=push, set={"bodies.rod.mass": [1, 2, 3]})
    batch.step(n=50)
    stepper = pg.Stepper(pendulum().edit("rod", mass=2.0), tau=push)
    stepper.step(n=50)
    assert np.array_equal(batch.q[1], stepper.q)


def test_what_fails_stays_is_named_and_goes_on_after_a_reset():
    """A spring that rk4 cannot step; the neighbours take the steps that they take alone."""
    given = {"bodies.rod.stiffness.0": [1.0, 1e12, 2.0]}
    batch = pg.BatchStepper(pendulum(), 3, set=given)
    assert batch.step(n=100).tolist() == [True, False, True]
    at = batch.q[1].copy()
    assert np.isfinite(batch.q).all()
    batch.step(n=100)
    assert np.array_equal(batch.q[1], at)
    assert list(batch.failures) == [1]
    assert "rod" in batch.failures[1]
    for i in (0, 2):
        stepper = alone(pendulum(), given, i)
        stepper.step(n=100)
        stepper.step(n=100)
        assert np.array_equal(batch.q[i], stepper.q)
    batch.reset(which=[1], numbers=[0])
    assert batch.failures == {}
    batch.step(n=200)
    stepper = alone(pendulum(), given, 0)
    stepper.step(n=200)
    assert np.array_equal(batch.q[1], stepper.q)


def test_a_reset_of_some_starts_them_alone():
    model = built_in("quadruped_hips")
    batch = pg.BatchStepper(model, 3, scenario="stand")
    batch.step(n=30)
    kept = batch.q.copy()
    stepper = pg.Stepper(model, scenario="stand")
    q, v = stepper.q + 0.0, stepper.v + 0.01
    batch.reset(q, v, which=np.array([False, True, False]))
    assert np.array_equal(batch.q[[0, 2]], kept[[0, 2]])
    assert batch.t.tolist() == pytest.approx([0.03, 0.0, 0.03])
    batch.step(n=20)
    stepper.reset(q, v)
    stepper.step(n=20)
    assert np.array_equal(batch.q[1], stepper.q)


@pytest.mark.parametrize("law", ["penalty", "soft"])
def test_a_contact_with_a_stiffness_of_its_own_makes_a_reset_the_start_of_a_stepper(law: str):
    """Without one it fits the speed at the start, which a batch knows of its models alone."""
    contact = pg.Contact(name="sole", body="box", law=law, stiffness=2e4)
    model = box().replace(contacts=[contact])
    stepper = pg.Stepper(model)
    rng, start = np.random.default_rng(4), stepper.q
    q, v = start + np.zeros((6, 1)), rng.normal(size=(6, len(stepper.v)))
    q[:, 3:7] = rng.normal(size=(6, 4))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    batch = pg.BatchStepper(model, 6)
    batch.reset(q, v)
    batch.step(n=300)
    for i in range(6):
        alone = pg.Stepper(model, q=q[i], v=v[i])
        alone.step(n=300)
        assert np.array_equal(batch.q[i], alone.q)
        assert np.array_equal(batch.v[i], alone.v)


def test_what_a_run_tells_of_its_start_is_told_of_the_instances_of_which_it_is_true():
    model = pendulum().edit("rod", limits=((-0.5, 0.8),))
    batch = pg.BatchStepper(model, 3, set={"bodies.rod.q.0": [0.0, 0.9, 0.7, 0.9]})
    (text,) = (x for x in pg.Stepper(model.edit("rod", q=0.9)).notices if "starts" in x)
    assert "0.1 beyond its limits" in text
    assert {said: x.tolist() for said, x in batch.notices.items() if "rod" in said} == {text: [1]}
    batch.reset(which=[1, 2], numbers=[0, 3])
    assert batch.notices[text].tolist() == [2]
    batch.reset(numbers=0)
    assert text not in batch.notices


def test_angles_that_lanes_cannot_take_are_taken_alone():
    """m g c cos q from the angle's exact sine, by a Stepper of each; also where a step ends far."""
    model, given = pendulum(), {"bodies.rod.mass": spread(1.0)}
    far = np.array([1.0, -1.5e10, 2e16, 3e20, 0.5])[:, None]
    batch = pg.BatchStepper(model, SIZE, set=given)
    batch.reset(far, [3.0])
    tau = batch.inverse_dynamics(np.ones((SIZE, 1)))
    vdot = batch.acceleration()
    for i in range(SIZE):
        mech = alone(model, given, i).mech
        one = pg.Stepper(mech, q=far[i], v=[3.0])
        np.testing.assert_allclose(tau[i], mech.inverse_dynamics(far[i], [3.0], [1.0]), rtol=1e-13)
        np.testing.assert_allclose(vdot[i], one.vdot, rtol=1e-13)
    fast = np.array([1.0, 2e8, 1e19, 4e7, -1e12])[:, None]  # rad/s: turned far by the first step
    free = model.edit("rod", stiffness=0.0, damping=0.0)
    batch = pg.BatchStepper(free, SIZE, set=given)
    batch.reset([0.3], fast)
    assert batch.step(n=5).all()
    for i in range(SIZE):
        one = pg.Stepper(alone(free, given, i).mech, q=[0.3], v=fast[i])
        one.step(n=5)
        np.testing.assert_allclose(batch.q[i], one.q, rtol=1e-13)
        np.testing.assert_allclose(batch.v[i], one.v, rtol=1e-13)
        assert batch.t[i] == one.t


@pytest.mark.parametrize(
    "wrong", [np.full((3, 1), 5j), np.ma.masked_all((3, 1)), [["1"]] * 3, [[True]] * 3]
)
def test_what_are_no_numbers_is_refused_wherever_it_is_given(wrong):
    batch, stepper = pg.BatchStepper(pendulum(), 3), pg.Stepper(pendulum())
    for call in (
        batch.step, batch.reset, batch.acceleration, batch.inverse_dynamics,
        lambda x: stepper.step(x[0]), lambda x: stepper.reset(x[0]),
    ):  # fmt: skip
        with pytest.raises(pg.InputError, match=r"must be (finite|numbers)"):
            call(wrong)
    assert batch.q.tolist() == pg.BatchStepper(pendulum(), 3).q.tolist()


def test_a_reset_meets_the_constraints():
    model = built_in("four_bar")
    batch = pg.BatchStepper(model, 2, set={"gravity.1": [-9.81, -1.6]})
    stepper = pg.Stepper(model)
    q = stepper.q + 0.05
    batch.reset(q, which=[0])
    stepper.reset(q)
    assert np.array_equal(batch.q[0], stepper.q)
    assert not np.array_equal(batch.q[0], batch.q[1])
    batch.step(n=10)
    stepper.step(n=10)
    assert np.array_equal(batch.q[0], stepper.q)


def test_targets_of_servos_are_those_of_each_instance():
    batch = pg.BatchStepper(box(), 2)
    batch.target("hinge", [0.1, 0.9])
    batch.step(n=200)
    for i, target in enumerate((0.1, 0.9)):
        stepper = pg.Stepper(box())
        stepper.target("hinge", target)
        stepper.step(n=200)
        assert np.array_equal(batch.q[i], stepper.q)


def test_servos_of_trees_have_targets_of_their_own_in_lanes_too():
    """1e-9, as without servos; one with a limit that is not reached is stepped one by one."""
    targets, given = np.linspace(-1.0, 1.0, SIZE), np.linspace(0.0, 2.0, SIZE)[:, None]
    batches = []
    for limit in (None, 1e9):
        servo = pg.Servo(name="hold", body="rod", kp=20.0, kd=1.0, target=0.2, torque_limit=limit)
        batch = pg.BatchStepper(pendulum().add(servo), SIZE)
        batch.target("hold", targets)
        batch.step(given, n=500)
        batches.append(batch)
    lanes, single = batches
    assert type(lanes._many) is not type(single._many)
    for name in ("q", "v", "work"):
        assert getattr(lanes, name) == pytest.approx(getattr(single, name), abs=1e-9)
    assert lanes.acceleration(given) == pytest.approx(single.acceleration(given), abs=1e-9)
    stepper = pg.Stepper(lanes.mech)
    stepper.target("hold", -1.0)
    stepper.step(n=500)
    assert lanes.q[0] == pytest.approx(stepper.q, abs=1e-9)


@pytest.mark.parametrize("law", ["complementarity", "soft"])
def test_snapshots_pickles_and_copies_go_on_with_the_same_bits(law: str):
    batch = pg.BatchStepper(box(law), 3, set={"bodies.box.mass": [1, 2, 3]}, step=2e-4)
    batch.step(n=700)
    saved = batch.save()
    others = pickle.loads(pickle.dumps(batch)), copy.deepcopy(batch)
    batch.step(n=100)
    after = batch.q.copy()
    batch.step(n=50)
    batch.restore(saved)
    for one in (batch, *others):
        one.step(n=100)
        assert np.array_equal(one.q, after)
    with pytest.raises(pg.InputError, match="damaged"):
        batch.restore(saved[:-8])
    with pytest.raises(pg.InputError, match="another mechanism"):
        pg.BatchStepper(box(law), 3, step=2e-4).restore(saved)


def test_the_memory_of_many_pendulums():
    """A kilobyte each, and nothing that grows."""
    tracemalloc.start()
    batch = pg.BatchStepper(pendulum(), 100_000)
    batch.step()
    used = tracemalloc.get_traced_memory()[0]
    batch.step(np.zeros((100_000, 1)), n=3)
    grown = tracemalloc.get_traced_memory()[0] - used
    tracemalloc.stop()
    assert used < 1e8
    assert grown < 1e5


@pytest.mark.nightly
def test_memory_does_not_grow_over_a_million_steps():
    batch = pg.BatchStepper(box(), 4, threads=2)
    batch.step(n=1000)
    tracemalloc.start()
    for _ in range(1000):
        batch.step(n=1000)
    grown = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert batch.ok.all()
    assert grown < 1e5


BAD = [
    (lambda m: pg.BatchStepper(m, 0), "size"),
    (lambda m: pg.BatchStepper(m, 2, threads=0), "threads"),
    (lambda m: pg.BatchStepper(m, 2, step=-1.0), "step"),
    (lambda m: pg.BatchStepper(m, 2, method="dopri5"), "method"),
    (lambda m: pg.BatchStepper(m, 2, set={"bodies.rod.mas": [1, 2]}), "bodies.rod.mas.*mass"),
    (lambda m: pg.BatchStepper(m, 2, set={"bodies.rod.mass": [1]}), "1 values.* 2"),
    (lambda m: pg.BatchStepper(m, 2, set={"bodies.rod.mass": [1, np.nan]}), "finite"),
    (lambda m: pg.BatchStepper(m, 2, set={"bodies.rod.mass": [1, -1]}), "entry 1 .*= -1"),
    (
        lambda m: pg.BatchStepper(
            m.edit("rod", stiffness=0.0), 2, set={"bodies.rod.damping.0": [1, 0]}
        ),
        "a damper",
    ),
    (lambda m: pg.BatchStepper(m, 2, set={}), "set"),
    (
        lambda m: pg.BatchStepper(
            m.edit("rod", shape={"kind": "sphere", "radius": 0.1}),
            2,
            set={"bodies.rod.shape.radius": [1, 2], "bodies.rod.shapes.0.radius": [2, 3]},
        ),
        "twice",
    ),
    (lambda m: pg.BatchStepper(m, 2, tau=lambda t, q, v: -q), "njit"),
    (lambda m: pg.BatchStepper(m, 2, tau=[[1], [2], [3]]), r"tau.*\(2, 1\)"),
    (lambda m: pg.BatchStepper(m, 2).step(np.zeros((2, 3))), r"tau.*\(2, 1\)"),
    (lambda m: pg.BatchStepper(m, 2).step(n=0), "n: must be"),
    (lambda m: pg.BatchStepper(m, 2).reset(which=[2]), "0 to 1"),
    (lambda m: pg.BatchStepper(m, 2).reset(np.zeros((3, 1))), r"q.*\(2, 1\)"),
    (lambda m: pg.BatchStepper(m, 2).reset(numbers=[5, 0]), "2 entries"),
    (lambda m: pg.BatchStepper(m, 2).target("knee", 1.0), "servo"),
    (lambda m: pg.BatchStepper(m, 2).restore(b"nothing"), "BatchStepper.save"),
]


@pytest.mark.parametrize("make", [pg.Stepper, lambda m: pg.BatchStepper(m, 2)])
def test_what_people_type_first_is_answered_in_words(make):
    """A count in place of torques, and names that other programs have."""
    stepper = make(pendulum())
    with pytest.raises(pg.InputError, match=r"for 100 steps write step\(n=100\)"):
        stepper.step(100)
    with pytest.raises(pg.InputError, match=r"tau=function"):
        stepper.step(lambda t, q, v: -q)
    for name, said in (("run", "n=1000"), ("time", r"\.t$"), ("set_state", r"reset\(q, v\)")):
        with pytest.raises(AttributeError, match=said):
            getattr(stepper, name)
        assert not hasattr(stepper, name)
    assert np.all(stepper.t == 0.0)
    with pytest.raises(pg.InputError, match=r"no servo .* 'knee'; there is none"):
        stepper.target("knee", 0.3)


@pytest.mark.parametrize(("call", "match"), BAD)
def test_bad_input_is_refused_in_words(call, match: str):
    with pytest.raises(pg.InputError, match=match):
        call(pendulum())


AGAIN = """
import sys, numpy as np, pickle
import pgraph_core as pg
kind, model, saved, to = pickle.load(open(sys.argv[1], "rb"))
st = kind(model, **({"size": 2} if kind is pg.BatchStepper else {}), step=2e-4)
st.restore(saved)
st.step(n=100)
np.save(to, st.q)
"""


@pytest.mark.parametrize("kind", [pg.Stepper, pg.BatchStepper])
def test_a_snapshot_goes_on_in_another_process(kind, tmp_path):
    """Soft contacts: where their kernels are is known to the process alone."""
    size = {"size": 2} if kind is pg.BatchStepper else {}
    one = kind(box("soft"), **size, step=2e-4)
    one.step(n=700)
    case, to = tmp_path / "case.pkl", tmp_path / "q.npy"
    case.write_bytes(pickle.dumps((kind, box("soft"), one.save(), str(to))))
    one.step(n=100)
    subprocess.run([sys.executable, "-c", AGAIN, str(case)], check=True, timeout=300)
    assert np.array_equal(np.load(to), one.q)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_steps_with_threads_of_its_own():
    batch = pg.BatchStepper(pg.Model.serial(2), 4 * LANE_WIDTH, threads=2)
    batch.step(n=10)
    with multiprocessing.get_context("fork").Pool(1) as pool:  # ended if it hangs
        there = pool.apply_async(_stepped, (batch.save(),)).get(timeout=300)
    batch.step(n=10)
    assert np.array_equal(there, batch.q)


def _stepped(snapshot: bytes) -> np.ndarray:
    batch = pg.BatchStepper(pg.Model.serial(2), 4 * LANE_WIDTH, threads=2)
    batch.restore(snapshot)
    batch.step(n=10)
    return batch.q.copy()


@pytest.mark.parametrize("law", ["complementarity", "penalty"])
def test_gaps_are_those_of_the_states_also_before_the_first_step_and_in_flight(law: str):
    """A ball of radius 0.1 m: its gap is its height less that, whatever it touched before."""
    ball = pg.Body(name="ball", joint="free", mass=1.0, q=(0, 0, 0.3, 1, 0, 0, 0),
                   shape={"kind": "sphere", "radius": 0.1})  # fmt: skip
    own: dict[str, float] = {"stiffness": 1e5} if law == "penalty" else {}
    floor = pg.Contact(name="floor", body="ball", law=law, restitution=0.8, **own)
    model = pg.Model(bodies=[ball], contacts=[floor])
    radii = np.array([0.1, 0.05, 0.1])
    batch = pg.BatchStepper(model, 3, set={"bodies.ball.shape.radius": radii})
    stepper = pg.Stepper(model)
    for _ in range(6):
        gaps = batch.contact_gap["floor"]
        np.testing.assert_allclose(gaps, batch.q[:, 2] - radii, atol=1e-12)
        assert stepper.contact_gap["floor"] == gaps[0]
        batch.step(n=80)
        stepper.step(n=80)
    batch.reset(batch.q * [1, 1, 2, 1, 1, 1, 1])
    np.testing.assert_allclose(batch.contact_gap["floor"], batch.q[:, 2] - radii, atol=1e-12)


@pytest.mark.parametrize("method", ["generalised_alpha", "gauss6"])
def test_what_implicit_methods_remember_is_each_instances_own(method: str):
    """The one at rest stays so, whatever its neighbours; and after a snapshot, copy or reset."""
    model = pendulum().replace(gravity=(0, 0, 0))
    start = np.array([[1.0], [0.5], [0.0], [-1.0]])
    batches = [pg.BatchStepper(model, 4, method=method, threads=n) for n in (1, 2, 4)]
    for batch in batches:
        batch.reset(start[::-1])
        batch.step(n=7)
        batch.reset(start)
        for _ in range(40):
            batch.step()
    again = copy.deepcopy(batches[0])
    batches[0].step(n=20)
    again.step(n=20)
    for i in range(4):
        stepper = pg.Stepper(model, method=method, q=start[i])
        for _ in range(40):
            stepper.step()
        assert all(np.array_equal(b.q[i], stepper.q) for b in batches[1:])
        twin = pickle.loads(pickle.dumps(stepper))
        stepper.step(n=20)
        twin.step(n=20)
        for other in (batches[0].q[i], again.q[i], twin.q):
            assert np.array_equal(other, stepper.q)
    assert batches[0].q[2] == 0.0


def test_asking_for_an_acceleration_changes_nothing_that_outputs_read():
    sensor = pg.Output(name="felt", kind="accelerometer", at="rod")
    model = pendulum().replace(outputs=[sensor])
    batch = pg.BatchStepper(model, 2)
    batch.step([2.0], n=3)
    before, kept = batch.outputs["felt"], batch.save()
    pushed = batch.acceleration([50.0])
    assert (abs(pushed - batch.acceleration([2.0])) > 1.0).all()
    assert np.array_equal(batch.outputs["felt"], before)
    assert batch.save() == kept


@pytest.mark.parametrize("field", ["friction", "restitution", "static_friction"])
def test_a_number_that_a_contact_leaves_out_can_be_varied(field: str):
    least = 1.0 if field == "static_friction" else 0.3
    values = [least, least + 0.2, least + 0.6]
    given = {f"contacts.sole.{field}": values, "bodies.box.v.3": [1.0] * 3}
    batch = pg.BatchStepper(box(), 3, set=given)
    batch.step(n=250)
    for i in range(3):
        model = box().edit("sole", kind="contact", **{field: given[f"contacts.sole.{field}"][i]})
        stepper = pg.Stepper(model.edit("box", v=(0, 0, 0, 1, 0, 0)))
        stepper.step(n=250)
        assert np.array_equal(batch.q[i], stepper.q)
    if field != "static_friction":
        assert len(np.unique(batch.q, axis=0)) == 3


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("bodies.box.shape.position.0", ""),
        ("bodies.lid.limits.0", "give it a value in the model first"),
        ("scenarios.none.q.box.0", "none"),
        ("forces.hinge.body", "not one number"),
    ],
)
def test_what_has_no_number_says_what_to_do(path: str, words: str):
    if not words:
        assert Path(box(), path).present == 0.0
        return
    with pytest.raises(pg.InputError, match=words):
        Path(box(), path)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_a_trace_of_trees_has_the_states_of_single_steps(method: str):
    """In one call; also of one whose angle is far, one that fails and one that has failed."""
    drive = pg.Servo(name="drive", body="rod", kp=3.0, target=pg.Table(t=(0, 0.02), value=(0, 1)))
    model = pendulum().replace(forces=[drive])
    given = {"bodies.rod.stiffness.0": [1.0, 2.0, 1e9, 1e12, 3.0]}
    batches = [pg.BatchStepper(model, SIZE, method=method, set=given) for _ in range(2)]
    for batch in batches:
        batch.reset([1e12], [0.0], which=[1])
        batch.step(n=15)
    traced = batches[0].trace(n=40)
    for state in traced:
        batches[1].step()
        now = np.concatenate((batches[1].q, batches[1].v), axis=1)
        assert np.array_equal(state, now)
    assert batches[0].t.tolist() == batches[1].t.tolist()
    assert batches[0].failures == batches[1].failures
    assert 3 in batches[0].failures
