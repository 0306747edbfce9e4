"""Derivatives of runs against closed forms and differences, and fits by them."""

import pickle

import numpy as np
import pytest

import pgraph_core as pg

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


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4", "gauss6", "radau5"])
@pytest.mark.parametrize(
    ("name", "path", "share"),
    [
        ("double_pendulum", "bodies.lower.mass", 1e-2),
        ("double_pendulum", "q.upper", 1e-2),
        ("heavy_top", "bodies.top.com.2", 2e-5),
        ("four_bar", "bodies.coupler.link.0", 2e-3),
        ("four_bar", "q.left crank", 2e-3),
        ("slider_crank", "bodies.rod.link.0", 2e-4),
    ],
)
def test_derivatives_are_those_of_the_steps(method, name, path, share):
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


BOUNDED = {"state_high": (1.0, 4.0), "state_low": (-1.0, -4.0)}


def integrating(end, rate, **fields):
    drive = pg.Motor(name="p", body="s", torque=rate, integrates=True, **{end: BOUNDED[end][0]})
    body = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    return pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[drive])


@pytest.mark.parametrize("method", ["radau5", "gauss6"])
@pytest.mark.parametrize("end", BOUNDED)
def test_a_drive_meets_the_bound_of_its_integral(end, method):
    """v = h - h^2 / (2 u) at t = 1, of an integral u t up to h."""
    h, u = BOUNDED[end]
    wrt = ["forces.p.torque", f"forces.p.{end}"]
    run = pg.simulate(integrating(end, u), t_end=1.0, method=method, wrt=wrt)
    assert np.isclose(run.sensitivity(wrt[0])[-1, 1], h * h / (2 * u * u), rtol=1e-6)
    assert np.isclose(run.sensitivity(wrt[1])[-1, 1], 1.0 - h / u, rtol=1e-6)


@pytest.mark.parametrize("method", ["auto", "rk4", "semi_implicit_euler", "dopri5", "dop853"])
@pytest.mark.parametrize("end", BOUNDED)
def test_bounds_of_integrals_are_refused_by_explicit_methods(end, method):
    model = integrating(end, BOUNDED[end][1])
    with pytest.raises(pg.InputError, match=f"force 'p', {end}"):
        pg.simulate(model, t_end=1.0, method=method, wrt=["forces.p.torque"])
    free = model.edit("p", kind="force", **{end: None})
    by = pg.simulate(free, t_end=1.0, method=method, wrt=["forces.p.torque"])
    assert np.isclose(by.sensitivity("forces.p.torque")[-1, 1], 0.5, rtol=2e-3)


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5", "gauss6"])
def test_a_ramp_meets_the_limit_of_its_drive(method):
    """v = h - h^2 / (2 u) at t = 1, of a torque u t up to h."""
    h, u, wrt = 1.0, 4.0, ["forces.p.torque.value.1", "forces.p.torque_limit"]
    model = integrating("state_high", u)
    ramp = pg.Table(t=[0, 1], value=[0, u])

    def run(limit):
        drive = pg.Motor(name="p", body="s", torque=ramp, torque_limit=limit)
        return pg.simulate(model.replace(forces=[drive]), t_end=1.0, method=method, wrt=wrt)

    if method in ("radau5", "gauss6"):
        found = [run(h).sensitivity(path)[-1, 1] for path in wrt]
        assert np.allclose(found, [h * h / (2 * u * u), 1.0 - h / u], rtol=1e-6)
        return
    with pytest.raises(pg.InputError, match="force 'p', torque_limit"):
        run(h)
    assert np.isclose(run(2 * u).sensitivity(wrt[0])[-1, 1], 0.5)  # a limit that it never meets


CORNERS = {"t": (0.1, 0.3, 0.5, 0.8), "value": (0.5, 2.0, -1.0, 1.5)}


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "radau5", "gauss6"])
@pytest.mark.parametrize("kind", [pg.Motor, pg.Wrench])
def test_each_knot_of_a_table_has_the_slopes_of_both_its_sides(kind, method):
    """The end speed is the area under the table, which stays constant beyond its outer knots."""
    t, x = (np.array(CORNERS[name]) for name in ("t", "value"))
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    given, field, last = {"torque": pg.Table(**CORNERS)}, "torque", ""
    if kind is pg.Wrench:
        forces = np.outer(x, (1.0, 0.3, -0.2))
        given, field, last = {"force": pg.VectorTable(t=t, value=forces)}, "force", ".0"
    model = pg.Model(bodies=[block], forces=[kind(name="f", body="s", **given)], gravity=(0, 0, 0))
    wrt = [f"forces.f.{field}.t.{k}" for k in range(4)]
    wrt += [f"forces.f.{field}.value.{k}{last}" for k in range(4)]
    run = pg.simulate(model, t_end=1.0, method=method, estimate=False, wrt=wrt)
    outside = np.concatenate((x[:1], x, x[-1:]))
    around = np.concatenate(([-t[0]], t, [2.0 - t[-1]]))  # as far outside again as the run goes
    exact = np.concatenate((outside[:-2] - outside[2:], around[2:] - around[:-2])) / 2.0
    assert np.allclose([run.sensitivity(path)[-1, 1] for path in wrt], exact, rtol=1e-6)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "radau5", "gauss6"])
@pytest.mark.parametrize("brake", ["=-max(a, 3*v.s)", "=-min(max(-3*v.s, a), 3*v.s)"])
def test_a_clamp_of_the_motion_has_the_slopes_of_both_its_sides(brake, method):
    """A slider decays at a rate of 3 until 3 v = a and then brakes evenly, or the reverse."""
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    drive = pg.Actuator(name="f", body="s", input=brake)  # a gain beside 1 makes another program
    model = pg.Model(bodies=[block], parameters={"a": 1.2}, gravity=(0, 0, 0)).add(drive)
    begin, end, fixed = 1.0, 1.0, brake.startswith("=-max")
    meets = np.log(3 * begin / 1.2) / 3 if fixed else (begin - 0.4) / 1.2
    wrt = ["a", "v.s", "forces.f.gain"]  # the gain makes time go faster
    run = pg.simulate(model, t_end=end, method=method, v=[begin], estimate=False, wrt=wrt)
    exact = meets - end, 1.2 / (3 * begin), -1.2 * end
    if not fixed:
        left = np.exp(-3 * (end - meets))
        exact = -meets * left, left, -3 * 0.4 * left * end
    assert np.allclose([run.sensitivity(path)[-1, 1] for path in wrt], exact, rtol=1e-5)


def test_a_gain_of_zero_is_a_number_as_any_other():
    """Of an actuator that pushes with u at t = 1: v = u t - kp u t^3 / 6 to first order in kp."""
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    drive = pg.Actuator(name="f", body="s", input=3.0, kp=0.0)
    model = pg.Model(bodies=[block], forces=[drive], gravity=(0, 0, 0))
    for u in (3.0, "=3"):
        given = model.edit("f", input=u)
        run = pg.simulate(given, t_end=1.0, method="dop853", wrt=["forces.f.kp"])
        assert np.isclose(run.sensitivity("forces.f.kp")[-1, 1], -3.0 / 6.0, rtol=1e-9)
        small, none = (
            pg.simulate(given.edit("f", kp=kp), t_end=1.0, method="dop853") for kp in (1e-9, 0.0)
        )
        assert np.isclose(small.v[-1, 0] - none.v[-1, 0], -0.5e-9, rtol=1e-5)


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


@pytest.mark.parametrize("step", [1e-3, 2e-3])
def test_derivatives_through_limits_agree_with_those_of_a_finer_run(step):
    """The frames of a finer run are at other times, as its steps are shifted."""
    body = pg.Body(
        name="a", axes=(0, 1, 0), com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.02), q=(0.5,),
        limits=(-0.2, 1.0), limit_restitution=0.6,
    )  # fmt: skip
    options = {"t_end": 1.0, "method": "moreau_jean", "step": step}
    run = pg.simulate(pg.Model(bodies=[body]), wrt=["q.a"], **options)
    assert run.notices == ()
    lost = run.gradient(lambda run: run.energy[0] - run.energy[-1])["q.a"]
    assert lost == pytest.approx(1.505, rel=2e-3)  # central differences
    assert np.isnan(run.gradient(lambda run: run.dissipation[-1])["q.a"])  # impacts are not in it


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


def test_slopes_that_are_infinite_are_named():
    slider = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    motor = pg.Motor(name="f", body="a", torque="=g*sqrt(max(q.a-0.1,0))+1")
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), parameters={"g": 1.3}, forces=[motor])
    run = pg.simulate(model, t_end=1.0, wrt=["g"], method="rk4", step=1e-3)
    named = [text for text in run.notices if "'g'" in text or "by g " in text]
    assert named or np.isfinite(run.sensitivity("g")).all()


@pytest.mark.parametrize("names", [("t", "upper [deg]"), ("t [ms]", "upper [rad]")])
def test_data_in_other_units_are_refused(names):
    data = dict(zip(names, ([0.0, 0.1, 0.2], [0.3, 0.2, 0.1])))
    with pytest.raises(pg.InputError):
        pg.fit(described("double_pendulum"), data, {"bodies.upper.mass": (0.1, 2.0)})


def test_an_unasked_path_is_refused():
    run = pg.simulate(described("double_pendulum"), **STEPS)
    with pytest.raises(pg.InputError):
        run.sensitivity("q.upper")
    with pytest.raises(pg.InputError):
        run.gradient(lambda run: run.q[-1, 0])


# -- fits ------------------------------------------------------------------------------------------

TIMES = np.linspace(0.0, 1.5, 151)
FIT = {"method": "rk4", "step": 1e-3}


def measured(seed, noise=1e-3):
    true = described("double_pendulum").edit("lower", mass=1.3).edit("upper", q=[1.0])
    run = pg.simulate(true, t_eval=TIMES, t_end=1.5, estimate=False, **FIT)
    rng = np.random.default_rng(seed)
    columns = {name: run.columns()[name] for name in ("upper", "v.lower")}
    return {"t": TIMES} | {k: x + noise * rng.normal(size=len(x)) for k, x in columns.items()}


FREE = {"bodies.lower.mass": (0.1, 5.0), "q.upper": (-1.0, 2.0)}


def test_fits_find_the_truth_within_their_errors():
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    apart, found = [], None
    for seed in range(6):
        found = pg.fit(start, measured(seed), FREE, **FIT)
        assert found.converged
        for path, true in zip(FREE, (1.3, 1.0)):
            apart.append(abs(found.values[path] - true) / found.errors[path])
    assert np.median(apart) < 2.0
    assert max(apart) < 4.0
    assert found is not None
    assert found.model.body("lower").mass == found.values["bodies.lower.mass"]


def test_files_and_tables_are_read_like_dicts(tmp_path):
    pandas = pytest.importorskip("pandas")
    data = measured(0)
    table = pandas.DataFrame(data)
    table.rename(columns={"t": "t [s]", "upper": "upper [rad]"}).to_csv(
        tmp_path / "x.csv", index=False
    )
    start = described("double_pendulum").edit("upper", q=[0.9])
    found = [pg.fit(start, d, FREE, **FIT) for d in (data, table, tmp_path / "x.csv")]
    assert found[0].values == pytest.approx(found[1].values, rel=1e-9)
    assert found[0].values == pytest.approx(found[2].values, rel=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-3])
@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5"])
def test_a_direction_that_data_do_not_determine_is_named(noise, method):
    """Masses, inertia and damping times one number give the same motion, with or without noise."""
    rod = pg.Body(
        name="rod", axes=(0, 1, 0), com=(0, 0, -0.4), mass=1.0, inertia=np.diag([0.03, 0.02, 0.03]),
        damping=0.05, q=[1.0],
    )  # fmt: skip
    model = pg.Model(bodies=[rod])
    given = {"method": method, "step": 1e-2 if method == "rk4" else None}
    exact = pg.simulate(model, t_eval=TIMES, t_end=1.5, estimate=False, **given)["rod"]
    data = {"t": TIMES, "rod": exact + noise * np.random.default_rng(0).normal(size=len(TIMES))}
    paths = ["bodies.rod.damping", "bodies.rod.mass", "bodies.rod.inertia.1.1"]
    found = pg.fit(model, data, dict(zip(paths, ((0.0, 1.0), (0.5, 2.0), (0.001, 0.055)))), **given)
    assert len(found.undetermined) == 1
    assert all(path in found.undetermined[0] for path in paths[1:])
    assert np.isnan(found.errors["bodies.rod.mass"])


@pytest.mark.parametrize(
    ("change", "free"),
    [
        ({"upper": None}, {"bodies.lower.mass": (0.1, 5.0)}),
        ({"uper": TIMES, "upper": None}, FREE),
        ({"upper": TIMES * np.nan}, FREE),
        ({"upper": TIMES[:3]}, FREE),
        ({"t": -TIMES}, FREE),
        ({}, {"bodies.lower.mas": (0.1, 5.0)}),
        ({}, {"bodies.lower.mass": (-1.0, 5.0)}),
        ({}, {"bodies.lower.mass": (2.0, 5.0)}),
        ({}, {"bodies.lower.mass": 3.0}),
        ({}, {"bodies.lower.tip.0": (-1.0, 1.0)}),
        ({}, {}),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, free):
    data = {k: x for k, x in (measured(0) | {"v.lower": None} | change).items() if x is not None}
    with pytest.raises(pg.InputError):
        pg.fit(described("double_pendulum"), data, free, **FIT)


def outliers(seed):
    data = measured(seed)
    wrong = np.random.default_rng(seed).choice(len(TIMES), 15, replace=False)
    for name in ("upper", "v.lower"):
        data[name] = data[name].copy()
        data[name][wrong] += 0.5
    return data


def test_robust_losses_bear_outliers_without_a_given_noise():
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    for loss in ("soft_l1", "huber", "cauchy"):
        apart = []
        for seed in range(3):
            found = pg.fit(start, outliers(seed), FREE, loss=loss, **FIT)
            assert found.converged
            assert found.noise["upper"] == pytest.approx(1e-3, rel=0.5)
            apart += [
                abs(found.values[path] - true) / found.errors[path]
                for path, true in zip(FREE, (1.3, 1.0))
            ]
        assert max(apart) < 4.0


def test_several_cases_share_the_model_and_have_their_own_starts():
    true = described("double_pendulum").edit("lower", mass=1.3)
    rng = np.random.default_rng(0)
    cases, starts = {}, {"slow": 0.3, "fast": 1.5}
    for name, angle in starts.items():
        run = pg.simulate(true, {"upper": angle}, t_eval=TIMES, t_end=1.5, estimate=False, **FIT)
        noisy = run["upper"] + 1e-3 * rng.normal(size=len(TIMES))
        cases[name] = ({"t": TIMES, "upper": noisy}, {"q": {"upper": angle + 0.05}})
    free = {"bodies.lower.mass": (0.1, 5.0), "q.upper@slow": (-1.0, 1.0), "q.upper@fast": (1, 2)}
    found = pg.fit(described("double_pendulum"), cases, free, **FIT)
    assert found.converged
    assert {*found.runs} == {*cases}
    assert {*found.residuals} == {"upper@slow", "upper@fast"}
    for (path, value), expected in zip(found.values.items(), (1.3, 0.3, 1.5)):
        assert abs(value - expected) < 4.0 * found.errors[path]
    one = pg.fit(true, {"slow": cases["slow"]}, {"bodies.lower.mass": (0.1, 5.0)}, **FIT)
    assert one.errors["bodies.lower.mass"] > found.errors["bodies.lower.mass"]
    for change in ({"q.upper@fats": (0, 1)}, {"q.lower@slow": (-1, 1)}, {"mass@slow": (0, 1)}):
        with pytest.raises(pg.InputError):
            pg.fit(described("double_pendulum"), cases, free | change, **FIT)


@pytest.mark.parametrize("how", [False, KeyboardInterrupt])
def test_a_fit_that_is_stopped_returns_its_best(how):
    told = []

    def progress(values, run):
        told.append(values)
        if len(told) == 3:
            if how is KeyboardInterrupt:
                raise KeyboardInterrupt
            return False

    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    found = pg.fit(start, measured(0), FREE, progress=progress, **FIT)
    assert not found.converged
    assert found.values in told


def test_a_fit_passes_by_invalid_models():
    """Differences of what is packed leave the valid inertias near the bound."""
    rod = pg.Body(
        name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.4), q=[1.0],
        inertia=np.diag([0.03, 0.05, 0.03]), damping=0.01,
    )  # fmt: skip
    model = pg.Model(bodies=[rod], gravity=(0, 0, -9.81))
    run = pg.simulate(model.edit("rod", inertia=np.diag([0.04, 0.07, 0.04])), t_eval=TIMES,
                      t_end=1.5, estimate=False, **FIT)  # fmt: skip
    free = {"bodies.rod.inertia.1.1": (0.03, 0.0599), "bodies.rod.damping": (0.0, 1.0)}
    found = pg.fit(model, {"t": TIMES, "rod": run["rod"]}, free, **FIT)
    assert "at its bound" in found.message
    assert found.model.body("rod").inertia[1][1] == pytest.approx(0.0599, rel=1e-3)


@pytest.mark.nightly
def test_errors_cover_the_truth_in_95_of_100_noise_seeds():
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    covered = dict.fromkeys(FREE, 0)
    for seed in range(100):
        found = pg.fit(start, measured(seed), FREE, **FIT)
        for path, true in zip(FREE, (1.3, 1.0)):
            covered[path] += abs(found.values[path] - true) < 2.0 * found.errors[path]
    # 95.4 are expected of a normal variable: fewer than 90 come by chance in 1 of 100 cases
    assert min(covered.values()) >= 90, covered


def test_a_number_at_which_its_part_is_packed_as_idle_has_its_derivative():
    """Of a torque g u: S = u ∂/∂τ. The derivative by another number beside it is as alone."""
    arm = pg.Body(name="r", axes=(0, 1, 0), mass=1.0, com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02))
    model = pg.Model(bodies=[arm], forces=[pg.Motor(name="s", body="r", torque=2.0)])
    wrt = ["forces.s.gear", "forces.s.torque", "bodies.r.mass"]
    run, plain = pg.simulate(model, wrt=wrt, **STEPS), pg.simulate(model, **STEPS)
    assert run == plain
    assert missed(run.sensitivity(wrt[0]), 2.0 * run.sensitivity(wrt[1])) < 1e-12
    alone = pg.simulate(model, wrt=wrt[2], **STEPS).sensitivity(wrt[2])
    assert missed(run.sensitivity(wrt[2]), alone) < 1e-12


@pytest.mark.parametrize("number", ["friction.0", "damping.0", "stiffness.0"])
def test_a_joint_without_a_law_has_the_derivative_to_its_first(number):
    """They are those to one side, of a smooth law that starts at 0."""
    arm = pg.Body(name="r", axes=(0, 1, 0), com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02), v=[-4.0])
    model, path = pg.Model(bodies=[arm]), f"bodies.r.{number}"
    field, h = number.partition(".")[0], 1e-4
    given = STEPS | {"t_end": 0.1}
    runs = [state(pg.simulate(model.edit("r", **{field: (k * h,)}), **given)) for k in range(3)]
    slope = (4.0 * runs[1] - runs[2] - 3.0 * runs[0]) / (2.0 * h)
    assert missed(pg.simulate(model, wrt=path, **given).sensitivity(path), slope) < 1e-5


def test_a_box_that_moves_along_an_axis_has_derivatives_by_its_drag():
    """Pressure c v² on one side alone, with v' = -c v² / m and v = v0 / (1 + c v0 t / m)."""
    box = pg.Body(name="b", joint="prismatic", axes=[(0, 0, 1)], mass=2.0, v=[3.0])
    drag = pg.Drag(name="d", body="b", size=(0.2, 0.3, 0.1), density=50.0)
    model = pg.Model(bodies=[box], forces=[drag], gravity=(0, 0, 0))
    run = pg.simulate(model, wrt=["forces.d.density", "v.b"], **STEPS)
    c, speed, t = 0.5 * 50.0 * 0.2 * 0.3 / 2.0, 3.0, run.t
    by_c = -speed * speed * t / (1 + c * speed * t) ** 2
    assert missed(run.sensitivity("forces.d.density")[:, 1], by_c * c / 50.0) < 1e-9
    assert missed(run.sensitivity("v.b")[:, 1], 1 / (1 + c * speed * t) ** 2) < 1e-9


WHEEL = pg.Body(name="r", axes=(0, 0, 1), inertia=(1, 1, 0.2), v=[12.0])
BLOCK = pg.Body(name="r", joint="prismatic", axes=[(1, 0, 0)], q=[1.0])
AT_ORIGIN = {"name": "f", "body": "r", "point": (0, 0, 0), "other_point": (0, 0, 0)}
PULLS = pg.Lines(x=[0.0, 0.4, 1.0], value=[-8.0, 0.0, 12.0])


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-3}])
@pytest.mark.parametrize(
    ("body", "force", "jump"),
    [
        (WHEEL, pg.Torsion(name="f", body="r", stiffness=2.0), 0.3086),
        (WHEEL, pg.Torsion(name="f", body="r", stiffness=2.0, rest=1.0), 0.3756),
        (WHEEL, pg.Bushing(**AT_ORIGIN, stiffness=np.diag([1, 1, 1, 1, 1, 2.0])), 0.3086),
        (BLOCK, pg.Spring(**AT_ORIGIN, stiffness=20.0, rest=0.4), 0.5144),
        (BLOCK, pg.Strut(**AT_ORIGIN, spring=PULLS), 0.5144),
    ],
)
def test_derivatives_end_where_a_force_jumps(body, force, jump, options):
    """The force jumps at half a turn and at a length of 0, at a time that depends on v and mass."""
    model, wrt = pg.Model(bodies=[body], forces=[force], gravity=(0, 0, 0)), "bodies.r.mass"
    wrt = "v.r" if body is WHEEL else wrt
    run = pg.simulate(model, wrt=wrt, t_end=0.8, frames=801, **options)
    assert np.array_equal(run.q, pg.simulate(model, t_end=0.8, frames=801, **options).q)
    known = np.isfinite(run.sensitivity(wrt)).all(axis=1)
    assert not known[run.t > jump].any()
    assert known[run.t < 0.5 * jump].all()
    assert any("derivatives end" in text and "'r'" in text for text in run.notices)


def test_springs_that_pass_no_corner_keep_their_derivatives():
    """A spring turns about a point that it does not reach, and a torsion turns back in time."""
    spring = pg.Spring(**AT_ORIGIN | {"other_point": (0, 0.2, 0)}, stiffness=20.0, rest=0.4)
    for body, force in ((BLOCK, spring), (WHEEL, pg.Torsion(name="f", body="r", stiffness=9.0))):
        model = pg.Model(bodies=[body.model_copy(update={"v": (9.0,)})], forces=[force])
        run = pg.simulate(model.replace(gravity=(0, 0, 0)), wrt="q.r", t_end=2.0, rtol=1e-9)
        assert np.isfinite(run.sensitivity("q.r")).all()
        assert not any("derivatives" in text for text in run.notices)


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
