"""Derivatives of runs against closed forms and differences."""

import pickle

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import built_in

SIX = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences of order 6


def described(name):
    return built_in(name).model


def state(run):
    return np.hstack((run.q, run.v))


def difference(function, h):
    return sum(w * (function(k * h) - function(-k * h)) for k, w in SIX.items()) / h


def missed(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


STEPS = {"method": "rk4", "step": 1e-3, "t_end": 0.5, "estimate": False, "frames": 51}


def oscillator():
    spring = pg.Spring(name="s", body="block", other="ground", stiffness=40.0, rest=0.0)
    return pg.Model(
        bodies=[pg.Body(name="block", joint="prismatic", axes=[(1, 0, 0)], mass=2.0, q=[0.5])],
        forces=[spring],
        gravity=(0, 0, 0),
    )


def test_an_oscillator_has_its_closed_form():
    run = pg.simulate(
        oscillator(), t_end=3.0, rtol=1e-12, method="dop853", estimate=False, frames=40,
        wrt=["forces.s.stiffness", "bodies.block.mass", "q.block", "v.block"],
    )  # fmt: skip
    t, rate = run.t, np.sqrt(40.0 / 2.0)
    by_rate = -0.5 * t * np.sin(rate * t)
    for path, exact in {
        "forces.s.stiffness": by_rate * 0.5 * rate / 40.0,
        "bodies.block.mass": -by_rate * 0.5 * rate / 2.0,
        "q.block": np.cos(rate * t),
        "v.block": np.sin(rate * t) / rate,
    }.items():
        assert missed(run.sensitivity(path)[:, 0], exact) < 1e-9


SEVERAL = {
    "double_pendulum": (
        "bodies.upper.mass", "bodies.lower.mass", "bodies.upper.com.2", "bodies.lower.com.2",
        "bodies.lower.link.2", "v.lower", "gravity.2",
    ),
    "four_bar": (
        "bodies.left crank.mass", "bodies.coupler.mass", "bodies.coupler.com.0",
        "bodies.right crank.com.1", "gravity.1", "constraints.loop.point.0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SEVERAL)
@pytest.mark.parametrize("backwards", [False, True])
def test_numbers_have_the_same_derivatives_together_and_alone(name, backwards):
    """Masses and centres of one body change the same words, lengths are not linear in them."""
    given = STEPS | {"scenario": "turn" if name == "four_bar" else None}
    paths = SEVERAL[name][::-1] if backwards else SEVERAL[name]
    run = pg.simulate(described(name), wrt=list(paths), **given)
    for path in paths:
        alone = pg.simulate(described(name), wrt=path, **given).sensitivity(path)
        assert alone.any()
        assert missed(run.sensitivity(path), alone) < 1e-11, path


def test_runs_of_one_mechanism_have_the_derivatives_of_their_own():
    """What a mechanism keeps of numbers neither depends on a state nor on other numbers."""
    model, paths = described("double_pendulum"), SEVERAL["double_pendulum"]
    used, states = pg.Mechanism(model), np.random.default_rng(3).normal(size=(3, 2, 2))
    for some, (q, v) in zip((paths[:1], paths[1:], paths), states, strict=True):
        again, fresh = (
            pg.simulate(mech, q, v, **STEPS, wrt=list(some)) for mech in (used, pg.Mechanism(model))
        )
        for path in some:
            assert np.array_equal(again.sensitivity(path), fresh.sensitivity(path)), path


def test_a_number_at_the_end_of_its_range_leaves_the_others_as_they_are():
    """No body has the larger moment of inertia that the step to one side would need."""
    rod = pg.Body(
        name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.4), q=[1.0],
        inertia=np.diag([0.03, 0.06, 0.03]), damping=0.01,
    )  # fmt: skip
    model = pg.Model(bodies=[rod])
    paths = ["bodies.rod.inertia.1.1", "bodies.rod.mass", "bodies.rod.damping"]
    run = pg.simulate(model, wrt=paths, **STEPS)
    for path in paths:
        alone = pg.simulate(model, wrt=path, **STEPS).sensitivity(path)
        assert alone.any()
        assert missed(run.sensitivity(path), alone) < 1e-9, path


NUMBERS = [  # of a model, and the steps of differences by them
    ("double_pendulum", "bodies.lower.mass", 1e-2),
    ("double_pendulum", "q.upper", 1e-2),
    ("heavy_top", "bodies.top.com.2", 2e-5),
    ("four_bar", "bodies.coupler.link.0", 2e-3),
    ("four_bar", "q.left crank", 2e-3),
    ("slider_crank", "bodies.rod.link.0", 2e-4),
]


@pytest.mark.parametrize(
    ("number", "method"),
    combined(NUMBERS, ["semi_implicit_euler", "rk4", "gauss6", "radau5"]),
)
def test_derivatives_are_those_of_the_steps(number, method):
    name, path, share = number
    model = described(name)
    options = STEPS | {"method": method}
    plain, run = pg.simulate(model, **options), pg.simulate(model, wrt=path, **options)
    assert plain == run
    assert plain.counters == run.counters
    group, _, body = path.partition(".")
    mech = pg.Mechanism(model)
    q = mech.home()[0]

    def moved(change):
        if group == "q":
            other = q.copy()
            other[mech.joints[body].q.start] += change
            return state(pg.simulate(model, other, **options))
        _, body_name, field, *entry = path.split(".")
        value = getattr(model.body(body_name), field)
        if entry:
            value = list(value)
            value[int(entry[0])] += change
        else:
            value += change
        return state(pg.simulate(model.edit(body_name, **{field: value}), q, **options))

    assert missed(run.sensitivity(path), difference(moved, share)) < 1e-8


@pytest.mark.parametrize(
    ("name", "path", "end", "frames"),
    [
        ("andrews", "forces.spring.stiffness", 0.03, (50, 140, 290)),
        ("slider_crank", "bodies.rod.link.0", 1.0, (50, 166, 266)),
        ("four_bar", "bodies.coupler.mass", 2.0, (50, 100, 181, 195)),  # 181 is nearly flat
    ],
)
def test_frames_within_steps_have_the_derivatives_of_runs_that_end_there(name, path, end, frames):
    """Frames are interpolated and projected, and the last one is the end of a step."""
    options = {"method": "dop853", "rtol": 1e-11, "estimate": False, "wrt": path}
    options |= {"scenario": "turn" if name == "four_bar" else None}
    run = pg.simulate(described(name), t_end=end, frames=301, **options)
    assert run == pg.simulate(described(name), t_end=end, frames=301, **options | {"wrt": ()})
    largest = np.abs(run.sensitivity(path)).max()
    for i in frames:
        last = pg.simulate(described(name), t_end=run.t[i], frames=2, **options).sensitivity(path)
        assert np.abs(run.sensitivity(path)[i] - last[-1]).max() < 1e-8 * largest


def test_adaptive_methods_agree():
    options = {
        "t_end": 1.0,
        "frames": 30,
        "estimate": False,
        "wrt": ["q.upper", "bodies.lower.mass"],
    }
    model = described("double_pendulum")
    fine = pg.simulate(model, method="rk4", step=2e-4, **options)
    for method in ("dopri5", "dop853"):
        run = pg.simulate(model, method=method, rtol=1e-12, **options)
        for path in options["wrt"]:
            assert missed(run.sensitivity(path), fine.sensitivity(path)) < 1e-9


@pytest.mark.parametrize("options", [{"step": 0.02}, {"rtol": 1e-6}, {"rtol": 1e-10}])
def test_stiff_forces_have_derivatives(options):
    """Of a slider that decays in 0.1 ms to a slow creep, against its closed form."""
    spring = pg.Spring(name="s", body="block", other="ground", stiffness=4e4, rest=0.0, damping=1e4)
    block = pg.Body(name="block", joint="prismatic", axes=[(1, 0, 0)], mass=1.0, q=[0.5])
    model = pg.Model(bodies=[block], forces=[spring], gravity=(0, 0, 0))
    given = {"t_end": 1.0, "method": "radau5", "estimate": False, "frames": 21} | options
    run = pg.simulate(model, wrt=["q.block", "forces.s.stiffness"], **given)
    assert run == pg.simulate(model, **given)
    k, c, t = 4e4, 1e4, run.t
    slow = (np.sqrt(c * c - 4 * k) - c) / 2  # rates of the motion
    fast = -c - slow
    by_stiffness = -1.0 / (c + 2 * slow)  # slope of the slow rate
    position = (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    later = t > 0.01
    share = fast / (fast - slow)  # of the start in the slow motion
    by_rate = 0.5 * np.exp(slow * t) * (share * t + (2 * share - 1) / (fast - slow))
    exact = (by_rate * by_stiffness)[later]
    assert missed(run.sensitivity("q.block")[:, 0], position) < 1e-5
    assert missed(run.sensitivity("forces.s.stiffness")[later, 0], exact) < 1e-3


def test_groups_of_numbers_are_those_of_each():
    model = described("double_pendulum")
    wrt = [f"{kind}.{body}" for kind in "qv" for body in ("upper", "lower")]
    wrt += [f"bodies.{b}.{x}" for b in ("upper", "lower") for x in ("mass", "com.2", "link.0")]
    together = pg.simulate(model, wrt=wrt, **STEPS)
    for path in wrt:
        alone = pg.simulate(model, wrt=[path], **STEPS)
        assert np.array_equal(alone.sensitivity(path), together.sensitivity(path))


@pytest.mark.parametrize(
    ("name", "body", "read"),
    [
        ("double_pendulum", "lower", lambda run: run.kinetic_energy[-1]),
        ("double_pendulum", "lower", lambda run: run.joint_force[-1, 0]),
        ("four_bar", "coupler", lambda run: run.vdot[-1]),
        ("four_bar", "coupler", lambda run: run.body_pose[-1, :, :2]),
        ("slider_crank", "rod", lambda run: run.constraint_force["pin"][-1, 3:5]),
    ],
)
def test_a_gradient_reads_anything_of_a_run(name, body, read):
    model, axis = described(name), int(name == "double_pendulum") * 2
    path = f"bodies.{body}.link.{axis}"
    run = pg.simulate(model, wrt=[path], **STEPS)
    q = pg.Mechanism(model).home()[0]

    def moved(change):
        link = np.array(model.body(body).link) + change * np.eye(3)[axis]
        return np.asarray(read(pg.simulate(model.edit(body, link=link), q, **STEPS)))

    assert missed(np.asarray(run.gradient(read)[path]), difference(moved, 2e-3)) < 1e-7


def test_files_and_pickles_keep_derivatives(tmp_path):
    run = pg.simulate(described("four_bar"), wrt=["bodies.coupler.link.0", "v.coupler"], **STEPS)
    run.save(tmp_path / "run.npz")
    for other in (pg.Result.load(tmp_path / "run.npz"), pickle.loads(pickle.dumps(run))):
        assert other == run
        for path in run.derivatives:
            assert np.array_equal(other.sensitivity(path), run.sensitivity(path))
        with pytest.raises(pg.InputError):
            other.gradient(lambda run: run.q[-1, 0])


def test_a_number_without_influence_is_named():
    run = pg.simulate(described("double_pendulum"), wrt=["bodies.lower.tip.0"], **STEPS)
    assert any("bodies.lower.tip.0" in text for text in run.notices)


@pytest.mark.parametrize(
    ("wrt", "options"),
    [
        ("bodies.lowr.mass", {}),
        ("q.nobody", {}),
        (["q.upper", "q.upper"], {}),
        ("inputs.knee", {}),
        ("q.upper", {"tau": lambda t, q, v: 0.0 * v}),
        ([3], {}),
    ],
)
def test_what_has_no_derivative_is_refused(wrt, options):
    with pytest.raises(pg.InputError):
        pg.simulate(described("double_pendulum"), wrt=wrt, **STEPS | options)


def test_an_unasked_path_is_refused():
    run = pg.simulate(described("double_pendulum"), **STEPS)
    with pytest.raises(pg.InputError):
        run.sensitivity("q.upper")
    with pytest.raises(pg.InputError):
        run.gradient(lambda run: run.q[-1, 0])


def test_rounding_of_derivatives_that_are_zero_is_no_difference():
    """A prescribed motion and a law leave no freedom: velocities do not depend on `value`."""
    inertia = (0.1, 0.1, 0.1)
    bodies = [
        pg.Body(name="a", axes=(0, 0, 1), inertia=inertia, q=[0.3]),
        pg.Body(name="b", axes=(0, 1, 0), link=(1, 0, 0), inertia=inertia, q=[-0.35]),
    ]
    laws = [
        pg.Motion(name="g", body="a", q_of_t="=0.3+0.5*sin(2*t)"),
        pg.Coupling(name="c", coefficients={"a": [0.3], "b": [1.0]}, value=-0.2),
    ]
    model, path = pg.Model(bodies=bodies, constraints=laws), "constraints.c.value"
    run = pg.simulate(model, wrt=path, rtol=1e-10)
    assert np.allclose(run.sensitivity(path), [0.0, 1.0, 0.0, 0.0], rtol=0, atol=1e-9)
    assert not any("apart" in text for text in run.notices)


def test_a_start_far_from_its_constraints_is_named():
    arms = [pg.Body(name=name, axes=(0, 1, 0), com=(0.3, 0, 0), q=[0.4]) for name in "ab"]
    arms[1] = arms[1].model_copy(update={"parent": "a", "link": (0.5, 0, 0)})
    law = pg.Coupling(name="c", coefficients={"a": [1.0], "b": [0.5]}, value=-1.5)
    model, path = pg.Model(bodies=arms, constraints=[law]), "constraints.c.coefficients.b.0"
    run = pg.simulate(model, wrt=path, **STEPS)
    near = dict(zip(("q", "v"), pg.Mechanism(model).assemble(*pg.Mechanism(model).home())[:2]))
    close = pg.simulate(model, wrt=path, **near, **STEPS)
    assert any("assemble" in text for text in run.notices)
    assert not any("derivatives" in text for text in close.notices)


@pytest.mark.parametrize("missed", [0.0, 1e-4, 0.1])
@pytest.mark.parametrize("wrt", ["q.upper", "bodies.lower.mass"])
def test_a_start_that_misses_a_constraint_is_assembled_in_the_finer_run_too(missed, wrt):
    """The derivatives of both runs include those of the projected velocity."""
    rods = [
        pg.Body(name=name, axes=(0, 1, 0), com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.1), **more)
        for name, more in (("upper", {}), ("lower", {"parent": "upper", "link": (0, 0, -1.0)}))
    ]
    rod = pg.Distance(name="rod", body="lower", other_point=(1.0, 0, 0), length=1.5)
    mech = pg.Mechanism(pg.Model(bodies=rods, constraints=(rod,)))
    q = mech.assemble()[0] + (0.0, missed)
    options = {"v": (0.5, 0.0), "t_end": 0.3, "frames": 4, "rtol": 1e-10}
    run = pg.simulate(mech, q, wrt=(wrt,), **options)
    assert run.status.ok
    assert not any("finer run" in text for text in run.notices)


@pytest.mark.parametrize("options", [{"rtol": 1e-11}, {"method": "rk4", "step": 1e-3}])
@pytest.mark.parametrize("level", [0.2, -0.3])
def test_the_last_frame_moves_with_the_time_of_a_terminal_event(level, options):
    def make(start=1.0, mass=1.3):
        rods = [
            pg.Body(name="arm", axes=(0, 1, 0), mass=mass, com=(0, 0, -0.5), inertia=(0.1,) * 3,
                    damping=0.2),
            pg.Body(name="hand", parent="arm", link=(0, 0, -1), axes=(0, 1, 0), com=(0, 0, -0.4),
                    inertia=(0.1,) * 3),
        ]  # fmt: skip
        return pg.Model(bodies=rods), (start, 0.3)

    def stop(t, q, v):
        return q[0] - level + 0.1 * q[1]

    stop.terminal = True

    def run(wrt=(), **numbers):
        return pg.simulate(*make(**numbers), t_end=3.0, events=stop, wrt=wrt, frames=301, **options)

    def end(run):
        return np.concatenate((run.t[-1:], run.q[-1], run.v[-1], run.dissipation[-1:]))

    moved = run(("q.arm", "bodies.arm.mass"))
    found = moved.gradient(end)
    h = 1e-5
    for path, sides in {
        "q.arm": [end(run(start=1.0 + s)) for s in (h, -h)],
        "bodies.arm.mass": [end(run(mass=1.3 + s)) for s in (h, -h)],
    }.items():
        assert found[path] == pytest.approx(np.subtract(*sides) / (2 * h), abs=1e-6)
        q = moved.sensitivity(path)[-1, :2]
        assert q[0] + 0.1 * q[1] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(pg.InputError, match="last frame"):
        moved.gradient(lambda run: run.user_events[0].t)
