"""Arguments of public calls: all forms of numbers are taken, and no value ends in a bare error."""

import inspect

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.study.stability import started

MECH = pg.Mechanism(pg.Model.serial(3))
TOP = pg.Mechanism(pg.Model(bodies=(pg.Body(name="top", joint="spherical", inertia=(0.01,) * 3),)))


def run(**options):
    return pg.simulate(MECH, t_end=0.01, step=1e-3, **options)


def test_lists_and_integers_are_numbers():
    found = MECH.forward_dynamics([0, 0, 0], (1, 0, 0), np.array([0, 0, 1]))
    expected = MECH.forward_dynamics(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    np.testing.assert_array_equal(found, expected)


def test_numbers_of_numpy_are_numbers():
    assert len(run(frames=np.int64(3)).t) == 3
    done = pg.simulate(MECH, t_end=np.float32(0.5), step=np.float32(0.25))
    np.testing.assert_allclose(done.t, [0, 0.25, 0.5])


FREE = pg.Mechanism(pg.Model.serial(3).replace(gravity=(0, 0, 0)))
HAND = FREE.pose([0.1, 0.2, 0.3], "3")[0]
ARM = FREE.model.add(*(pg.Motor(name=f"m{b}", body=b) for b in "123"))
BY_NAME = {  # what a call returns for one of q, v, vdot or tau
    "forward_dynamics": lambda x: FREE.forward_dynamics(x, x, x),
    "propagation_operator": lambda x: FREE.propagation_operator(x).toarray(),
    "kernel_operator": lambda x: FREE.kernel_operator(x).toarray(),
    "assemble": lambda x: FREE.assemble(x, x, [])[1],
    "mobility": lambda x: FREE.mobility(x, x).dof,
    "linearise": lambda x: FREE.linearise(x, x).A,
    "equilibrium": lambda x: FREE.equilibrium(x),
    "inverse_kinematics": lambda x: FREE.inverse_kinematics("3", position=HAND, q=x),
    "state_from": lambda x: FREE.state_from(MECH, x, x)[1],
    "place_poles": lambda x: pg.place_poles(ARM, [-1, -1.1, -2, -2.1, -3, -3.1], q=x).K,
    "simulate": lambda x: pg.simulate(FREE, x, x, tau=x, t_end=0.01).q[-1],
    "simulate_batch": lambda x: pg.simulate_batch(FREE, x, x, tau=x, t_end=0.01)[0].q[-1],
    "Stepper": lambda x: stepped(pg.Stepper(FREE, q=x, v=x, tau=x)),
    "Stepper.record": lambda x: pg.Stepper(FREE).record(2, tau=x).q[-1],
    "Stepper.linearise": lambda x: pg.Stepper(FREE).linearise(x).A,
    "BatchStepper.step": lambda x: stepped(pg.BatchStepper(FREE, 2), x),
    "BatchStepper.acceleration": lambda x: pg.BatchStepper(FREE, 2).acceleration(x),
    "BatchStepper.inverse_dynamics": lambda x: pg.BatchStepper(FREE, 2).inverse_dynamics(x),
    "started": lambda x: [b.q for b in started(FREE.model, x, x).bodies],
}


def stepped(stepper, tau=None):
    if tau is not None:
        stepper.reset(tau, tau)
    stepper.step(tau)
    return np.concatenate((stepper.q, stepper.v), axis=-1)


@pytest.mark.parametrize("name", BY_NAME)
def test_states_and_torques_are_taken_by_name_by_all_calls(name):
    values = {"1": 0.1, "2": 0.2, "3": 0.3}
    expected = BY_NAME[name]([*values.values()])
    pandas = pytest.importorskip("pandas")
    for given in (values, dict(reversed(values.items())), pandas.Series(values)):
        np.testing.assert_array_equal(BY_NAME[name](given), expected)
    with pytest.raises(pg.InputError, match="nobody"):
        BY_NAME[name]({"1": 0.1, "nobody": 0.2})


def test_a_joint_may_have_a_value_for_each_of_many_states():
    many = {"2": np.array([0.1, 0.2]), "3": 0.3}
    rows = np.array([[0.0, 0.1, 0.3], [0.0, 0.2, 0.3]])
    batch = pg.BatchStepper(FREE, 2)
    batch.reset(many, many)
    np.testing.assert_array_equal(np.stack((batch.q, batch.v)), [rows, rows])
    for run, row in zip(pg.simulate_batch(FREE, many, v={"1": 2.0}, t_end=0.01), rows):
        np.testing.assert_array_equal(run.q[0], row)
        np.testing.assert_array_equal(run.v[0], [2.0, 0.0, 0.0])


@pytest.mark.parametrize("grid", [[0.0], [0.005], [0.002, 0.01], (0.0, 0.01)])
def test_a_run_has_the_times_of_t_eval(grid):
    done = run(t_eval=grid)
    np.testing.assert_array_equal(done.t, grid)
    assert len(done.q) == len(done.energy) == len(grid)
    rows = np.round(1e3 * np.array(grid)).astype(int)
    np.testing.assert_allclose(done.q, run().q[rows], atol=1e-9)


def test_quaternions_of_any_length_turn_the_same():
    q = np.array([0.9, 0.1, -0.3, 0.2])
    np.testing.assert_allclose(TOP.mass_matrix(3 * q), TOP.mass_matrix(q), atol=1e-15)


def test_a_joint_that_moves_no_inertia_is_named():
    ghost = pg.Body(name="ghost", mass=0.0, inertia=((0.0,) * 3,) * 3)
    mech = pg.Mechanism(pg.Model(bodies=(ghost,)))
    with pytest.raises(pg.PgraphError, match="ghost"):
        mech.forward_dynamics(*mech.home())


MODEL = pg.Model(
    bodies=(
        pg.Body(name="a", axes=((0, 1, 0),), shape={"kind": "sphere", "radius": 0.1}),
        pg.Body(name="b", parent="a", link=(1, 0, 0), axes=((0, 1, 0),), com=(1, 0, 0)),
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
    "wrench": np.zeros(6),
}  # fmt: skip
SLOW = {"sweep", "stability_map", "work_precision", "Mechanism.batch", "Result.show"}


def public_calls():
    done = pg.simulate(BOTH, t_end=0.01, step=1e-3)
    found = {}
    for name in pg.__all__:
        value = getattr(pg, name)
        checked = hasattr(getattr(value, "__init__", None), "__wrapped__")
        if inspect.isfunction(value) or (checked and not hasattr(value, "model_fields")):
            found[name] = value
    for holder in (MODEL, BOTH, done, pg.Stepper(BOTH)):
        for name in (x for x in dir(holder) if not x.startswith("_")):
            value = getattr(holder, name)
            if inspect.ismethod(value) and hasattr(value.__func__, "__wrapped__"):
                found[f"{type(holder).__name__}.{name}"] = value
    return {name: call for name, call in found.items() if name not in SLOW}


CALLS = public_calls()


def called(call, arguments):
    named = dict(arguments)
    only = [p for p in parameters(call) if p.kind is p.POSITIONAL_ONLY]
    first = [named.pop(p.name) for p in only if p.name in named]
    try:
        call(*first, **named)
    except pg.PgraphError as error:
        return error
    return None


def parameters(call):
    taken = inspect.signature(call).parameters.values()
    return [p for p in taken if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]


@pytest.mark.parametrize("share", [3, pytest.param(1, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_never_ends_in_an_error_of_python_s(name, share, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call = CALLS[name]
    taken = parameters(call)
    base = {p.name: RIGHT.get(p.name, "zz") for p in taken if p.default is p.empty}
    called(call, {})
    called(call, {**base, "no such argument": 1})
    for i, p in enumerate(taken):
        for value in WRONG[i % share :: share]:
            called(call, {**base, p.name: value})
    with pytest.raises(pg.PgraphError):
        call(*range(30))


NAMED = [x for x in CALLS if x.startswith(("Mechanism.", "simulate")) and "at_tips" not in x]


@pytest.mark.parametrize("name", NAMED)
def test_an_argument_of_no_known_type_is_refused_by_its_name(name):
    taken = parameters(CALLS[name])
    base = {p.name: RIGHT.get(p.name, "zz") for p in taken if p.default is p.empty}
    for p in taken:
        assert p.name in str(called(CALLS[name], {**base, p.name: object()})), p.name


STATES = (  # wrong values of q, v, vdot and tau, and the facts that are named
    (np.zeros(3), ("2", "3")),
    (np.array([0.0, np.nan]), ("finite",)),
    ([1j, 0], ("numbers",)),
    ("ab", ("numbers",)),
)


@pytest.mark.parametrize("name", NAMED)
def test_a_state_of_the_wrong_size_or_type_is_refused(name):
    taken = parameters(CALLS[name])
    base = {p.name: RIGHT.get(p.name, "zz") for p in taken if p.default is p.empty}
    for field in {p.name for p in taken} & {"q", "v", "vdot", "tau"}:
        for value, facts in STATES if "other" not in base else ():
            text = str(called(CALLS[name], {**base, field: value}))
            assert [fact for fact in (field, *facts) if fact not in text] == [], text
