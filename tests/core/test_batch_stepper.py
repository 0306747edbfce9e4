"""BatchStepper: every instance takes the steps that it takes alone."""

import copy
import multiprocessing
import pickle
from functools import partial

import numpy as np
import pytest
from numba import njit

import pgraph_core as pg
from pgraph_core.batches.lanes import FeetLanes
from pgraph_core.engine.compiler.lane import LANE_WIDTH
from pgraph_core.simulation.paths import Path

from ..worlds import ball as worlds_ball
from ..worlds import built_in, on_ground

SIZE = 5
EULER = "semi_implicit_euler"
WIDE = LANE_WIDTH + 2  # one full lane and a rest


def pendulum() -> pg.Model:
    """Return a rod of one metre on a sprung hinge. 1e12 N m/rad is too stiff for rk4."""
    rod = pg.Body(
        name="rod", mass=1.0, tip=(1, 0, 0), com=(0.5, 0, 0), inertia=np.eye(3) / 12,
        axes=(0, 1, 0), stiffness=1.0, damping=0.1,
    )  # fmt: skip
    return pg.Model(bodies=[rod])


def box(**contact) -> pg.Model:
    size = {"kind": "box", "size": (0.2, 0.2, 0.2)}
    sole = pg.Body(name="box", joint="free", mass=1.0, shape=size, q=(0, 0, 0.15, 1, 0, 0, 0))
    lid = pg.Body(name="lid", parent="box", link=(0, 0, 0.1), mass=0.1, com=(0.05, 0, 0))
    hinge = pg.Servo(name="hinge", body="lid", kp=2.0, kd=0.1, target=0.5)
    contacts = [pg.Contact(name="sole", body="box", **contact)]
    return pg.Model(bodies=[sole, lid], contacts=contacts, forces=[hinge])


def ball(**contact) -> pg.Model:
    return on_ground(worlds_ball("ball", (0, 0, 0), q=(0, 0, 0.3, 1, 0, 0, 0)), **contact)


def tripod() -> pg.Model:
    box = {"kind": "box", "size": (0.3, 0.2, 0.1)}
    bodies = [pg.Body(name="trunk", joint="free", mass=3.0, inertia=np.diag([0.02, 0.03, 0.04]),
                      shape=box, q=(0, 0, 0.35, 1, 0, 0, 0))]  # fmt: skip
    contacts, forces = [pg.Contact(name="belly", body="trunk")], []
    leg = {"axes": (0, 1, 0), "mass": 0.3, "com": (0, 0, -0.1),
           "inertia": np.diag([2e-3, 2e-3, 1e-4]),
           "shape": {"kind": "sphere", "radius": 0.03, "position": (0, 0, -0.25)}}  # fmt: skip
    for i, at in enumerate([(0.15, 0.1, 0.0), (0.15, -0.1, 0.0), (-0.15, 0.0, 0.0)]):
        name, points = f"leg{i}", {} if i == 2 else {"points": [(0, 0, -0.28)]}
        bodies.append(pg.Body(name=name, parent="trunk", link=at, **leg))
        contacts.append(pg.Contact(name=f"foot{i}", body=name, restitution=0.3 * i, **points))
        forces.append(pg.Servo(name=name, body=name, kp=30.0, kd=0.5, target=0.4, torque_limit=3.0))
    return pg.Model(bodies=bodies, contacts=contacts, forces=forces, ground={"friction": 0.6})


def alone(model: pg.Model, given: dict, i: int, **options) -> pg.Stepper:
    for path, values in given.items():
        model = Path(model, path).set(model, float(values[i]))
    return pg.Stepper(model, **options)


def equal_bits(model, size, act, given=None, again=None, lanes=None, **options):
    """Drive batches and one Stepper per instance by `act`, and compare the bits of their states.

    `act(stepper, pick)` takes the entry of an instance out of an array by `pick`.
    """
    given = given or {}
    singles = [alone(model, given, i, **options) for i in range(size)]
    for i, single in enumerate(singles):
        act(single, lambda x, i=i: x[i])
        if again == i:
            single.reset()
        if again is not None:
            single.step(n=20)
    assert len({single.q.tobytes() for single in singles}) > 1
    for threads, order in ((1, slice(None)), (2, slice(None, None, -1))):
        turned = {path: x[order] for path, x in given.items()} or None
        batch = pg.BatchStepper(model, size, set=turned, threads=threads, **options)
        assert lanes is None or isinstance(batch._many, lanes)
        act(batch, lambda x, order=order: x[order])
        if again is not None:
            batch.reset(which=[range(size)[order][again]])
            batch.step(n=20)
        assert batch.ok.all()
        for k, single in zip(range(size)[order], singles):
            assert np.array_equal(batch.q[k], single.q)
            assert np.array_equal(batch.v[k], single.v)
            assert batch.t[k] == single.t
            assert batch.work[k] == pytest.approx(single.recording.steps.ledger[0], abs=1e-12)
            for touch, gap in single.contact_gap.items():
                np.testing.assert_allclose(batch.contact_gap[touch][k], gap, atol=1e-6)
                force = single.contact_force[touch]
                np.testing.assert_allclose(batch.contact_force[touch][k], force, atol=1e-6)
    return singles


def go(*calls):
    """Return an act of calls: a count of steps, or a method and its arguments, arrays picked."""

    def act(stepper, pick) -> None:
        for call in calls:
            name, *given = call if isinstance(call, tuple) else ("step", None, call)
            getattr(stepper, name)(*(pick(x) if isinstance(x, np.ndarray) else x for x in given))

    return act


def spread(low, high, count=3):
    return np.linspace(low, high, count)


def tumbling():
    """Chaotic motion on feet: another rounding would soon be another motion."""
    given = {"bodies.trunk.mass": (2, 4), "ground.friction": (0.2, 0.9), "forces.leg1.kp": (10, 50)}
    given = {path: spread(*ends, WIDE) for path, ends in given.items()}
    rng = np.random.default_rng(3)
    v, targets = rng.normal(0, 1.5, (WIDE, 9)), rng.uniform(-0.8, 0.8, (WIDE, 3))
    aims = (("target", f"leg{k}", targets[:, k]) for k in range(3))
    act = go(("reset", None, v), 250, *aims, 150)
    return tripod(), WIDE, act, {"given": given, "lanes": FeetLanes}


def sunk():
    start = pg.Stepper(tripod())
    start.step(n=400)
    deeper = np.repeat([start.q], WIDE, axis=0)
    deeper[:, 2] -= np.append(0.0, np.geomspace(1e-9, 3e-3, WIDE - 1))
    return tripod(), WIDE, go(("reset", deeper), 60), {"lanes": FeetLanes}


def walking(name):
    """Pushed walks in different phases and gaits, some of which fall. Damped joints are stiff."""
    model = built_in("quadruped" if name == "bound" else "quadruped_hips").model
    for leg in ("left_radius", "right_tibia", "lumbar"):
        model = model.edit(leg, kind="body", damping=[0.02])
    gait = f"scenarios.{name}.gait"
    given = {
        f"{gait}.clearance": spread(0.9, 1.1, WIDE) * Path(model, f"{gait}.clearance").present,
        f"{gait}.turn": spread(0.0, 0.3, WIDE),
        "bodies.pelvis.mass": spread(0.8, 1.1, WIDE) * model["pelvis"].mass,
    }
    v = np.random.default_rng(5).normal(0, 0.2, (WIDE, sum(body.dof for body in model.bodies)))
    v[2] += 3.0
    options = {"given": given, "again": 1, "lanes": FeetLanes, "scenario": name}
    return model, WIDE, go(("reset", None, v), 200), options


def closed(name, scenario, path, span, method="rk4"):
    options = {"again": 2, "scenario": scenario, "method": method}
    return built_in(name).model, WIDE, go(40, 10), {"given": {path: spread(*span, WIDE)}, **options}


def touching(law, method):
    tau = np.random.default_rng(0).normal(0, 0.1, (3, 7))
    options = {"method": method, "step": 2e-4}
    given = {"bodies.box.mass": spread(0.8, 1.2)}
    return box(law=law), 3, go(("step", tau, 800)), {"given": given, **options}


def remembering(method):
    """Return instances with memory of implicit methods. The one at rest stays so."""
    start = np.array([[1.0], [0.5], [0.0], [-1.0]])
    act = go(("reset", start[::-1]), 7, ("reset", start), *[1] * 40)
    return pendulum().replace(gravity=(0, 0, 0)), 4, act, {"again": 1, "method": method}


def stiff_and_far(law):
    """Steps near a stiff contact are divided, those of a ball 5 m above are not."""
    given = {"bodies.ball.q.2": np.array([0.13, 5.0])}
    return ball(law=law), 2, go(50, 50, 50, 50), {"given": given, "step": 1e-3}


@njit
def push(t, q, v):
    return -5.0 * q - v


def given_stiffness(law):
    """A reset equals a new start: without a stiffness it would fit the speed at the start."""
    rng = np.random.default_rng(4)
    q = np.tile([0, 0, 0.15, 1, 0, 0, 0, 0.0], (3, 1))
    q[:, 3:7] = rng.normal(size=(3, 4))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    act = go(("reset", q, rng.normal(size=(3, 7))), 150)
    return box(law=law, stiffness=2e4), 3, act, {}


CASES = {
    "tumbling": tumbling,
    "sunk": sunk,
    **{name: partial(walking, name) for name in ("trot", "gallop", "bound")},
    "quadruped": partial(closed, "quadruped", "stance", "bodies.pelvis.mass", (7, 9)),
    "slider crank": partial(closed, "slider_crank", "turn", "gravity.2", (-12, 3)),
    "four bar": partial(closed, "four_bar", "turn", "bodies.coupler.mass", (1, 2), EULER),
    "disc": partial(closed, "rolling_disc", "roll", "gravity.2", (-12, -7), EULER),
    "redundant": partial(closed, "bricard", "fall", "gravity.2", (-12, -7)),
    "rigid": partial(touching, "complementarity", "moreau_jean"),
    "soft": partial(touching, "soft", "rk4"),
    "penalty": partial(touching, "penalty", "rk4"),
    "penalty impulses": partial(touching, "penalty", "moreau_jean"),
    **{f"divided {law}": partial(stiff_and_far, law) for law in ("soft", "penalty")},
    **{f"stiffness {law}": partial(given_stiffness, law) for law in ("soft", "penalty")},
    "gauss6": partial(remembering, "gauss6"),
    "left out": lambda: (box(), 3, go(250), {"given": {"bodies.box.v.3": np.ones(3)} | {
        f"contacts.sole.{field}": np.array(values) for field, values in {
            "friction": [0.3, 0.5, 0.9], "restitution": [0.4, 0.2, 0.0],
            "static_friction": [1.0, 1.2, 1.6]}.items()}}),
    "compiled torques": lambda: (
        pendulum(), 3, go(50), {"given": {"bodies.rod.mass": spread(1, 3)}, "tau": push}),
    "targets": lambda: (box(), 2, go(("target", "hinge", np.array([0.1, 0.9])), 200), {}),
}  # fmt: skip


GAITS = ("trot", "gallop", "bound")


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=pytest.mark.nightly) if x in GAITS[1:] else x for x in CASES]
)
def test_each_instance_has_the_bits_of_its_single_run(name):
    model, size, act, options = CASES[name]()
    singles = equal_bits(model, size, act, **options)
    if name in GAITS:
        assert 0 < sum(single.recording.user.fallen[0] >= 0.0 for single in singles) < WIDE
    if name == "gauss6":
        assert singles[2].q == 0.0


def slider(force, **fields):
    body = pg.Body(name="x", joint="prismatic", axes=(1, 0, 0), **fields or {"mass": 1.0})
    return pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[force])


def rods():
    """Thin rods of other lengths: either moment alone would belong to no rigid body."""
    length = np.array([1.0, 0.3, 2.0])
    inertia = np.diag([1 / 12, 1 / 12, 1e-4])
    rod = pg.Body(name="r", axes=(0, 1, 0), com=(0, 0, -0.5), inertia=inertia, q=0.3)
    given = {f"bodies.r.inertia.{k}.{k}": length**2 / 12 for k in (0, 1)}
    given["bodies.r.com.2"] = -length / 2
    return pg.Model(bodies=[rod]), given, -9.81 * length / 2 * np.sin(0.3) / (length**2 / 3)


def boxes():
    """Two boxes of 500 kg/m^3, the first of which has another length: the other one stays."""
    shapes = [{"kind": "box", "size": (0.2, 0.2, 0.2), "position": (0, 0, z)} for z in (0, 1)]
    model = slider(pg.Motor(name="m", body="x", torque=3.0), shapes=shapes, density=500,
                   derived=("mass", "com", "inertia")).replace(gravity=(1, 0, 0))  # fmt: skip
    return model, {"bodies.x.shape.size.0": [0.2, 0.4]}, [1 + 3 / 8, 1 + 3 / 12]


def gears(given=(2.0, 4.0, 8.0)):
    model = slider(pg.Motor(name="m", body="x", torque=0.5, gear=3.0))
    return model, {"forces.m.gear": np.array(given)}, [1.0, 2.0, 4.0]


def coefficients():
    tendon = pg.Tendon(name="t", body="x", coefficients={"x": [2.0]}, stiffness=10.0, rest=1.0)
    return slider(tendon), {"forces.t.coefficients.x.0": [2.0, 4.0]}, [20.0, 40.0]


@pytest.mark.parametrize("case", [rods, boxes, gears, coefficients])
def test_accelerations_follow_the_numbers_of_each_instance(case):
    model, given, expected = case()
    batch = pg.BatchStepper(model, len(expected), set=given, threads=2)
    assert batch.acceleration()[:, 0] == pytest.approx(expected, rel=1e-12)
    if case is gears:
        equal_bits(model, 3, go(100), given)


def test_an_instance_that_fails_stays_is_named_and_goes_on_after_a_reset():
    """rk4 cannot step one spring. The neighbours take the steps that they take alone."""
    given = {"bodies.rod.stiffness.0": [1.0, 1e12, 2.0]}
    batch = pg.BatchStepper(pendulum(), 3, set=given)
    assert batch.step(n=100).tolist() == [True, False, True]
    at = batch.q[1].copy()
    assert np.isfinite(batch.q).all()
    batch.step(n=100)
    assert np.array_equal(batch.q[1], at)
    assert list(batch.failures) == [1]
    assert "rod" in batch.failures[1]
    neighbours = [alone(pendulum(), given, i) for i in (0, 2)]
    for stepper, i in zip(neighbours, (0, 2)):
        stepper.step(n=200)
        assert np.array_equal(batch.q[i], stepper.q)
    batch.reset(which=[1], numbers=[0])
    assert batch.failures == {}
    batch.step(n=200)
    assert np.array_equal(batch.q[1], neighbours[0].q)


def test_a_notice_about_the_start_lists_its_instances():
    model = pendulum().edit("rod", limits=((-0.5, 0.8),))
    batch = pg.BatchStepper(model, 3, set={"bodies.rod.q.0": [0.0, 0.9, 0.7, 0.9]})
    (text,) = (x for x in pg.Stepper(model.edit("rod", q=0.9)).notices if "starts" in x)
    assert {said: x.tolist() for said, x in batch.notices.items() if "rod" in said} == {text: [1]}
    batch.reset(which=[1, 2], numbers=[0, 3])
    assert batch.notices[text].tolist() == [2]
    batch.reset(numbers=0)
    assert text not in batch.notices


def test_angles_that_lanes_cannot_take_are_taken_alone():
    """m g c cos q comes from the angle's exact sine, by a Stepper of each instance."""
    model, given = pendulum(), {"bodies.rod.mass": np.linspace(0.8, 1.2, SIZE)}
    far = np.array([1.0, -1.5e10, 2e16, 3e20, 0.5])[:, None]
    fast = np.array([1.0, 2e8, 1e19, 4e7, -1e12])[:, None]  # rad/s: turned far by the first step
    free = model.edit("rod", stiffness=0.0, damping=0.0)
    batch, moving = (pg.BatchStepper(m, SIZE, set=given) for m in (model, free))
    batch.reset(far, [3.0])
    moving.reset([0.3], fast)
    tau, vdot = batch.inverse_dynamics(np.ones((SIZE, 1))), batch.acceleration()
    assert moving.step(n=5).all()
    for i in range(SIZE):
        mech = alone(model, given, i).mech
        one = pg.Stepper(mech, q=far[i], v=[3.0])
        np.testing.assert_allclose(tau[i], mech.inverse_dynamics(far[i], [3.0], [1.0]), rtol=1e-13)
        np.testing.assert_allclose(vdot[i], one.vdot, rtol=1e-13)
        one = pg.Stepper(alone(free, given, i).mech, q=[0.3], v=fast[i])
        one.step(n=5)
        np.testing.assert_allclose(moving.q[i], one.q, rtol=1e-13)
        np.testing.assert_allclose(moving.v[i], one.v, rtol=1e-13)
        assert moving.t[i] == one.t


def test_servos_in_lanes_have_targets_of_their_own():
    """The error is 1e-9. Servos with a limit, even if not reached, are stepped one by one."""
    targets, given = np.linspace(-1.0, 1.0, SIZE), np.linspace(0.0, 2.0, SIZE)[:, None]
    servo = {"name": "hold", "body": "rod", "kp": 20.0, "kd": 1.0, "target": 0.2}
    servos = pg.Servo(**servo), pg.Servo(**servo, torque_limit=1e9)
    batches = [pg.BatchStepper(pendulum().add(each), SIZE) for each in servos]
    for batch in batches:
        batch.target("hold", targets)
        batch.step(given, n=500)
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
    batch = pg.BatchStepper(box(law=law), 3, set={"bodies.box.mass": [1, 2, 3]}, step=2e-4)
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
        pg.BatchStepper(box(law=law), 3, step=2e-4).restore(saved)


RADII = {"bodies.rod.shape.radius": [1, 2], "bodies.rod.shapes.0.radius": [2, 3]}
BATCHES = [  # (model, options of a batch of 2, what is named)
    *((pendulum, {name: value}, name) for name, value in {
        "size": 0, "threads": 0, "step": -1.0, "method": "dopri", "set": {}}.items()),
    (box, {"method": "rk4"}, "moreau_jean"),
    *((pendulum, {"set": {path: values}}, fact) for path, values, fact in (
        ("bodies.rod.mas", [1, 2], "bodies.rod.mas.*mass"),
        ("bodies.rod.mass", [1], "bodies.rod.mass.* 2"),
        ("bodies.rod.mass", [1, np.nan], "finite"),
        ("bodies.rod.mass", [1, -1], "entry 1 .*= -1"))),
    (lambda: gears()[0], {"set": {"forces.m.gear": [1.0, 3.0]}}, "1 for gears"),
    (lambda: pendulum().edit("rod", stiffness=0.0), {"set": {"bodies.rod.damping.0": [1, 0]}},
     "damper"),
    (lambda: pendulum().edit("rod", shape={"kind": "sphere", "radius": 0.1}), {"set": RADII},
     "radius.*twice"),
    (pendulum, {"tau": lambda t, q, v: -q}, "njit"),
    (pendulum, {"tau": [[1], [2], [3]]}, r"tau.*\(2, 1\)"),
]  # fmt: skip
CALLS = [  # of a batch of 2 pendulums, and what is named
    (lambda b: b.step(np.zeros((2, 3))), r"tau.*\(2, 1\)"),
    *((lambda b, x=x: b.step(x), "finite|numbers")
      for x in (np.full((2, 1), 5j), np.ma.masked_all((2, 1)), [["1"]] * 2, [[True]] * 2)),
    (lambda b: b.step(n=0), "n:"),
    (lambda b: b.reset(which=[2]), "0 to 1"),
    (lambda b: b.reset(np.zeros((3, 1))), r"q.*\(2, 1\)"),
    (lambda b: b.reset(numbers=[5, 0]), "numbers.* 2 "),
    (lambda b: b.step(100), "n=100"),
    (lambda b: pg.Stepper(b.mech).step(100), "n=100"),
    (lambda b: b.target("knee", 1.0), "knee"),
    (lambda b: b.restore(b"nothing"), "BatchStepper.save"),
    (lambda b: Path(box(), "bodies.lid.limits.0"), "limits"),
    (lambda b: Path(box(), "scenarios.none.q.box.0"), "none"),
    (lambda b: Path(box(), "forces.hinge.body"), "number"),
]  # fmt: skip


@pytest.mark.parametrize(("model", "given", "match"), BATCHES + [(pendulum, *x) for x in CALLS])
def test_bad_batches_and_calls_are_refused(model, given, match):
    call = given if callable(given) else lambda batch: batch
    options = {} if callable(given) else given
    with pytest.raises(pg.InputError, match=match):
        call(pg.BatchStepper(model(), **{"size": 2, **options}))


@pytest.mark.parametrize(
    ("way", "law"), [("fork", None), ("spawn", "complementarity"),
                     pytest.param("spawn", "soft", marks=pytest.mark.nightly)]
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_snapshot_goes_on_in_another_process(way, law):
    """The process has its own threads and compiles soft contacts."""
    model, size = (box(law=law), 2) if law else (pg.Model.serial(2), 4 * LANE_WIDTH)
    batch = pg.BatchStepper(model, size, threads=2, step=2e-4)
    batch.step(n=700)
    with multiprocessing.get_context(way).Pool(1) as pool:  # ended if it hangs
        there = pool.apply_async(_stepped, (model, size, batch.save())).get(timeout=600)
    batch.step(n=100)
    assert np.array_equal(there, batch.q)


def _stepped(model: pg.Model, size: int, snapshot: bytes) -> np.ndarray:
    batch = pg.BatchStepper(model, size, threads=2, step=2e-4)
    batch.restore(snapshot)
    batch.step(n=100)
    return batch.q.copy()


@pytest.mark.parametrize("law", ["complementarity", "penalty"])
def test_gaps_follow_the_states_before_the_first_step_and_in_flight(law: str):
    """The gap of a ball is its height less its radius, whatever it touched before."""
    own: dict[str, float] = {"stiffness": 1e5} if law == "penalty" else {}
    model = ball(law=law, restitution=0.8, **own)
    radii = np.array([0.1, 0.05, 0.1])
    batch = pg.BatchStepper(model, 3, set={"bodies.ball.shape.radius": radii})
    stepper = pg.Stepper(model)
    for _ in range(6):
        np.testing.assert_allclose(batch.contact_gap["floor"], batch.q[:, 2] - radii, atol=1e-12)
        assert stepper.contact_gap["floor"] == batch.contact_gap["floor"][0]
        for each in (batch, stepper):
            each.step(n=80)
    batch.reset(batch.q * [1, 1, 2, 1, 1, 1, 1])
    np.testing.assert_allclose(batch.contact_gap["floor"], batch.q[:, 2] - radii, atol=1e-12)


def test_a_query_of_the_acceleration_changes_nothing_that_outputs_read():
    sensor = pg.Output(name="felt", kind="accelerometer", at="rod")
    batch = pg.BatchStepper(pendulum().replace(outputs=[sensor]), 2)
    batch.step([2.0], n=3)
    before, kept = batch.outputs["felt"], batch.save()
    pushed = batch.acceleration([50.0])
    assert (abs(pushed - batch.acceleration([2.0])) > 1.0).all()
    assert np.array_equal(batch.outputs["felt"], before)
    assert batch.save() == kept


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_a_trace_of_trees_has_the_states_of_single_steps(method: str):
    """Also of an instance whose angle is far, one that fails and one that has failed."""
    drive = pg.Servo(name="drive", body="rod", kp=3.0, target=pg.Table(t=(0, 0.02), value=(0, 1)))
    model = pendulum().replace(forces=[drive])
    given = {"bodies.rod.stiffness.0": [1.0, 2.0, 1e9, 1e12, 3.0]}
    batches = [pg.BatchStepper(model, SIZE, method=method, set=given) for _ in range(2)]
    for batch in batches:
        batch.reset([1e12], [0.0], which=[1])
        batch.step(n=15)
    for state in batches[0].trace(n=40):
        batches[1].step()
        assert np.array_equal(state, np.concatenate((batches[1].q, batches[1].v), axis=1))
    assert batches[0].t.tolist() == batches[1].t.tolist()
    assert batches[0].failures == batches[1].failures
    assert 3 in batches[0].failures
