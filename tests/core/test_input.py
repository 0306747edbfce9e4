"""What is given wrongly is refused with one sentence that names it."""

from __future__ import annotations

import contextlib
import inspect

import numpy as np
import pytest

import pgraph_core as pg

MECH = pg.Mechanism(pg.Model.serial(3))
Q, V = MECH.home()
TOP = pg.Mechanism(pg.Model(bodies=(pg.Body(name="top", joint="spherical"),)))
NAN = np.array([0.0, np.nan, 0.0])
LONG = np.zeros(4)


def run(**options):
    return pg.simulate(MECH, t_end=0.01, step=1e-3, **options)


# what is called, and words that its sentence must hold
REFUSED = {
    "mass_matrix, length": (lambda: MECH.mass_matrix(LONG), ("q", "3", "4")),
    "mass_matrix, nan": (lambda: MECH.mass_matrix(NAN), ("q", "finite")),
    "mass_matrix, complex": (lambda: MECH.mass_matrix([1j, 0, 0]), ("q", "numbers")),
    "mass_matrix, zero quaternion": (lambda: TOP.mass_matrix(np.zeros(4)), ("q", "quaternion")),
    "forward_dynamics, zero quaternion": (
        lambda: TOP.forward_dynamics(np.zeros(4), np.zeros(3)),
        ("q", "quaternion"),
    ),
    "bias_force, length": (lambda: MECH.bias_force(Q, LONG), ("v", "3", "4")),
    "bias_force, nan": (lambda: MECH.bias_force(Q, NAN), ("v", "finite")),
    "bias_force, text": (lambda: MECH.bias_force("abc", V), ("q", "numbers")),
    "inverse_dynamics, vdot": (lambda: MECH.inverse_dynamics(Q, V, LONG), ("vdot", "3", "4")),
    "inverse_dynamics, nan": (lambda: MECH.inverse_dynamics(Q, V, NAN), ("vdot", "finite")),
    "forward_dynamics, tau": (lambda: MECH.forward_dynamics(Q, V, LONG), ("tau", "3", "4")),
    "forward_dynamics, q nan": (lambda: MECH.forward_dynamics(NAN, V), ("q", "finite")),
    "forward_dynamics, tau nan": (lambda: MECH.forward_dynamics(Q, V, NAN), ("tau", "finite")),
    "forward_dynamics, external": (
        lambda: MECH.forward_dynamics(Q, V, external=np.zeros((2, 6))),
        ("external", "(3, 6)", "(2, 6)"),
    ),
    "forward_dynamics, external nan": (
        lambda: MECH.forward_dynamics(Q, V, external=np.full((3, 6), np.inf)),
        ("external", "finite"),
    ),
    "constrained_dynamics, v": (lambda: MECH.constrained_dynamics(Q, LONG), ("v", "3", "4")),
    "jacobian, name": (lambda: MECH.jacobian(Q, "4"), ("'4'", "1, 2, 3")),
    "jacobian, point": (lambda: MECH.jacobian(Q, "3", (0, 0)), ("point", "3", "2")),
    "jacobian, nan": (lambda: MECH.jacobian(NAN, "3"), ("q", "finite")),
    "tip_jacobian, nan": (lambda: MECH.tip_jacobian(NAN), ("q", "finite")),
    "pose, name": (lambda: MECH.pose(Q, "paw"), ("'paw'", "1, 2, 3")),
    "pose, length": (lambda: MECH.pose(LONG, "1"), ("q", "3", "4")),
    "pose, nan": (lambda: MECH.pose(NAN, "1"), ("q", "finite")),
    "kernel_operator, length": (lambda: MECH.kernel_operator(LONG), ("q", "3", "4")),
    "simulate, q": (lambda: run(q=LONG), ("q", "3", "4")),
    "simulate, q nan": (lambda: run(q=NAN), ("q", "finite")),
    "simulate, v nan": (lambda: run(v=NAN), ("v", "finite")),
    "simulate, tau": (lambda: run(tau=LONG), ("tau", "3", "4")),
    "simulate, tau of f": (lambda: run(tau=lambda t, q, v: LONG), ("tau", "3", "4")),
    "simulate, method": (lambda: run(method="rk5"), ("rk5", "rk4")),
    "simulate, rtol of rk4": (lambda: run(method="rk4", rtol=1e-8), ("rtol", "dop853")),
    "simulate, rtol below rounding": (lambda: run(rtol=1e-17), ("rtol", "rounding", "1e-17")),
    "simulate, rtol": (lambda: run(rtol=-1.0), ("rtol", "> 0", "-1")),
    "simulate, atol": (lambda: run(atol=-1.0), ("atol", "> 0", "-1")),
    "simulate, max_steps": (lambda: run(max_steps=0), ("max_steps", ">= 1", "0")),
    "simulate, scenario": (lambda: run(scenario="walk"), ("walk", "no scenario")),
    "simulate, stabilise": (lambda: run(stabilise="hope"), ("stabilise", "project")),
    "simulate, frames": (lambda: run(frames=1), ("frames", "2")),
    "simulate, frames and t_eval": (lambda: run(frames=3, t_eval=[0]), ("frames", "t_eval")),
    "simulate, t_eval": (lambda: run(t_eval=[0, 0.005, 0.004]), ("t_eval", "ascend")),
    "simulate, too many steps": (lambda: pg.simulate(MECH, step=1e-300), ("step", "1e-300")),
    "simulate, t_end": (lambda: pg.simulate(MECH, t_end=-1.0), ("t_end", "> 0", "-1")),
    "simulate, step": (lambda: pg.simulate(MECH, step=0.0), ("step", "> 0")),
    "simulate, step nan": (lambda: pg.simulate(MECH, step=float("nan")), ("step", "nan")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_one_sentence(case):
    call, words = REFUSED[case]
    with pytest.raises(pg.PgraphError) as caught:
        call()
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    for word in words:
        assert word in text


def test_lists_and_integers_are_numbers_too():
    found = MECH.forward_dynamics([0, 0, 0], (1, 0, 0), np.array([0, 0, 1]))
    expected = MECH.forward_dynamics(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    np.testing.assert_array_equal(found, expected)


def test_numpy_s_own_numbers_are_numbers():
    done = run(frames=np.int64(3))
    assert len(done.t) == 3
    done = pg.simulate(MECH, t_end=np.float32(0.5), step=np.float32(0.25))
    np.testing.assert_allclose(done.t, [0, 0.25, 0.5])


@pytest.mark.parametrize("grid", [[0.0], [0.005], [0.002, 0.01], (0.0, 0.01)])
def test_the_grid_that_was_asked_for_comes_back(grid):
    done = run(t_eval=grid)
    np.testing.assert_array_equal(done.t, grid)
    assert len(done.q) == len(done.energy) == len(grid)
    full = run()
    np.testing.assert_allclose(
        done.q, full.q[np.round(1e3 * np.array(grid)).astype(int)], atol=1e-9
    )


def test_quaternions_of_any_length_turn_the_same():
    q = np.array([0.9, 0.1, -0.3, 0.2])
    np.testing.assert_allclose(TOP.mass_matrix(3 * q), TOP.mass_matrix(q), atol=1e-15)


def test_arguments_are_not_changed():
    q, v, tau = np.ones(3), np.ones(3), np.ones(3)
    MECH.forward_dynamics(q, v, tau)
    pg.simulate(MECH, q, v, tau=tau, t_end=0.01, step=1e-3)
    assert (q == 1).all()
    assert (v == 1).all()
    assert (tau == 1).all()


def test_a_joint_that_moves_no_inertia_is_named():
    ghost = pg.Body(name="ghost", mass=0.0, inertia=((0.0,) * 3,) * 3)
    mech = pg.Mechanism(pg.Model(bodies=(ghost,)))
    with pytest.raises(pg.PgraphError, match="ghost"):
        mech.forward_dynamics(*mech.home())


def test_a_model_without_bodies_is_refused_or_runs_but_never_crashes():
    try:
        mech = pg.Mechanism(pg.Model())
    except pg.PgraphError:
        return
    assert mech.mass_matrix(np.zeros(0)).shape == (0, 0)


# -- whatever is given for any argument of anything public ----------------------------------------

MODEL = pg.Model(
    bodies=(
        pg.Body(name="a", axes=((0, 1, 0),), shape={"kind": "sphere", "radius": 0.1}),
        pg.Body(name="b", parent="a", link=(1, 0, 0), axes=((0, 1, 0),), tip=(1, 0, 0)),
    ),
    constraints=(pg.Point(name="loop", body="b", active=False),),
    contacts=(pg.Contact(name="floor", body="a"),),
    scenarios=(pg.Scenario(name="s", t_end=0.01),),
)
BOTH = pg.Mechanism(MODEL)
WRONG = (None, -1, float("nan"), "zz", b"x", [], {"zz": [1]}, object(), np.zeros((2, 3)), [None])
RIGHT = {  # where an argument has no default
    "mechanism": BOTH, "mech": BOTH, "model": MODEL, "q": np.zeros(2), "v": np.zeros(2),
    "q_next": np.ones(2), "vdot": np.zeros(2), "tau": np.zeros(2), "body": "b", "name": "b",
    "parent": "a", "part": pg.Body(name="c"), "path": "nowhere.json", "t": 0.0, "n": 1, "to": 0,
    "changes": {}, "text": "{}", "targets": {"b": (1, 0, 0)}, "dt": 1e-3, "constraint": "loop",
    "active": True, "pgraph": [1], "dof": [1], "runs": (), "F": np.zeros((2, 6)),
}  # fmt: skip
SLOW = {"sweep", "stability_map", "work_precision", "Mechanism.batch", "Result.show"}


def public_calls():
    """What a user calls, by name: functions, classes with their checks, and methods."""
    done = pg.simulate(BOTH, t_end=0.01, step=1e-3)
    holders = (MODEL, BOTH, done, pg.Stepper(BOTH))
    found = {
        name: getattr(pg, name)
        for name in pg.__all__
        if inspect.isfunction(getattr(pg, name))
        or hasattr(getattr(pg, name), "model_fields")
        or hasattr(getattr(pg, name).__init__, "__wrapped__")
    }
    for holder in holders:
        kind = type(holder).__name__
        for name in (x for x in dir(holder) if not x.startswith("_")):
            value = getattr(holder, name)
            if inspect.ismethod(value) and hasattr(value.__func__, "__wrapped__"):
                found[f"{kind}.{name}"] = value
    return {name: call for name, call in found.items() if name not in SLOW}


CALLS = public_calls()


@pytest.mark.parametrize("name", CALLS)
def test_what_cannot_be_meant_is_a_sentence_never_an_error_of_python_s(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call = CALLS[name]
    taken = [
        p
        for p in inspect.signature(call).parameters.values()
        if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
    ]
    base = {p.name: RIGHT.get(p.name, "zz") for p in taken if p.default is p.empty}
    for wrong in (
        {},
        {**base, "no such argument": 1},
        *({**base, p.name: value} for p in taken for value in WRONG),
    ):
        named = dict(wrong)
        first = [
            named.pop(p.name) for p in taken if p.kind is p.POSITIONAL_ONLY and p.name in named
        ]
        with contextlib.suppress(pg.PgraphError):
            call(*first, **named)
    with pytest.raises(pg.PgraphError):
        call(*range(30))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: pg.simulate(MECH, q0=Q), ("q0", "did you mean q?")),
        (lambda: pg.simulate(MECH, tend=1.0), ("tend", "did you mean t_end?")),
        (lambda: pg.Stepper(MECH, dt=1e-3), ("Stepper", "dt", "did you mean step?")),
        (lambda: MECH.forward_dynamics(Q, V, torque=V), ("torque", "did you mean tau?")),
        (lambda: pg.Body("a"), ("pg.Body(name='a', ...)",)),
        (lambda: pg.Body(name="a", weight=1.0), ("weight", "did you mean mass?")),
        (lambda: pg.simulate("arm.json"), ("pg.Model.load('arm.json')",)),
        (lambda: pg.Model.edit("a", mass=1.0), ("Model.edit", "call it on a Model")),
        (lambda: MODEL.edit(name="a"), ("name", "goes first")),
        (lambda: MODEL.edit("flor", friction=1.0), ("'flor'", "choose one of floor")),
        (lambda: pg.simulate(MECH, estimate="no"), ("estimate", "True, False or None", "'no'")),
        (lambda: pg.Stepper(MECH).record_over(-1.0), ("dt", "> 0", "-1")),
        (lambda: MODEL.close_loop("b", None), ("body 'b', parent", "None")),
        (lambda: pg.gaits("paws"), ("feet", "four contacts", "'paws'")),
        (lambda: MODEL.edit("a", mass=[1, 2]), ("body 'a', mass", "[1, 2]")),
    ],
)
def test_the_sentence_names_what_was_probably_meant(call, words):
    with pytest.raises(pg.PgraphError) as refused:
        call()
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_an_error_of_the_user_s_own_function_comes_through_as_it_is():
    def progress(fraction):
        return {}["not there"]

    with pytest.raises(KeyError, match="not there") as raised:
        run(progress=progress)
    assert not isinstance(raised.value, pg.PgraphError)


def test_a_name_that_results_lack_is_a_key_error_with_a_sentence():
    done = pg.simulate(BOTH, t_end=0.01, step=1e-3)
    for named in (done.contact_force, done.contact_gap, pg.Stepper(BOTH).contact_force):
        with pytest.raises(KeyError) as missing:
            named["flor"]
        assert isinstance(missing.value, pg.InputError)
        assert "'flor'" in str(missing.value)
        assert "choose one of floor" in str(missing.value)
    with pytest.raises(pg.InputError, match="no constraint acts"):
        done.constraint_force["loop"]
    with pytest.raises(pg.InputError, match="no body is called 'x'"):
        done.contact_force["a", "x"]


@pytest.mark.parametrize(
    ("made", "hint"),
    [
        (lambda: pg.Shape(kind="ball", radius=0.1), "did you mean sphere?"),  # pyright: ignore
        (lambda: pg.Body(name="a", joint="ball"), "did you mean spherical?"),
        (lambda: pg.Constraint(name="c", kind="hinge", body="a"), "did you mean revolute?"),
        (lambda: pg.Body(name="a", mass="1.5 kg"), "write 1.5, without a unit"),  # pyright: ignore
        (lambda: pg.Body(name="a", inertia=(1, 2, 3, 0, 0, 0)), "(xx, xy, xz)"),  # pyright: ignore
    ],
)
def test_words_and_forms_of_other_programs_are_told_ours(made, hint):
    with pytest.raises(pg.ModelError) as refused:
        made()
    (problem,) = refused.value.problems
    assert hint in str(problem)


def test_a_loop_that_does_not_close_names_joints_left_at_the_parents_origin():
    turn = {"axes": (0, 0, 1), "tip": (1, 0, 0)}
    bodies = [pg.Body(name="a", **turn), pg.Body(name="b", parent="a", **turn)]
    far = pg.Point(name="far", body="b", point=(0.2, 0, 0), other_point=(1.1, 0, 0))
    model = pg.Model(bodies=bodies, constraints=[far])
    with pytest.raises(pg.InputError, match=r"body 'b': its link is .*not at its tip") as refused:
        pg.Mechanism(model).mobility()
    assert refused.value.problems[0].where == "constraint 'far'"
    assert pg.simulate(model.edit("b", link=(1, 0, 0)), t_end=0.1).status.ok
