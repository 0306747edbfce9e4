"""Words of other tools are understood."""

import gc
import warnings
import weakref
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("given", [(1, 2, 2.5), [1.0, 2.0, 2.5], np.array([1, 2, 2.5])])
def test_three_moments_are_the_diagonal_of_the_inertia(given):
    body = pg.Body(name="a", inertia=given)
    assert body.inertia == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))
    assert pg.Model(bodies=[body]).edit("a", inertia=given).bodies[0] == body


@pytest.mark.parametrize(
    "given", [(1, 2), (1, 2, 3, 4), (1, 2, 4), (1, -1, 1), (1, 2, "x"), 3.0, True]
)
def test_moments_that_no_body_has_are_refused(given):
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body(name="a", inertia=given)


def test_a_run_gives_each_of_its_columns_by_name():
    ball = pg.Body(name="ball", joint="free", inertia=(0.01,) * 3)
    arm = pg.Body(name="arm", joint="revolute", axes=((0, 1, 0),), com=(1, 0, 0))
    floor = pg.Contact(name="floor", body="ball", points=((0, 0, 0),))
    run = pg.simulate(pg.Model(bodies=[ball, arm], contacts=[floor]), t_end=0.1)
    for name, column in run.columns().items():
        np.testing.assert_array_equal(run[name], getattr(column, "values", column))


def arm():
    bodies, parent = [], "ground"
    for k, axis in enumerate([(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]):
        name = f"j{k + 1}"
        link = (0, 0, 0.3) if k in (1, 2, 3) else (0, 0, 0.05)
        place = {"parent": parent, "link": link, "limits": ((-2.5, 2.5),)}
        bodies.append(pg.Body(name=name, axes=(axis,), inertia=(0.01,) * 3, **place))
        parent = name
    return pg.Mechanism(pg.Model(bodies=bodies))


def test_every_pose_within_the_limits_is_reached():
    mech, random = arm(), np.random.default_rng(5)
    for q in random.uniform(-2.4, 2.4, (30, 6)):
        found = mech.inverse_kinematics({"j6": mech.pose(q, "j6")})
        for one, other in zip(mech.pose(found, "j6"), mech.pose(q, "j6")):
            np.testing.assert_allclose(one, other, atol=1e-7)


def test_a_refusal_says_how_many_starts_were_tried():
    mech = arm()
    with pytest.raises(pg.InputError, match=r"5 starts.* m"):
        mech.inverse_kinematics({"j6": (9, 0, 0)}, starts=5)
    wrong: Any = (0, -1, 1.5, True, "many", 10**9)
    for starts in wrong:
        with pytest.raises(pg.InputError, match="starts"):
            mech.inverse_kinematics({"j6": (0.1, 0, 0)}, starts=starts)


def test_velocities_are_given_in_the_axes_asked_for():
    mech, random = arm(), np.random.default_rng(1)
    q, v = random.normal(size=6), random.normal(size=6)
    turn = mech.pose(q, "j5")[1]
    world = mech.velocity(q, v, "j5", (0.1, 0, 0))
    body = mech.velocity(q, v, "j5", (0.1, 0, 0), frame="body")
    np.testing.assert_allclose(world, mech.jacobian(q, "j5", (0.1, 0, 0)) @ v, atol=1e-14)
    np.testing.assert_allclose(turn @ body[:3], world[:3], atol=1e-14)
    np.testing.assert_allclose(turn @ body[3:], world[3:], atol=1e-14)
    wrong: Any = ("tip", None, 1, ["body"])
    for frame in wrong:
        with pytest.raises(pg.InputError, match=r"frame.*world"):
            mech.jacobian(q, "j5", frame=frame)


def test_american_spellings_do_the_same():
    mech = arm()
    q, v = mech.home()
    np.testing.assert_array_equal(mech.center_of_mass(q), mech.centre_of_mass(q))
    np.testing.assert_array_equal(mech.linearize(q, v).A, mech.linearise(q, v).A)


def test_a_run_goes_to_matlab_with_its_names_and_units(tmp_path):
    from scipy.io import loadmat

    names = ("a", "1", "a.0", "é", "a_0", "names")
    bodies = [pg.Body(name=x, joint="free", inertia=(0.01,) * 3) for x in names]
    run = pg.simulate(pg.Model(bodies=bodies), t_end=0.1)
    run.save(tmp_path / "run.mat")
    read = loadmat(tmp_path / "run.mat", simplify_cells=True)
    numbers = {name: x for name, x in run.columns().items() if getattr(x, "unit", "1")}
    names = [str(name) for name in read["names"]]
    assert set(names) <= set(numbers)
    words = [word for word in read if not word.startswith("__") and word not in ("names", "units")]
    assert len(words) == len(names) == len(read["units"])
    for name, word in zip(names, words):
        np.testing.assert_array_equal(read[word], run[name])


def test_a_run_goes_to_xarray_with_its_units():
    pytest.importorskip("xarray")
    run = pg.simulate(arm().model, t_end=0.1)
    table = run.to_xarray()
    np.testing.assert_array_equal(table["j2"], run["j2"])
    assert (table["j2"].units, table["t"].units) == ("rad", "s")


@pytest.mark.parametrize(
    ("name", "ours"),
    [
        ("gradient", "run.gradient"),
        ("Simulator", r"Stepper\(model\)"),
    ],
)
def test_a_function_of_another_program_is_answered_with_ours(name, ours):
    with pytest.raises(AttributeError, match=ours):
        getattr(pg, name)


def test_weights_of_a_regulator_may_be_named():
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=2.0)
    model = pg.Model(bodies=[cart], forces=[pg.Motor(name="push", body="cart")])
    named, by_position = pg.lqr(model, Q=3.0, R=0.5), pg.lqr(model, 3.0, 0.5)
    assert np.array_equal(named.K, by_position.K)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda model: pg.simulate(model, q=np.zeros((9, 2))), r"pg\.simulate_batch\(model, q, v"),
        (lambda model: pg.simulate(model, forces=lambda t, q, v: 0.0), "tau"),
        (lambda _: pg.simulate(pg.Model.serial(3), (0, 5), [0.1] * 3), "t_span="),
        (lambda model: pg.simulate(model, (0, 5), q0=[0.1]), "5] is in the place of q"),
        (lambda model: pg.simulate(model, t_end=0.1).show(fps=30), "fps"),
        (lambda model: pg.PID(name="p", signal="q.arm", kp=1.0), "'=q.arm'"),
    ],
)
def test_a_refusal_names_what_to_write(call, named):
    with pytest.raises(pg.PgraphError, match=named):
        call(pg.Model.serial(2))


@pytest.mark.parametrize(
    ("change", "falls"),
    [
        ({}, True),
        ({"contacts": [pg.Contact(name="c", body="b")]}, False),
        ({"gravity": (0, 0, 0)}, False),
        ({"constraints": [pg.Point(name="p", body="b", other="ground")]}, False),
    ],
)
def test_a_loose_body_that_touches_nothing_is_doubted(change, falls):
    box = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    body = pg.Body(name="b", joint="free", shape=box, derived=("inertia",))
    doubts = pg.Model(bodies=[body], **change).doubts
    assert any("contact" in text for text in doubts) == falls


@pytest.mark.parametrize(
    ("call", "same"),
    [
        (lambda m, q: pg.mass_matrix(m, q), lambda mech, q: mech.mass_matrix(q)),
        (lambda m, q: pg.crba(m, q), lambda mech, q: mech.mass_matrix(q)),
        (lambda m, q: pg.rnea(m, q, v=q, vdot=q), lambda mech, q: mech.inverse_dynamics(q, q, q)),
        (lambda m, q: pg.fk(m, q, "2")[0], lambda mech, q: mech.pose(q, "2")[0]),
        (lambda m, q: pg.linearize(m, q).A, lambda mech, q: mech.linearise(q).A),
        (lambda m, q: pg.jacobian(m, q, "2"), lambda mech, q: mech.jacobian(q, "2")),
    ],
)
def test_a_method_of_a_mechanism_is_a_function_of_a_model(call, same):
    model, q = pg.Model.serial(2), np.array([0.1, -0.2])
    mech = pg.Mechanism(model)
    np.testing.assert_array_equal(call(model, q), same(mech, q))
    np.testing.assert_array_equal(call(mech, q), same(mech, q))
    assert call.__name__ not in dir(pg)


def test_a_method_of_a_model_is_a_function_of_it():
    model = pg.Model.serial(2)
    assert pg.edit(model, "1", mass=3.0) == model.edit("1", mass=3.0)
    for wrong in (3, None, np.zeros(2)):
        with pytest.raises(pg.InputError, match=r"pg\.Model, got"):
            pg.mass_matrix(wrong, [0.1, 0.2])


ARM = pg.Body("arm", axis="y", mass=2.0, com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.01))
HAND = pg.Body("hand", "arm", axis="y", com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.01), link=(0, 0, -1))
TWO = pg.Model(bodies=[ARM, HAND])
Y, Z = (0, 1, 0), (0, 0, 1)
SPHERE = pg.Shape("sphere", radius=0.1)
LOOSE = pg.Body("ball", joint="free", shape=SPHERE, derived=("inertia",))


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: pg.Body("a", parent=ARM), lambda: pg.Body("a", parent="arm")),
        (lambda: pg.Body("a", offset=(0, 0, 1)), lambda: pg.Body("a", link=(0, 0, 1))),
        (lambda: pg.RigidBody("a", joint="6dof"), lambda: pg.Body("a", joint="free")),
        (lambda: pg.Sphere(radius=0.1), lambda: SPHERE),
        (lambda: pg.Cube(size=(1, 1, 1)), lambda: pg.Shape("box", size=(1, 1, 1))),
        (lambda: pg.Loop(body_a="hand", point_a=(0, 0, -1), body_b="arm", point_b=(1, 0, 0)),
         lambda: pg.Point(body="hand", point=(0, 0, -1), other="arm", other_point=(1, 0, 0))),
        (lambda: pg.Contact(body="ball", ground=True, mu=0.1),
         lambda: pg.Contact(body="ball", friction=0.1)),
        (lambda: pg.Model([ARM], springs=[pg.Spring(body_a="ground", body_b=ARM, point_b=Z, k=9)]),
         lambda: pg.Model([ARM], forces=[pg.Spring(body="arm", point=Z, stiffness=9)])),
        (lambda: pg.Model([ARM], dampers=pg.Damper("s", "world", "arm", point_a=Z, c=9)),
         lambda: pg.Model([ARM], forces=[pg.Spring("s", body="arm", point=(0, 0, 0),
                                                   other_point=Z, damping=9)])),
        (lambda: pg.Model([ARM], joints=[pg.Revolute("r", "world", "arm", axis_a=(0, 1, 0))]),
         lambda: pg.Model([ARM], constraints=[pg.Revolute("r", body="arm", other_axis=Y)])),
        (lambda: pg.Model([LOOSE], contacts=[pg.Contact("c", "floor", "ball")]),
         lambda: pg.Model([LOOSE], contacts=[pg.Contact("c", "ball", "ground")])),
        (lambda: pg.Model([ARM, HAND], gears=[pg.Gear("g", "arm", "hand", ratio=2)],
                          motors=[pg.Motor("m", "arm")]),
         lambda: pg.Model([ARM, HAND], constraints=[pg.Gear("g", "arm", "hand", ratio=2)],
                          forces=[pg.Motor("m", "arm")])),
        (lambda: pg.Model([ARM, pg.Motor("m", "arm"), HAND]),
         lambda: pg.Model([ARM, HAND], forces=[pg.Motor("m", "arm")])),
    ],
)  # fmt: skip
def test_a_part_by_other_names_is_the_same_part(theirs, ours):
    assert theirs() == ours()


SWING = {"t_end": 0.3, "q0": [0.4, 0.0]}


@pytest.mark.parametrize(
    "tau",
    [
        {"arm": lambda t, q, v: np.sin(t) - v[0], "hand": 0.5},
        {"arm": lambda t, x: [np.sin(t) - x[2]], "hand": 0.5},
        [lambda t, q, v: np.sin(t) - v[0], 0.5],
    ],
)
def test_functions_and_numbers_may_be_mixed_in_torques(tau):
    one = pg.simulate(TWO, tau=lambda t, q, v: [np.sin(t) - v[0], 0.5], **SWING)
    np.testing.assert_array_equal(pg.simulate(TWO, control=tau, **SWING).q, one.q)


def test_a_function_of_one_joint_may_return_a_number():
    runs = [pg.simulate(pg.Model([ARM]), t_end=0.1, tau=f)
            for f in (lambda t, q, v: 2.0 * t, lambda t, q, v: [2.0 * t])]  # fmt: skip
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_a_drive_in_the_place_of_torques_drives():
    servo = pg.Servo("s", "arm", kp=20.0, kd=2.0, target=1.0)
    one = pg.simulate(TWO.add(servo), **SWING)
    for tau in (servo, [servo]):
        np.testing.assert_array_equal(pg.simulate(TWO, control=tau, **SWING).q, one.q)


def test_the_place_of_a_free_joint_leaves_its_rotation():
    turned = LOOSE.model_copy(update={"q": (0, 0, 2, 0, 1, 0, 0)})
    run = pg.simulate(pg.Model([turned], gravity=0), t_end=0.1, q0={"ball": (1, 2, 3)})
    np.testing.assert_array_equal(run.q[0], (1, 2, 3, 0, 1, 0, 0))


def test_a_duration_from_zero_is_the_end():
    runs = [pg.simulate(TWO, **{name: 0.1}) for name in ("duration", "t_end")]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


@pytest.mark.parametrize("name", ["simulate_batch", "rollout", "batch", "simulate_many"])
def test_a_run_for_each_row_of_initial_states(name):
    q0, v0 = np.random.default_rng(0).normal(size=(2, 3, 2))
    many = getattr(pg, name)(TWO, q0=q0, v0=v0, t_end=0.1, dt=0.01)
    for run, q, v in zip(many, q0, v0, strict=True):
        one = pg.simulate(TWO, q, v, t_end=0.1, step=0.01)
        np.testing.assert_array_equal(run.q, one.q)
    assert [run.v[0, 0] for run in pg.simulate_batch(TWO, None, v0, t_end=0.1)] == [*v0[:, 0]]
    alike = pg.simulate_batch(TWO, q0, v0[0], t_end=0.1)
    assert [(*run.q[0], *run.v[0]) for run in alike] == [(*q, *v0[0]) for q in q0]


@pytest.mark.parametrize(
    "given", [{"q": np.zeros((3, 3))}, {"v": np.zeros(1)}, {"q": "a"}, {"q": np.zeros((2, 2, 2))}]
)
def test_rows_that_are_no_states_are_refused(given):
    with pytest.raises(pg.InputError, match=r"simulate_batch, [qv]: must have"):
        pg.simulate_batch(TWO, **given, t_end=0.1)


def test_all_wrong_arguments_of_a_call_are_named_at_once():
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(TWO, stop=1.0, speeds=[1.0], initial=[0.0])
    assert [problem.field for problem in refused.value.problems] == ["stop", "speeds", "initial"]


def test_the_target_of_one_body_is_given_by_arguments():
    mech, q = arm(), np.full(6, 0.4)
    place, turn = mech.pose(q, "j6")
    tip = place + turn @ (0.1, 0, 0)
    same = mech.inverse_kinematics({"j6": {"place": tip, "rotation": turn, "point": (0.1, 0, 0)}})
    for words in ({"position": tip}, {"place": tip}, {"target": tip}):
        found = mech.inverse_kinematics("j6", **words, rotation=turn, point=(0.1, 0, 0))
        np.testing.assert_array_equal(found, same)
    found = pg.inverse_kinematics(mech.model, body="j6", position=tip, quat=turn, point=(0.1, 0, 0))
    np.testing.assert_array_equal(found, same)
    with pytest.raises(pg.InputError, match=r"inverse_kinematics, position"):
        mech.inverse_kinematics({"j6": tip}, position=tip)


def test_the_position_of_a_point_is_that_of_its_body_turned():
    top = pg.Body("top", joint="spherical", com=(0, 0, 0.1), inertia=(0.1, 0.2, 0.15))
    run = pg.simulate(pg.Model([top]), t_end=0.3, v=[1, 2, 3])
    point = np.array((0.1, -0.2, 0.3))
    for q, found in zip(run.q, run.position("top", point=point)):
        place, turn = run.mechanism.pose(q, "top")
        np.testing.assert_allclose(found, place + turn @ point, atol=1e-14)
    with pytest.raises(pg.InputError, match=r"run\.velocity, point"):
        run.velocity("top", point=point)


URDF = """<robot name="r"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


@pytest.mark.parametrize(
    "words", [{"base": "free"}, {"floating": True}, {"fixed_base": False}, {"useFixedBase": False}]
)
def test_the_root_of_a_urdf_file_floats_if_it_shall(words, tmp_path):
    (tmp_path / "r.urdf").write_text(URDF)
    model = pg.load(tmp_path / "r.urdf", **words)
    assert (model.body("base").joint, pg.load(tmp_path / "r.urdf").body("base").joint) == (
        "free",
        "weld",
    )
    with pytest.raises(pg.InputError, match="free"):
        pg.load("double_pendulum", **words)
    for roots in ("free", {"base": "free"}, [tmp_path / "r.urdf"]):
        with pytest.raises(pg.InputError, match="roots"):
            pg.load(tmp_path / "r.urdf", roots=roots)


def test_a_ground_that_is_added_replaces_that_of_the_model():
    assert TWO.add(pg.Ground(friction=0.3)) == TWO.replace(ground=pg.Ground(friction=0.3))


GAINS = {"kp": 30.0, "kd": 4.0, "target": 0.5}


def pasted(error, name):
    """Return the list that a message gives for an argument, as if it were pasted."""
    text = str(error.value)
    start = text.rindex(f"{name}=[") + len(name) + 1
    return eval(text[start : text.index(")]", start) + 2], {"pg": pg})


@pytest.mark.parametrize("ki", [0.0, 7.0])
@pytest.mark.parametrize("word", ["joint", "body"])
def test_a_pid_of_a_joint_is_answered_with_parts_of_the_same_law(word, ki):
    with pytest.raises(pg.ModelError) as refused:
        pg.PID(**{word: "arm"}, **GAINS, ki=ki)
    assert len(refused.value.problems) == 1
    controls = pasted(refused, "controls") if ki else ()
    model = pg.Model([ARM], controls=controls, forces=pasted(refused, "forces"))
    run = pg.simulate(model, t_end=1.0, rtol=1e-10)
    missed = np.cumsum((0.5 - run["arm"])[:-1] * np.diff(run.t))
    wanted = 30.0 * (0.5 - run["arm"]) - 4.0 * run.v["arm"]
    wanted[1:] += ki * missed
    given = run.mechanism.inverse_dynamics(run.q, run.v, run.vdot)
    np.testing.assert_allclose(given[:, 0], wanted, atol=0.02)


def test_a_pid_in_the_place_of_torques_is_answered_with_what_applies_it():
    pid = pg.PID("p", signal="=q.arm", setpoint=0.5, kp=30.0)
    with pytest.raises(pg.InputError, match="tau") as refused:
        pg.simulate(pg.Model([ARM]), tau=pid, t_end=0.1)
    line = str(refused.value).partition("model = ")[2]
    driven = eval(line, {"pg": pg, "model": pg.Model([ARM]), "control": pid})
    assert pg.simulate(driven, t_end=1.0)["arm"][-1] != 0.0


@pytest.mark.parametrize("number", [1, 2])
def test_loose_shapes_are_doubted_until_the_contacts_of_the_message_hold_them(number):
    bodies = [LOOSE.model_copy(update={"name": f"b{k}", "link": (k, 0, 1)}) for k in range(number)]
    said = next(text for text in pg.Model(bodies).doubts if "would fall" in text)
    contacts = eval(said.partition("contacts=")[2], {"pg": pg})
    assert pg.Model(bodies, contacts=contacts).doubts == ()
    for some in ([contacts[0]], contacts[1:]):
        assert bool(pg.Model(bodies, contacts=some).doubts) == (number > 1 or not some)
    limb = pg.Body("limb", "b0", shape=SPHERE)
    assert pg.Model([*bodies[:1], limb], contacts=[pg.Contact(body="limb")]).doubts == ()
    table = pg.Body("table", joint="weld", shape=SPHERE)
    held = pg.Model([*bodies, table], contacts=[pg.Contact(body="*", other="*")])
    assert held.doubts == ()


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: pg.Gear("arm", HAND, ratio=2), lambda: pg.Gear(body="arm", other="hand", ratio=2)),
        (lambda: pg.Point("arm", "hand", p1=(0, 0, 1)),
         lambda: pg.Point(body="arm", other="hand", point=(0, 0, 1))),
        (lambda: pg.Spring("a", "b", length=1.0), lambda: pg.Spring(body="a", other="b", rest=1.0)),
        (lambda: pg.Sphere(0.1), lambda: SPHERE),
        (lambda: pg.Box(1, 2, 3), lambda: pg.Shape("box", size=(1, 2, 3))),
        (lambda: pg.Box((1, 2, 3)), lambda: pg.Shape("box", size=(1, 2, 3))),
        (lambda: pg.Cylinder(0.1, 2.0), lambda: pg.Shape("cylinder", radius=0.1, length=2.0)),
    ],
)  # fmt: skip
def test_bodies_and_sizes_may_be_given_by_position(theirs, ours):
    assert theirs() == ours()


def test_arguments_that_are_passed_on_are_not_called_unknown():
    with pytest.raises(pg.InputError, match="positional") as refused:
        pg.fit(TWO, {}, {}, 1.0, 2.0, q0=[0.0])
    assert "q0" not in str(refused.value)


def test_a_regulator_of_a_model_without_drives_acts_on_all_joints_and_is_its_gains():
    motors = [pg.Motor(f"{name} motor", body=name) for name in ("arm", "hand")]
    K = pg.lqr(TWO, 1.0, 0.1)
    same = pg.lqr(TWO.add(motors[0]).add(motors[1]), 1.0, 0.1)
    np.testing.assert_array_equal(K.K, same.K)
    np.testing.assert_array_equal(np.asarray(K), K.K)
    run = pg.simulate(TWO, t_end=0.3, q0=[0.1, 0], tau=lambda t, x: -K @ x, rtol=1e-10)
    np.testing.assert_allclose(run.q, pg.simulate(K.model, t_end=0.3, q0=[0.1, 0]).q, atol=1e-7)


def test_a_sweep_is_an_array_of_its_values():
    paths = {"bodies.arm.mass": [1.0, 2.0, 3.0]}
    one = pg.sweep(TWO, paths, "final arm", t_end=0.1, q0=[0.1, 0], workers=1)
    np.testing.assert_array_equal(np.asarray(one), one["final arm"])
    np.testing.assert_array_equal(np.asarray(one.values), one["final arm"])
    two = pg.sweep(TWO, paths, ["final arm", "max hand"], t_end=0.1, q0=[0.1, 0], workers=1)
    np.testing.assert_array_equal(np.asarray(two)[:, 1], two["max hand"])


def test_times_of_measured_data_may_be_an_argument():
    run = pg.simulate(TWO, t_end=0.5, q0=[0.4, 0], frames=50)
    free, options = {"bodies.arm.mass": (1.0, 4.0)}, {"q0": [0.4, 0]}
    found = pg.fit(TWO, {"arm": run["arm"]}, free, t=run.t, **options)
    assert found.values == pg.fit(TWO, {"t": run.t, "arm": run["arm"]}, free, **options).values
    found = pg.identify(TWO, parameters=free, data={"arm": run["arm"]}, times=run.t, **options)
    assert found.values["bodies.arm.mass"] == pytest.approx(2.0, rel=1e-6)


def test_an_inertia_of_zero_is_that_of_a_point_mass():
    for zero in (0, 0.0):
        assert pg.Body("a", inertia=zero) == pg.Body("a", inertia=(0, 0, 0))
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body("a", inertia=False)  # pyright: ignore[reportArgumentType]


def test_velocities_of_loose_joints_are_in_the_axes_of_the_parent():
    """The rotation of the body turns an angular velocity in its axes, as other programs take it."""
    half, w = 0.2, np.array((0.3, -0.5, 2.0))
    turn = (np.cos(half), np.sin(half), 0.0, 0.0)
    top = {"inertia": (0.1, 0.1, 0.1), "com": (0, 0, 0.1)}
    for joint, q, rest in (("spherical", turn, ()), ("free", (0, 0, 0, *turn), (0, 0, 0))):
        mech = pg.Mechanism(pg.Model([pg.Body("top", joint=joint, **top)]))
        v = (*(mech.pose(q, "top")[1] @ w), *rest)
        np.testing.assert_allclose(mech.velocity(q, v, "top", frame="body")[:3], w, atol=1e-14)


def test_contacts_of_the_message_are_those_of_all_shapes():
    with pytest.raises(pg.ModelError) as refused:
        pg.Model([LOOSE], contacts="all")
    line = str(refused.value).partition("contacts=")[2]
    assert pg.Model([LOOSE], contacts=eval(line, {"pg": pg})).doubts == ()


def test_the_axis_of_the_message_is_that_of_the_joint():
    loop = pg.Revolute("loop", body="hand", point=(0, 0, -1))
    said = next(text for text in TWO.add(loop).doubts if "'loop'" in text)
    axis = eval(said.rpartition("axis=")[2])
    aligned = loop.model_copy(update={"axis": axis})
    assert TWO.add(aligned).doubts == ()


@pytest.mark.parametrize("count", [1, 2, 3])  # 2 is the number of coordinates
def test_methods_of_a_state_take_an_array_of_states(count):
    mech, rng = pg.Mechanism(pg.Model.serial(2)), np.random.default_rng(0)
    q, v, vdot = rng.normal(size=(3, count, 2))
    calls: list[tuple[Any, tuple[Any, ...]]] = [
        (mech.mass_matrix, (q,)), (mech.energy, (q, v)), (mech.pose, (q, "2")),
        (mech.forward_dynamics, (q, v)), (mech.forward_dynamics, (q, v[0])),
        (mech.forward_derivatives, (q, v)), (mech.inverse_dynamics, (q, v, vdot)),
        (mech.constrained_dynamics, (q, v)), (mech.body_motion, (q, v)),
    ]  # fmt: skip
    for call, given in calls:
        several = call(*given)
        for i in range(count):
            one = call(*(x[i] if isinstance(x, np.ndarray) and x.ndim == 2 else x for x in given))
            pairs = zip(several, one) if isinstance(one, tuple) else [(several, one)]
            assert all(isinstance(x, dict) or np.array_equal(x[i], y) for x, y in pairs)
    for wrong in (q.tolist(), np.zeros((count, 3)), np.zeros((0, 2)), memoryview(q)):
        with pytest.raises(pg.InputError, match="q"):
            mech.mass_matrix(wrong)
    with pytest.raises(pg.InputError, match="v"):
        mech.energy(q, np.zeros((count + 1, 2)))


@pytest.mark.parametrize("call", ["jacobian", "pose", "velocity", "jacobian_bias"])
def test_a_name_in_the_place_of_q_is_told_with_the_order_of_the_arguments(call):
    mech = pg.Mechanism(pg.Model.serial(2))
    with pytest.raises(pg.InputError, match=rf"{call}, q: .*'2'.*\(q, .*name"):
        getattr(mech, call)("2", *mech.home())


def test_a_velocity_behind_the_name_is_told_with_the_order_of_the_arguments():
    mech = pg.Mechanism(pg.Model.serial(2))
    q, v = mech.home()
    with pytest.raises(pg.InputError, match=r"velocity, v: .*'2'.*\(q, v, name"):
        mech.velocity(q, "2", v)


def test_forces_of_a_run_are_called_by_name_as_they_are_indexed():
    ball = pg.Body(name="ball", joint="free", shape={"kind": "sphere", "radius": 0.1})
    model = pg.Model(bodies=[ball], contacts=[pg.Contact(name="floor", body="ball")])
    run = pg.simulate(model, t_end=0.01)
    for given in (("floor",), ("ball", "ground")):
        key = given if len(given) > 1 else given[0]
        np.testing.assert_array_equal(run.contact_force(*given), run.contact_force[key])
    np.testing.assert_array_equal(run.position("ball"), run.position["ball"])
    with pytest.raises(pg.InputError, match=r"'roof'.*floor"):
        run.contact_force("roof")


def test_an_interval_in_the_place_of_q_is_refused():
    """As in SciPy's solve_ivp(f, (0, 5), [1, 0.2])."""
    model = pg.Model.serial(2)
    with pytest.raises(pg.InputError, match=r"t_span=\(0, 0.5\).*\[0, 0.5\]"):
        pg.simulate(model, (0, 0.5), [1, 0.2])
    for q, times in (((0, 0.5), {"t_end": 0.1}), ((0.1, 0.5), {}), ([0, 0.5], {})):
        assert pg.simulate(model, q, [1, 0.2], **times).q[0].tolist() == [*q]


def test_a_run_prints_why_its_error_is_not_estimated():
    run = pg.simulate(pg.Model.serial(1), t_end=0.1, tau=lambda t, q, v: -v)
    assert "estimate=True" in str(run)
    assert len(str(pg.simulate(pg.Model.serial(1), t_end=0.1, estimate=False)).splitlines()) == 1


def test_an_argument_that_is_missing_is_told_beside_options():
    """A name that goes to the runs was called unknown if another argument was missing."""
    rod: Any = pg.Model.serial(1)
    calls: list[tuple[Any, str]] = [
        (lambda: pg.fit(rod, {}, tau=0), "'free'"), (lambda: pg.sweep(rod, {}, t_end=1), "'metric'")
    ]  # fmt: skip
    for call, name in calls:
        with pytest.raises(pg.InputError, match=name):
            call()


def test_torques_of_all_joints_are_warned_of_once_where_a_loop_leaves_a_choice():
    mech = pg.Mechanism(pg.load("four_bar"))
    q, v, _ = mech.assemble()
    vdot, _ = mech.constrained_dynamics(q, v)
    calls = ({"actuated": mech.names}, {}, {})
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        told = [
            (mech.constrained_inverse_dynamics(q, v, vdot, **call), len(found))[1] for call in calls
        ]
    assert told == [0, 1, 1]
    assert "actuated" in str(found[0].message)


def test_a_run_says_that_a_file_has_an_impossible_inertia():
    body = pg.Body(name="a", axes="y", com=(0, 0, -1), inertia=(1, 1, 9), any_inertia=True)
    model = pg.Model.from_json(pg.Model([body]).to_json())
    assert any("'a'" in text and "inertia" in text for text in model.doubts)
    assert set(model.doubts) <= set(pg.simulate(model, t_end=0.01).notices)


def test_drives_go_by_their_joints_also_where_the_model_has_none():
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=1)
    pole = pg.Body(name="pole", parent="cart", axes=(0, 1, 0), mass=0.2, com=(0, 0, 0.5))
    bare = pg.Model(bodies=[cart, pole])
    driven = bare.add(pg.Motor(name="drive", body="cart"))
    found = [
        pg.lqr(model, np.eye(4), 0.1, inputs=inputs)
        for model, inputs in ((bare, "cart"), (bare, ["cart"]), (driven, ["cart"]), (driven, None))
    ]
    assert all(np.allclose(each.K, found[-1].K, rtol=1e-9) for each in found)
    assert all(len(each.model.forces) == 1 for each in found)
    with pytest.raises(pg.InputError, match="pole"):
        pg.lqr(bare, np.eye(4), inputs=["pol"])


def test_a_spring_without_a_first_body_is_fixed_to_the_ground():
    spring = pg.Spring(body_a=None, body_b="rod", length=0.2)
    model = pg.Model(bodies=[pg.Body(name="rod", axes=(0, 1, 0), com=(0, 0, -1))])
    for added in (model.add(spring), model.replace(forces=[spring])):
        assert (added.forces[0].body, added.forces[0].other) == ("rod", "ground")


def test_a_sweep_prints_its_rows():
    rod = pg.Body(name="rod", axes=(0, 1, 0), com=(0, 0, -1))
    table = pg.sweep(pg.Model(bodies=[rod]), {"bodies.rod.mass": [1.0, 2.5]}, "max rod", t_end=0.1)
    head, names, *rows = str(table).splitlines()
    assert names.split()[0] == "bodies.rod.mass"
    assert [x.split()[0] for x in rows] == ["1", "2.5"]


def test_a_part_in_a_dictionary_may_have_words_of_other_programs():
    bodies = [pg.Body(name=name, com=(1, 0, 0)) for name in "ab"]
    given = {"name": "x", "type": "gear", "joint1": "a", "joint2": "b", "ratio": 2.0}
    (gear,) = pg.Model(bodies=bodies, constraints=[given]).constraints
    assert (gear.kind, gear.body, gear.other) == ("gear", "a", "b")


def site_on_arm():
    return pg.Site(name="tool", body="j6", point=(0.1, 0.2, 0.3), rotation=(0.8, 0.6, 0.0, 0.0))


def test_poses_by_name_are_the_poses_of_each_name():
    mech = pg.Mechanism(arm().model.add(site_on_arm()))
    q = np.linspace(-1.0, 1.0, 6)
    several = np.stack((q, 0.5 * q))
    assert [*mech.pose(q)] == ["ground", *mech.names, "tool"]
    for name, pose in pg.forward_kinematics(mech, q).items():
        np.testing.assert_array_equal(pose, mech.pose(q, name))
        np.testing.assert_array_equal(mech.pose(several)[name].matrix[1], mech.pose(0.5 * q, name))
    with pytest.raises(KeyError, match=r"'hand'.*tool"):
        mech.pose(q)["hand"]


def test_a_pose_is_its_homogeneous_matrix_and_its_two_parts():
    mech = arm()
    pose = mech.pose(np.linspace(-1.0, 1.0, 6), "j6")
    position, rotation = pose
    point = np.array((0.1, -0.2, 0.3))
    np.testing.assert_array_equal(np.asarray(pose)[:3, :3], rotation)
    np.testing.assert_array_equal(pose[:3, 3], position)
    np.testing.assert_allclose(pose @ point, position + rotation @ point, atol=1e-15)
    np.testing.assert_allclose((pose @ [*point, 1.0])[:3], pose @ point, atol=1e-15)
    turned = pg.Body("b", rotation=pose.quaternion, inertia=(1, 1, 1))
    home = pg.Mechanism(pg.Model([turned])).pose([0.0], "b")
    np.testing.assert_allclose(home.rotation, rotation, atol=1e-14)
    found = mech.inverse_kinematics({"j6": pose.matrix})
    np.testing.assert_allclose(mech.pose(found, "j6"), pose, atol=1e-7)
    for theirs, ours in (("translation", position), ("homogeneous", pose.matrix)):
        np.testing.assert_array_equal(getattr(pose, theirs), ours)
    with pytest.raises(AttributeError, match="quaternion"):
        pose.quaternions  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_the_unit_of_frequencies_stands_beside_them():
    model = pg.Model([pg.Body("a", axes="y", com=(0, 0, -9.81))])
    np.testing.assert_allclose(model.linearise().hertz, [1.0 / (2.0 * np.pi)], rtol=1e-12)
    for owner in (pg, model, pg.Mechanism(model), model.linearise()):
        with pytest.raises(AttributeError, match=r"frequencies \[rad/s\] or .*hertz \[Hz\]"):
            owner.natural_frequencies  # noqa: B018
    with pytest.raises(AttributeError, match=r"modes or .*hertz \[Hz\]"):
        pg.modes  # noqa: B018


def test_functions_of_a_model_keep_no_model_alive():
    model = pg.Model.serial(3)
    first = pg.mass_matrix(model, np.zeros(3))
    mechanism, alive = (weakref.ref(x) for x in (model.mass_matrix.__self__, model))
    np.testing.assert_array_equal(pg.mass_matrix(model, np.zeros(3)), first)
    assert mechanism() is model.mass_matrix.__self__
    del model
    gc.collect()
    assert (alive(), mechanism()) == (None, None)


FREE = {"joint": "free", "inertia": (0.1, 0.2, 0.15), "v": (1, 2, 3, 0.1, 0.2, 0.3)}
UPPER = pg.Body("top", axis="y", com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.1), q=0.3, v=0.5,
                rotation=(0.9, 0.3, 0.3, 0.1))  # fmt: skip
LOWER = pg.Body("low", "top", rotation=(0.7, 0.1, 0.5, 0.5), q=(0.3, 0.2, 0.1, 0.5, 0.5, -0.5, 0.5),
                **FREE)  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "as_first", "as_other"),
    [
        (pg.Point, {"point": "P"}, {"point": "p", "other_point": "P"}),
        (pg.Weld, {"point": "P"}, {"point": "p", "other_point": "P"}),
        (pg.Revolute, {"point": "P"}, {"point": "p", "other_axis": Z}),
        (pg.Revolute, {"point": "P", "axis": Y}, {"point": "p", "other_axis": Y}),
        (pg.Cylindrical, {"point": "P", "other_axis": Y}, {"point": "p", "axis": Y}),
        (pg.Universal, {"point": "P"}, {"point": "p", "axis": "x", "other_axis": Y}),
        (pg.Distance, {"other_point": Z}, {"point": Z, "other_point": (0, 0, 0)}),
        (pg.Orientation, {}, {}),
        (pg.Torsion, {"axis": (1, 2, 3), "stiffness": 5.0, "rest": 0.4, "damping": 0.2},
         {"axis": "-a", "stiffness": 5.0, "rest": 0.4, "damping": 0.2}),
        (pg.Spring, {"point": "P", "stiffness": 5.0, "rest": 0.1},
         {"point": (0, 0, 0), "other_point": "P", "stiffness": 5.0, "rest": 0.1}),
    ],
)  # fmt: skip
def test_the_ground_may_be_the_first_body_of_a_part(kind, as_first, as_other):
    """The point P of the ground is p of the body, and x and a are directions of it."""
    model = pg.Model([UPPER, LOWER])
    mech = pg.Mechanism(model)
    place, turn = mech.pose(mech.home()[0], "low")
    at_zero = mech.pose([0, 0, 0, 0, 1, 0, 0, 0], "low")[1]
    P = np.array((0.3, -0.2, 0.4))
    known = {"P": P, "p": turn.T @ (P - place), "x": turn[0], "-a": -at_zero.T @ (1, 2, 3)}
    one, same = (
        model.add(kind("part", **ends, **{k: known.get(str(x), x) for k, x in given.items()}))
        for ends, given in (({"body": "ground", "other": "low"}, as_first),
                            ({"body": "low", "other": "ground"}, as_other))
    )  # fmt: skip
    first, second = (pg.Mechanism(each) for each in (one, same))
    q, v, _ = second.assemble()
    found, wanted = (each.constrained_dynamics(q, v)[0] for each in (first, second))
    np.testing.assert_allclose(found, wanted, atol=1e-10, rtol=1e-10)


@pytest.mark.parametrize(
    "part",
    [
        pg.Plane("p", "ground", "arm", axis=(0, 0, 1)),
        pg.Line("p", "ground", "arm", other_axis=(0, 0, 1)),
        pg.Bushing("p", body="ground", other="arm", stiffness=(1,) * 6),
        pg.Rolling("p", body="ground", other="arm", radius=1.0),
        pg.Contact("p", "ground", "arm", points=((0, 0, 0),)),
    ],
)
def test_a_part_whose_ends_differ_is_not_turned_round(part):
    with pytest.raises(pg.ModelError, match=r"'p', body: the ground.*body='arm', other='ground'"):
        pg.Model([ARM], parts=[part])


def test_runs_of_a_batch_give_a_column_of_each_by_its_name():
    runs = pg.simulate_batch(pg.Model.serial(2), q=[[0.1, 0.0], [0.2, 0.0]], t_end=0.1)
    assert [column[0] for column in runs["2"]] == [0.0, 0.0]
    assert len(runs[:1]) == 1
    assert runs[1]["1"][0] == 0.2
    assert repr(runs).startswith("<Runs: 2")


def test_values_of_a_fit_say_which_paths_they_have():
    from pgraph_core.search.free import Values

    with pytest.raises(KeyError, match=r"bodies\.arm\.mass.*x"):
        Values({"bodies.arm.mass": 1.0})[0]


def test_each_call_that_ignores_constraints_warns_once():
    mech = pg.Mechanism(pg.load("four_bar"))
    state = np.zeros(3), np.zeros(3), np.zeros(3)
    with pytest.warns(UserWarning, match="inverse_dynamics ignores"):
        tau = mech.inverse_dynamics(*state)
    with pytest.warns(UserWarning, match="forward_dynamics ignores"):
        vdot = mech.forward_dynamics(*state)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(mech.inverse_dynamics(*state), tau)
        assert np.array_equal(mech.forward_dynamics(*state), vdot)


@pytest.mark.parametrize("call", [pg.jacobian, pg.pose])
@pytest.mark.parametrize("word", ["body", "frame", "link"])
def test_a_frame_is_asked_for_by_its_name(call, word):
    if (call, word) != (pg.jacobian, "frame"):  # which chooses its axes
        with pytest.raises(pg.InputError, match="did you mean name"):
            call(pg.Model.serial(2), np.zeros(2), **{word: "2"})
