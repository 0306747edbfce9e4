"""Programs from the habits of other tools: what runs, and what the first message names."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import words
from tests.refusals import assert_names, refusal

MODEL = pg.Model.serial(2)
MECH = pg.Mechanism(MODEL)
BALL = pg.Body("ball", joint="free", mass=0.5, shape=pg.Shape("sphere", radius=0.05))
FOUR_BAR = pg.Mechanism(pg.load("four_bar"))
CRANK = FOUR_BAR.names[0]


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: pg.massMatrix(MODEL, [0.1, 0.2]), lambda: MECH.mass_matrix([0.1, 0.2])),
        (lambda: MODEL.inverseDynamics([0, 1], [1, 0], [0, 0]),
         lambda: MECH.inverse_dynamics([0, 1], [1, 0], [0, 0])),
        (lambda: pg.jacobian(MODEL, "2", q=[0.1, 0.2]), lambda: MECH.jacobian([0.1, 0.2], "2")),
        (lambda: MECH.velocity("2", q=[0.1, 0.2], v=[1, 2]),
         lambda: MECH.velocity([0.1, 0.2], [1, 2], "2")),
        (lambda: MECH.mass_matrix({"2": 0.3}), lambda: MECH.mass_matrix([0, 0.3])),
        (lambda: MECH.forward_dynamics({"2": 0.3}, {"1": 2.0}, {"2": 1.0}),
         lambda: MECH.forward_dynamics([0, 0.3], [2, 0], [0, 1])),
        (lambda: pg.simulate(MODEL, t_end=0.1, qpos=[0.1, 0], timeStep=1e-3, method="rk4").q,
         lambda: pg.simulate(MODEL, t_end=0.1, q=[0.1, 0], step=1e-3, method="rk4").q),
        (lambda: pg.Shape("sphere", size=(0.05,)), lambda: pg.Shape("sphere", radius=0.05)),
        (lambda: pg.Shape("sphere", size=0.05), lambda: pg.Shape("sphere", radius=0.05)),
        (lambda: pg.Shape("box", extents=(1, 2, 3)), lambda: pg.Shape("box", size=(1, 2, 3))),
        (lambda: pg.Cylinder(radius=1, height=2), lambda: pg.Cylinder(radius=1, length=2)),
        (lambda: pg.Body("a", jointType="revolute", range=(-1, 1)),
         lambda: pg.Body("a", limits=((-1, 1),))),
        (lambda: pg.Contact("*"), lambda: pg.Contact(body="*")),
        (lambda: pg.Contact("ball", friction=0.1), lambda: pg.Contact(body="ball", friction=0.1)),
        (lambda: pg.Motor("rod", limit=2.0), lambda: pg.Motor(body="rod", torque_limit=2.0)),
        (lambda: MODEL.add(BALL, pg.Contact("ball", mu=0.1, e=0.3)),
         lambda: MODEL.add(BALL).add(pg.Contact(body="ball", friction=0.1, restitution=0.3))),
        (lambda: MODEL.add([BALL, pg.Contact("ball")]),
         lambda: MODEL.add(BALL).add(pg.Contact("ball"))),
        (lambda: pg.Weld("a", other="b"), lambda: pg.Weld(body="a", other="b")),
    ],
)  # fmt: skip
def test_a_call_in_the_form_of_other_tools_is_ours(theirs, ours):
    a, b = theirs(), ours()
    assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: pg.simulate(MODEL, degrees=True), ("np.deg2rad",)),
        (lambda: pg.simulate(MODEL, angleUnit="deg"), ("np.deg2rad",)),
        (lambda: MECH.inverse_dynamics([0, 0], [0, 0], [0, 0], driven=["1"]),
         ("constrained_inverse_dynamics(q, v, vdot, actuated=",)),
        (lambda: pg.optimize_trajectory, ("pg.optimise(", "pg.Table(")),
        (lambda: pg.DirectCollocation, ("pg.optimise(", "pg.Table(")),
        (lambda: pg.Contact("ball", normal=(0, 0, 1)), ("pg.Ground(slope=", "uphill")),
        (lambda: pg.Ground(normal=(0, 0, 1)), ("slope", "uphill")),
        (lambda: pg.Contact("ball", radius=0.1), ("pg.Shape(", "radius=")),
        (lambda: pg.Contact("ball", solref=(0.02, 1)), ('law="soft"', "stiffness")),
        (lambda: pg.simulate(MODEL, method="implicit"), ("did you mean radau5",)),
        (lambda: pg.simulate(MODEL, method="LSODA"), ("did you mean radau5",)),
        (lambda: pg.simulate(MODEL, method="Verlet"), ("did you mean semi_implicit_euler",)),
        (lambda: pg.Drag("d", body="ball", area=0.1, Cd=1.0), ("size=", "density", "pg.Wrench(")),
        (lambda: pg.Body("a", rpy=(0, 0, 1)), ("Rotation.from_euler", "scalar_first=True")),
        (lambda: pg.Body("a", lower=-1, upper=1), ("limits=((low, high),)",)),
        (lambda: pg.Shape("box", halfExtents=(1, 1, 1)), ("twice", "size=")),
        (lambda: pg.setGravity, ("pg.Model(..., gravity=",)),
        (lambda: pg.computeJointJacobians, ("jacobian",)),
        (lambda: pg.CalcMassMatrix, ("mass_matrix",)),
        (lambda: pg.AddMultibodyPlantSceneGraph, ("pg.Model(bodies=[pg.Body(",)),
        (lambda: pg.SystemContainer, ("pg.Model(bodies=[pg.Body(",)),
        (lambda: pg.setJointMotorControl2, ("pg.Servo(", "tau=")),
        (lambda: pg.applyExternalForce, ("pg.Wrench(", "external_at")),
        (lambda: pg.simulate(MODEL, x0=[0, 0, 0, 0]), ("q=", "v=", "two arguments")),
        (lambda: pg.simulate(MODEL, n_steps=10), ("step=", "frames=")),
        (lambda: pg.simulate(MODEL, callback=print), ("progress=", "events=", "pg.Stepper")),
        (lambda: pg.Motor("1", torque=lambda t: t), ("'=2*sin(3*t)'", "tau=f(t, q, v)")),
        (lambda: pg.Motor("1", torque=[0.0, 1.0]), ("pg.Table(t=", "value=")),
        (lambda: pg.Wind, ("Wrench",)), (lambda: MODEL.set, ("edit(",)),
        (lambda: pg.DHRobot, ("link, rotation and axes",)),
        (lambda: pg.KanesMethod, ("mass_matrix(q)",)),
        (lambda: pg.Model([BALL], forces=[pg.Drag("d", body="ground", size=(1, 1, 1))]),
         ("ground", "ball")),
        (lambda: pg.Model([BALL], forces=[pg.Motor("world")]), ("ground", "ball")),
        (lambda: pg.simulate(MODEL, t_end=0.1, tau=lambda t, q, v: [1, [2, 3]]),
         ("tau", "[1, [2, 3]]", "2 numbers")),
        (lambda: pg.simulate(MODEL, t_end=0.1, tau=lambda t, q, v: [1, 2, 3]), ("tau", "(3,)")),
        (lambda: pg.simulate(MODEL, t_end=0.1, q=[1, [2, 3]]), ("q", "[1, [2, 3]]")),
    ],
)  # fmt: skip
def test_the_first_message_names_the_call_and_its_arguments(call, named: tuple[str, ...]):
    with pytest.raises((pg.ModelError, pg.InputError, AttributeError)) as refused:
        call()
    assert_names(str(refused.value), *named)


def test_advice_is_given_only_for_names_that_none_of_ours_has():
    ours = {*dir(pg)}.union(*(getattr(pg, name).model_fields for name in dir(pg)
                              if hasattr(getattr(pg, name), "model_fields")))  # fmt: skip
    assert {name for name, told in words.ADVICE.items() if not told[0][0]} & ours == set()
    assert words.advice("mass", pg.Body.model_fields) == ""
    assert "twice" not in str(refusal(lambda: pg.Shape("box", sise=(1, 1, 1))))


def test_a_dictionary_holds_the_joints_that_it_names_and_the_others_follow_the_loops():
    """Power: the crank's torque does the work that changes the energy."""
    q, v, _ = FOUR_BAR.assemble({CRANK: 1.0}, {CRANK: 10.0})
    joint = FOUR_BAR.joints[CRANK]
    assert q[joint.q] == pytest.approx(1.0)
    assert v[joint.v] == pytest.approx(10.0)
    state = {CRANK: 1.0}, {CRANK: 10.0}, {CRANK: 0.0}
    tau = FOUR_BAR.constrained_inverse_dynamics(*state, actuated=[CRANK])
    ends = [FOUR_BAR.assemble({CRANK: 1.0 + s}, {CRANK: 10.0}) for s in (1e-5, -1e-5)]
    rise = np.subtract(*(sum(FOUR_BAR.energy(q, v)) for q, v, _ in ends)) / 2e-5
    assert tau[joint.v] == pytest.approx(rise, rel=1e-6)
    vdot = FOUR_BAR.constrained_dynamics(q, v, tau)[0]
    assert vdot[joint.v] == pytest.approx(0.0, abs=1e-9)


def test_inverse_kinematics_says_what_is_left():
    found = MECH.inverse_kinematics("2", position=MECH.pose([0.3, 0.4], "2").position)
    assert found.success
    assert found.residual < 1e-9
    assert type(found.q) is np.ndarray
    with pytest.raises(pg.InputError, match="misses the target by"):
        MECH.inverse_kinematics("2", position=(9, 9, 9))


def test_weights_of_inputs_are_given_by_the_bodies_that_they_drive():
    cart = pg.Body("cart", joint="prismatic", axes=(1, 0, 0))
    model = pg.Model([cart], forces=[pg.Motor("push", body="cart")])
    a, b = (pg.lqr(model, 1.0, {name: 2.0}) for name in ("cart", "push"))
    assert np.array_equal(a.K, b.K)


def test_an_inertia_of_zero_that_is_given_stays_with_a_shape():
    point = pg.Body("a", axes=(0, 1, 0), com=(0.5, 0, 0))
    for body, solid in ((point, True), (point.model_copy(update={"inertia": (0, 0, 0)}), False)):
        model = pg.Model([body]).edit("a", shape=pg.Shape("sphere", radius=0.1))
        assert bool(np.any(model.bodies[0].inertia)) == solid


@pytest.mark.parametrize(
    ("link", "place", "told"),
    [((0, 0, 1), (0, 0, 1), True), ((0, 0, 1), (0, 0, 0), False), ((0, 0, 0), (0, 0, 1), False),
     ((1, 2, 3), (1, 2, 3), True), ((0, 0, 1), (0, 0, 2), False)],
)  # fmt: skip
def test_a_place_that_stands_in_the_link_and_in_q_is_told(link, place, told: bool):
    model = pg.Model([pg.Body("a", joint="free", link=link, inertia=(1, 1, 1))])
    run = pg.simulate(model, t_end=0.01, q=[*place, 1, 0, 0, 0])
    assert any("link" in text and "'a'" in text for text in run.notices) == told


def test_impacts_are_located_and_what_is_known_to_a_step_says_so():
    """Free fall from a height h meets the ground after sqrt(2 h / g)."""
    model = pg.Model([BALL], contacts=[pg.Contact("ball", restitution=0.7)])
    step, falls = 1e-3, np.sqrt(2 * 0.3 / 9.81)
    a, b = (pg.simulate(model, t_end=0.4, q={"ball": (0, 0, 0.35)}, method=method, step=step)
            for method in ("moreau_jean", "dop853"))  # fmt: skip
    for run in (a, b):
        assert run.impacts[0].t == pytest.approx(falls, abs=1e-9)
        assert "step" not in run.impacts[0].cause
    at_rest = pg.simulate(model, t_end=0.1, q={"ball": (0, 0, 0.05 + 1e-6)}, step=step)
    assert all("step of 0.001 s" in event.cause for event in at_rest.events)


def test_a_motor_between_its_own_links_does_not_hold_a_free_body():
    arm = pg.Body("arm", parent="ball", axes=(0, 1, 0), com=(0.1, 0, 0), inertia=(1, 1, 1))
    model = pg.Model([BALL, arm], forces=[pg.Motor("arm")], ground=pg.Ground(friction=0.4))
    assert any("has no contact" in text for text in model.doubts)
    held = model.add(pg.Spring("ball", stiffness=1.0))
    assert not any("has no contact" in text for text in held.doubts)


def test_a_long_search_says_how_far_it_is(monkeypatch, capsys):
    from pgraph_core.search import telling

    monkeypatch.setattr(telling, "SILENCE", 0.0)
    search = (MODEL, "peak v.1", {"bodies.2.mass": (0.5, 2.0)})
    options = {"t_end": 0.1, "method": "rk4", "most": 1}
    pg.optimise(*search, **options)
    assert "run" in capsys.readouterr().err
    pg.optimise(*search, progress=False, **options)
    assert capsys.readouterr().err == ""


def test_events_of_the_user_stand_among_those_of_contacts_in_order_of_time():
    model = pg.Model([BALL], contacts=[pg.Contact("ball", restitution=0.5)])
    start = {"ball": [0.0, 0.0, 0.5]}
    top = lambda t, q, v: v[5]  # noqa: E731
    run = pg.simulate(model, q=start, t_end=0.7, events=top)
    assert len(run.events) == len(run.user_events) + len(run.contacts.events) > len(run.impacts) > 0
    times = [event.time for event in run.events]
    assert times == sorted(times) == [event.t for event in run.events]


def test_a_call_without_the_memory_that_it_needs_says_so():
    free = {"bodies.1.mass": (0.1, 2.0)}

    t = np.broadcast_to(1.0, 1 << 59)  # takes no memory until it is copied
    with pytest.raises(MemoryError, match=r"fit: needs more memory.*EiB") as found:
        pg.fit(MODEL, {"t": t, "1": t}, free=free)
    assert isinstance(found.value, pg.PgraphError)


def test_a_controller_without_a_signal_says_which_value_is_missing():
    with pytest.raises(pg.ModelError, match=r"signal: is missing; give the signal to control.*=q"):
        pg.PID("i", kp=2.0)


def test_torques_of_a_tree_with_loops_point_to_both_ways_that_impose_them():
    mech = pg.Mechanism(FOUR_BAR.model)
    with pytest.warns(UserWarning, match="constrained_inverse_dynamics.*pg.Motion"):
        tree = mech.inverse_dynamics(*FOUR_BAR.home(), np.zeros(FOUR_BAR.nv))
    free = pg.Mechanism(FOUR_BAR.model.replace(constraints=()))
    assert np.array_equal(tree, free.inverse_dynamics(*free.home(), np.zeros(free.nv)))
