"""Names of other programs: what is taken as ours, and what is answered with a hint."""

from __future__ import annotations

import pickle
import re
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core import words
from tests.refusals import assert_names, refusal

ROD = {"name": "rod", "axes": (0, 1, 0), "com": (0, 0, -0.5), "inertia": (0.1, 0.1, 0.01)}
MODEL = pg.Model(bodies=[pg.Body(**ROD)])


def rod(**fields):
    return pg.Body(**ROD | fields)


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: rod(m=2.0), lambda: rod(mass=2.0)),
        (lambda: rod(pos=(0, 0, 1)), lambda: rod(link=(0, 0, 1))),
        (lambda: rod(axes="y"), lambda: rod()),
        (lambda: pg.Body(name="a", axis="-x"), lambda: pg.Body(name="a", axes=(-1, 0, 0))),
        (lambda: pg.Body(name="a", joint="universal", axes=("x", "-z")),
         lambda: pg.Body(name="a", joint="universal", axes=((1, 0, 0), (0, 0, -1)))),
        (lambda: rod(joint="hinge"), lambda: rod(joint="revolute")),
        (lambda: rod(joint="Revolute"), lambda: rod(joint="revolute")),
        (lambda: pg.Body(name="a", joint="slider", axis=(1, 0, 0)),
         lambda: pg.Body(name="a", joint="prismatic", axes=(1, 0, 0))),
        (lambda: pg.Body(name="a", joint="ball"), lambda: pg.Body(name="a", joint="spherical")),
        (lambda: rod(shape={"type": "cube", "size": (1, 1, 1), "color": "#ff0000"}),
         lambda: rod(shape=pg.Shape(kind="box", size=(1, 1, 1), colour="#ff0000"))),
        (lambda: pg.Shape(type="ball", radius=1.0), lambda: pg.Shape(kind="sphere", radius=1.0)),
        (lambda: pg.Spring(name="s", body="rod", k=9.0, c=0.1, rest_length=1.0),
         lambda: pg.Spring(name="s", body="rod", stiffness=9.0, damping=0.1, rest=1.0)),
        (lambda: pg.Revolute(name="r", body1="a", body2="b", anchor=(1, 0, 0)),
         lambda: pg.Revolute(name="r", body="a", other="b", point=(1, 0, 0))),
        (lambda: pg.Model(links=[ROD]), lambda: MODEL),
        (lambda: MODEL.edit("rod", m=3.0), lambda: MODEL.edit("rod", mass=3.0)),
        (lambda: pg.Model(bodies=[ROD], motors=[pg.Motor(name="m", body="rod")]),
         lambda: pg.Model(bodies=[ROD], forces=[pg.Motor(name="m", body="rod")])),
        (lambda: pg.Motor(name="m", body="rod", forcerange=(-2, 3)),
         lambda: pg.Motor(name="m", body="rod", torque_low=-2, torque_limit=3)),
        (lambda: pg.Wrench(body="rod", moment=(0, 0, 1)),
         lambda: pg.Wrench(body="rod", torque=(0, 0, 1))),
        (lambda: pg.Sine(amplitude=1, omega=2), lambda: pg.Sine(amplitude=1, frequency=2)),
        (lambda: pg.Spring(body="rod", stiffness=1.0).name, lambda: "rod spring"),
        (lambda: pg.Contact(body="rod").name, lambda: "rod contact"),
        (lambda: pg.Weld(body="a", other="b").name, lambda: "a-b weld"),
        (lambda: pg.Weld("w", "a", "b"), lambda: pg.Weld(name="w", body="a", other="b")),
        (lambda: pg.Motor("m", "rod"), lambda: pg.Motor(name="m", body="rod")),
        (lambda: pg.Motor("m", "rod", limit=5.0),
         lambda: pg.Motor(name="m", body="rod", torque_limit=5.0)),
        (lambda: pg.Body("b", "rod"), lambda: pg.Body(name="b", parent="rod")),
        (lambda: pg.Model([ROD], gravity=-1.6), lambda: pg.Model([ROD], gravity=(0, 0, -1.6))),
        (lambda: pg.Model([ROD], gravity=1, up="x"),
         lambda: pg.Model([ROD], gravity=(-1, 0, 0), up="x")),
        (lambda: pg.Model([ROD], gravity=0), lambda: pg.Model([ROD], gravity=(0, 0, 0))),
        (lambda: rod(density=1e3, shape=pg.Shape(kind="sphere", radius=1.0)).derived,
         lambda: ("mass",)),
    ],
)  # fmt: skip
def test_another_word_for_the_same_means_the_same(theirs, ours):
    assert theirs() == ours()


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ({"q0": [1.0], "qdot": [2.0], "dt": 1e-3, "solver": "rk4"},
         {"q": [1.0], "v": [2.0], "step": 1e-3, "method": "rk4"}),
        ({"method": "RK45", "tol": 1e-7}, {"method": "dopri5", "rtol": 1e-7}),
        ({"step_size": 1e-3}, {"step": 1e-3}),
        ({"t_span": (0.1, 0.2)}, {"t_start": 0.1, "t_end": 0.2}),
        ({"tspan": np.array([0.0, 0.1]), "q0": [1.0]}, {"t_end": 0.1, "q": [1.0]}),
        ({"stabilize": None, "t0": 0.1}, {"stabilise": None, "t_start": 0.1}),
        ({"controller": lambda t, q, v: -q}, {"tau": lambda t, q, v: -q}),
    ],
)  # fmt: skip
def test_arguments_of_other_programs_give_the_same_run(theirs: dict, ours: dict):
    span = {} if "t_end" in ours else {"t_end": 0.2}
    a, b = (pg.simulate(MODEL, **span, **x) for x in (theirs, ours))
    assert np.array_equal(a.q, b.q)
    assert np.array_equal(a.t, b.t)


def test_the_axes_of_a_jacobian_are_named_by_another_word():
    mech = pg.Mechanism(MODEL)
    local = mech.jacobian([0.3], "rod", frame="local")
    assert np.array_equal(local, mech.jacobian([0.3], "rod", frame="body"))


def test_a_sweep_takes_a_list_of_one_number_for_the_number():
    paths = ("bodies.rod.damping", "bodies.rod.damping.0")
    tables = [
        pg.sweep(MODEL, {path: [0.0, 1.0]}, metrics="final rod", t_end=0.1, q0=[1.0], workers=1)
        for path in paths
    ]
    assert np.array_equal(tables[0]["final rod"], tables[1]["final rod"])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: rod(axis=(0, 1, 0)), ("axis", "axes")),  # both
        (lambda: rod(color="#fff"), ("color", "shape", "colour")),
        (lambda: pg.Model(friction=0.5), ("friction", "ground")),
        (lambda: pg.Motor(name="m", body="rod", limits=(-1, 1)), ("limits", "torque_limit")),
        (lambda: pg.simulate(MODEL, duration=1, t_start=1), ("duration", "t_end")),
        (lambda: pg.Stepper(MODEL).step(dt=0.1), ("dt", "inputs")),
        (lambda: pg.Mechanism(MODEL).inverse_kinematics(position=(0, 0, 1)), ("targets",)),
        (lambda: pg.Contact(friction=0.1), ("body", "missing")),
    ],
)
def test_a_word_that_is_only_near_is_refused_with_ours(call, said: tuple[str, ...]):
    assert_names(str(refusal(call)), *said)


def test_no_word_is_both_taken_and_a_name_of_ours_in_the_same_place():
    """A field or argument of ours is never taken for another one."""
    for kind in (pg.Body, pg.Shape, pg.Motor, pg.Servo, pg.Spring, pg.Revolute, pg.Contact):
        for name in kind.model_fields:
            assert words.ours(name, kind.model_fields) == ""


@pytest.mark.parametrize(
    ("call", "example"),
    [
        (lambda m: m.inverse_kinematics(position=(0, 0, 1)), "mech.inverse_kinematics({"),
        (lambda m: m.inverse_kinematics("rod"), "mech.inverse_kinematics('rod', position="),
        (lambda m: m.inverse_kinematics("rod", (0, 0, 1)), "mech.inverse_kinematics('rod', pos"),
        (lambda m: pg.simulate(m, t_end=1, u=lambda s: 0.0), "f(t, q, v)"),
        (lambda m: pg.fit(m, {}, parameter={}), "pg.fit("),
        (lambda m: pg.Force("f", body="rod", force=(0, 0, 1), stop=1.0), "torque, force, frame"),
        (lambda m: pg.Motion("m", body="rod", function="t"), "'=0.5*sin(2*t)'"),
        (lambda m: pg.Motion("m", body="rod", velocity=2.0), "'=0.5*sin(2*t)'"),
        (lambda m: pg.Motion("m", body="rod", q_of_t=lambda t: t), "'=0.5*sin(2*t)'"),
        (lambda m: pg.Motion("m", body="rod"), "'=0.5*sin(2*t)'"),
    ],
)
def test_a_refusal_shows_what_to_write_by_an_example(call, example):
    assert_names(str(refusal(lambda: call(pg.Mechanism(MODEL)))), example)


def test_a_word_that_is_like_none_of_ours_gets_no_hint():
    assert pg.optimize is pg.optimise
    with pytest.raises(AttributeError) as refused:
        pg.Stepper(MODEL).teapot()
    assert "did you mean" not in str(refused.value)
    assert "did you mean" not in str(refusal(lambda: pg.Servo("s", body="rod", ki=1.0)))


@pytest.mark.parametrize(
    ("fields", "kind"),
    [
        ({"force": (0, 0, 1)}, pg.Wrench), ({"force": (0, 0, 1), "frame": "body"}, pg.Wrench),
        ({"torque": (0, 0, 1), "force": (0, 0, 1)}, pg.Wrench), ({"size": (1, 1, 1)}, pg.Drag),
        ({"kp": 1.0, "kd": 1.0, "target": 1.0}, pg.Servo),
    ],
)  # fmt: skip
def test_a_force_without_a_kind_is_the_only_one_that_has_its_fields(fields, kind):
    fields = {"name": "f", "body": "rod", **fields}
    assert pg.Force(**fields) == kind(**fields)
    assert MODEL.add(pg.Force(**fields)).forces == (kind(**fields),)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_an_inertia_in_square_millimetres_is_doubted_at_any_size(scale: float):
    """The radius of gyration is a length of the model: only their ratio counts."""
    com, inertia = (0, 0, -0.5 * scale), np.array([0.1, 0.1, 0.01]) * scale**2
    right = pg.Model(bodies=[rod(com=com, inertia=inertia)])
    wrong = pg.Model(bodies=[rod(com=com, inertia=inertia * 1e6)])
    assert right.doubts == ()
    assert [("rod" in text, "kg m²" in text) for text in wrong.doubts] == [(True, True)]
    point = pg.Model(bodies=[rod(com=com, inertia=inertia * 1e-6)])
    assert point.doubts == ()


RUN = pg.simulate(MODEL, t_end=0.01)
DRIVEN = MODEL.add(pg.Motor(name="m", body="rod"))


@pytest.mark.parametrize(
    ("of", "theirs", "ours"),
    [
        (pg, "solve_ivp", "simulate"), (pg, "Geom", "Shape(kind=...)"),
        (pg, "Modle", "Model"),
        (pg, "to_csv", "run.to_csv"),
        (pg, "RevoluteJoint", "Revolute"),
        (pg, "MjData", "Stepper"), (pg, "vmap", "BatchStepper"), (pg, "loads", "load"),
        (pg.Model, "from_dict", "from_json"),
        (MODEL, "to_dict", "to_json"), (MODEL, "body_names", "bodies"), (MODEL, "massses", ""),
        (MODEL.bodies[0], "mas", "mass"), (MODEL.bodies[0], "color", ""),
        (pg.Mechanism(MODEL), "bias", "bias_force"),
        (pg.Mechanism(MODEL), "natural_frequencies", "linearise().frequencies"),
        (pg.Mechanism(MODEL), "mass_matrx", "mass_matrix"), (RUN, "sweep", "pg.sweep"),
        (MODEL.bodies[0], "mass_matrix", "pg.Mechanism(model).mass_matrix"),
        (MODEL, "mechanism", "pg.Mechanism(model)"), (pg, "Data", "Stepper(model)"),
        (pg.Mechanism(MODEL).linearise(), "poles", "eigenvalues"),
        (RUN, "nfev", "counters"), (RUN, "t_events", "user_events"),
        (RUN, "total_energy", "energy"), (RUN, "contact_forces", "contact_force"),
        (RUN, "tau", "drive_force or joint_torque"), (RUN, "positions", "q or position"),
        (RUN, "get_actuation_output", "drive_force"), (RUN, "limits", "contacts.limit"),
        (pg.Stepper(DRIVEN), "actuatorForce", "drive_force"),
        (RUN, "report", "message"), (RUN, "joint", 'q["NAME"]'),
        (pg.Stepper(DRIVEN), "ctrl", "inputs"), (MODEL, "num_joints", "bodies"),
        (DRIVEN, "to_dict", "to_json"), (DRIVEN.forces[0], "limits", "torque_limit"),
        (pg.Mechanism(MODEL).mobility(), "dofs", "dof"),
    ],
)  # fmt: skip
def test_an_attribute_of_other_programs_is_answered_with_ours(of, theirs, ours):
    """One mechanism for all public classes: the table of words first, then the spelling."""
    with pytest.raises(AttributeError) as refused:
        getattr(of, theirs)
    said = str(refused.value)
    assert f"'{theirs}'" in said
    assert ours in said
    assert ("did you mean" in said) == bool(ours)
    if not ours:
        assert "choose from" in said
    assert not hasattr(of, theirs)
    assert str(pickle.loads(pickle.dumps(refused.value))) == said


@pytest.mark.parametrize(
    ("of", "theirs", "ours"),
    [
        (RUN, "qpos", "q"), (RUN, "time", "t"), (RUN, "qddot", "vdot"),
        (RUN, "warnings", "notices"), (pg, "concatenate", "joined"),
        (pg.Stepper(MODEL), "dq", "v"), (pg.BatchStepper(MODEL, 2), "qpos", "q"),
        (pg.Mechanism(MODEL), "rnea", "inverse_dynamics"),
        (pg.Mechanism(MODEL), "M", "mass_matrix"), (pg.Model, "from_urdf", "load"),
        (pg, "load_urdf", "load"), (RUN, "to_gif", "to_film"), (MODEL, "to_file", "save"),
        (pg.Mechanism(MODEL), "computeABADerivatives", "forward_derivatives"),
    ],
)  # fmt: skip
def test_an_attribute_of_the_same_meaning_and_form_is_ours(of, theirs, ours):
    assert theirs not in dir(of)
    got, wanted = getattr(of, theirs), getattr(pg if of is pg.Model else of, ours)
    assert np.array_equal(got, wanted) if isinstance(wanted, np.ndarray) else got == wanted


@pytest.mark.parametrize("of", [MODEL, pg.Mechanism(MODEL)])
def test_what_takes_a_model_or_a_mechanism_first_is_an_attribute_of_both(of):
    mech = pg.Mechanism(MODEL)
    run, same = of.simulate(t_end=0.1, q0=[1.0]), pg.simulate(MODEL, t_end=0.1, q=[1.0])
    assert np.array_equal(run.q, same.q)
    assert np.array_equal(of.linearize().A, mech.linearise().A)
    assert np.array_equal(of.crba([0.1]), mech.mass_matrix([0.1]))
    assert not hasattr(of, "Stepper")
    assert "simulate" not in dir(of)
    assert pickle.loads(pickle.dumps(of)) == of


@pytest.mark.parametrize(
    ("call", "taker"),
    [
        (lambda: pg.Body("a", sites=[]), "pg.Model(..., sites=...)"),
        (lambda: pg.Model([ROD], dt=1e-3), "pg.simulate(..., step=...)"),
        (lambda: pg.simulate(MODEL, gravity=(0, 0, 0)), "pg.Model(..., gravity=...)"),
        (lambda: pg.Servo("s", body="rod", ki=1.0), "pg.PID(..., ki=...)"),
    ],
)
def test_a_field_of_something_else_is_answered_with_what_takes_it(call, taker):
    assert taker in str(refusal(call))


def test_functions_of_the_whole_state_are_taken_as_those_of_q_and_v():
    """SciPy calls f(t, y)."""

    def ends(t, y):
        return y[0]

    ends.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    a = pg.simulate(MODEL, q=[0.7], t_end=2.0, events=ends, tau=lambda t, x: -x[1:])
    b = pg.simulate(
        MODEL, q=[0.7], t_end=2.0, events=[lambda t, q, v: q[0]], tau=lambda t, q, v: -v
    )
    assert a.t[-1] == b.user_events[0].t
    assert np.array_equal(a.q[:100], b.q[:100]) or np.allclose(a.q[-1], 0.0, atol=1e-9)
    with pytest.raises(pg.InputError, match="takes 1 positional"):
        pg.simulate(MODEL, t_end=0.1, tau=lambda s: [0.0])


def test_several_results_given_for_one_are_named():
    mech = pg.Mechanism(MODEL)
    with pytest.raises(pg.InputError, match=r"3 results.*Assembly"):
        mech.mass_matrix(mech.assemble())


def test_natural_frequencies_and_damping_ratios_are_those_of_the_oscillator():
    """x'' + 2 z w x' + w^2 x = 0."""
    w, z = 3.0, 0.2
    slider = pg.Body("x", joint="prismatic", axes=(1, 0, 0), mass=2.0, stiffness=2 * w * w,
                     damping=4 * z * w)  # fmt: skip
    found = pg.Model([slider]).linearise()
    natural, ratio, poles = found.damp()
    np.testing.assert_allclose(natural, w, rtol=1e-12)
    np.testing.assert_allclose(ratio, z, rtol=1e-12)
    np.testing.assert_array_equal(poles, found.eigenvalues)
    np.testing.assert_allclose(found.frequencies, w * np.sqrt(1 - z * z), rtol=1e-12)


def test_a_built_in_model_is_loaded_by_its_name_unless_a_file_has_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = pg.load("double_pendulum")
    assert model == pg.Model.load(pgraph_models.path("double_pendulum"))
    (tmp_path / "double_pendulum").write_text(MODEL.to_json())
    assert pg.load("double_pendulum") == pg.Model.load("double_pendulum") == MODEL
    with pytest.raises(pg.FileError, match=r"double_pendulum.*quadruped"):
        pg.load("double_pendlum")


@pytest.mark.parametrize("number", [1, 4])
def test_methods_of_a_state_take_many_and_return_a_row_for_each(number):
    mech, random = pg.Mechanism(pg.load("four_bar")), np.random.default_rng(0)
    q, v, vdot = random.normal(size=(3, number, mech.nq))
    found = mech.inverse_dynamics(q, v, vdot=vdot), mech.mass_matrix(q), mech.pose(q, "coupler")
    one = [(mech.inverse_dynamics(*x), mech.mass_matrix(x[0])) for x in zip(q, v, vdot)]
    for many, rows in zip(found, zip(*one)):
        np.testing.assert_array_equal(many, rows)
    assert [x.shape for x in found[2]] == [(number, 3), (number, 3, 3)]
    slopes = mech.forward_derivatives(q, v, vdot), mech.forward_dynamics(q, v)
    assert [x.shape for x in (*slopes[0], slopes[1])] == [(number, 3, 3)] * 3 + [(number, 3)]
    alike = mech.bias_force(q, v[0])  # one velocity for all
    np.testing.assert_array_equal(alike, [mech.bias_force(x, v[0]) for x in q])
    with pytest.raises(pg.InputError, match="v: must have shape"):
        mech.bias_force(q, np.zeros((number, mech.nv + 1)))


def test_a_run_ends_at_the_last_time_to_record():
    times = [0.0, 0.5, 3.5]
    assert pg.simulate(MODEL, t_eval=times).t.tolist() == times
    assert pg.simulate(MODEL, t_start=1.0, t_eval=[1.0, 2.5]).t[-1] == 2.5
    for wrong in ([], [np.nan], "x", [1.0, 0.5], [[1.0]], [0.0, -1.0]):
        with pytest.raises(pg.InputError, match="t_eval"):
            pg.simulate(MODEL, t_eval=wrong)


def test_a_page_of_a_run_is_returned_where_no_file_is_given(tmp_path):
    text = RUN.to_html()
    assert RUN.to_html(tmp_path / "run.html") is None
    assert (tmp_path / "run.html").read_text("utf-8") == text


def test_the_name_of_a_part_stands_for_its_path():
    tables = [
        pg.sweep(MODEL, {path: [1.0, 2.0]}, metrics="final rod", t_end=0.1, q0=[1.0], workers=1)
        for path in ("rod.mass", "bodies.rod.mass")
    ]
    assert np.array_equal(tables[0]["final rod"], tables[1]["final rod"])


def test_each_word_of_the_table_leads_to_a_name_that_exists():
    kinds = [kind for name in dir(pg) if isinstance(kind := getattr(pg, name), type)]
    mech = pg.Mechanism(MODEL)
    kinds += [type(mech.linearise()), type(mech.pose(*mech.home()[:1], mech.names[0]))]
    public = {*dir(pg)}.union(*map(dir, kinds), *(kind.__annotations__ for kind in kinds))
    for ours in {each for found in words.ATTRIBUTES.values() for each in found}.union(
        words.SAME_ATTRIBUTES.values()
    ):
        assert re.split(r"\W", ours.lstrip("-"))[0] in public


def test_the_error_of_a_property_that_fails_is_not_taken_for_a_missing_name(monkeypatch):
    monkeypatch.setattr(pg.Result, "energy_drift", property(lambda run: run.nothing_like_it))
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = RUN.energy_drift


def test_a_sweep_takes_its_own_words_beside_those_of_simulate():
    theirs, ours = {"n_jobs": 1, "dt": 1e-3, "q0": [1.0]}, {"workers": 1, "step": 1e-3, "q": [1.0]}
    a, b = (
        pg.sweep(MODEL, {"bodies.rod.mass": [1.0, 2.0]}, ["final rod"], t_end=0.1, **each)
        for each in (theirs, ours)
    )
    assert np.array_equal(a["final rod"], b["final rod"])


def test_a_run_says_whether_it_succeeded_and_writes_its_table_where_asked(tmp_path):
    assert RUN.success
    assert not pg.simulate(MODEL, q=[1.0], t_end=9.0, rtol=1e-9, max_steps=3).success
    assert RUN.to_csv(tmp_path / "run.csv") == (tmp_path / "run.csv").read_text()
    RUN.save(tmp_path / "run.npz")
    with pytest.raises(pg.FileError, match=r"pg\.Result\.load"):
        pg.load(tmp_path / "run.npz")


def test_a_target_has_a_position_or_a_place():
    mech, there = pg.Mechanism(MODEL), (0.5 * np.sin(0.3), 0.0, -0.5 * np.cos(0.3))
    a, b = (
        mech.inverse_kinematics({"rod": {name: there, "point": (0, 0, -0.5)}})
        for name in ("position", "place")
    )
    assert np.array_equal(a, b)


def test_functions_of_a_model_take_a_mechanism_and_are_its_methods(tmp_path):
    cart = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], shape=pg.Sphere(0.1))
    pole = pg.Body(name="pole", parent="cart", axes=[(0, 1, 0)], com=(0, 0, 0.5))
    contact = pg.Contact(name="ground", body="cart")
    drives = [pg.Motor(name="push", body="cart")]
    model = pg.Model(bodies=[cart, pole], forces=drives)
    standing = model.replace(contacts=[contact])
    file = str(tmp_path / "model")
    calls = (
        lambda each: pg.lqr(each, 1.0).K.tolist(),
        lambda each: each.lqr(1.0).K.tolist(),
        lambda each: pg.place_poles(each, [-1.0, -2.0, -3.0, -4.0]).K.tolist(),
        lambda each: str(pg.write_mjcf(each, file + ".xml")),
        lambda each: str(pg.write_urdf(each, file + ".urdf")),
    )
    for call in calls:
        assert call(model) == call(pg.Mechanism(model))
    assert pg.underfoot(pg.Mechanism(standing), slope=0.1) == pg.underfoot(standing, slope=0.1)
    wrong: Any = "arm.json"
    with pytest.raises(pg.InputError):
        pg.lqr(wrong, 1.0)


@pytest.mark.parametrize(
    ("read", "named"),
    [
        (lambda run, mech: run.kinetic, "kinetic_energy"),
        (lambda run, mech: run.potential, "potential_energy"),
        (lambda run, mech: pg.simulate_batch(mech, [[0.1], [0.2]]).q, "run.q for run in runs"),
        (lambda run, mech: mech.inverse_dynamics_along, "constrained_inverse_dynamics"),
    ],
)
def test_a_name_that_is_near_is_answered_with_what_it_means(read, named):
    mech = pg.Mechanism(pg.Model.serial(1))
    with pytest.raises(AttributeError, match=named):
        read(pg.simulate(mech, t_end=0.1), mech)


def test_a_batch_is_copied_and_stored_as_a_list():
    runs = pg.simulate_batch(pg.Model.serial(1), [[0.1], [0.2]], t_end=0.1)
    for again in (pickle.loads(pickle.dumps(runs)), runs[:]):
        assert [run.q[-1, 0] for run in again] == [run.q[-1, 0] for run in runs]
