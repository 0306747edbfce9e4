"""Advice about steps and methods, followed: it holds.

Each random model is run with steps that are several times too large. Whatever the messages and
notices then advise is tried. Scales of length, mass and time are random.
"""

import re

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.simulation.rates import fastest_mode

NIGHTLY = 60
QUICK = 12
EXPLICIT = ("rk4", "semi_implicit_euler", "dopri5", "dop853")
STEPS = (  # advised steps in messages and notices
    r"try a step of ([\d.e+-]+) s",
    r"stable for dt < ([\d.e+-]+) s",
    r"requires less than ([\d.e+-]+) s",
    r"give ([\d.e+-]+) s or less",
)


def body(rng, name, parent, size, weight, **more):
    """A rod along -z that turns about y, and its next joint at its end."""
    length = size * rng.uniform(0.5, 1.5)
    m = weight * rng.uniform(0.3, 3.0)
    inertia = np.diag([1.0, 1.0, 0.1]) * m * length**2 / 12
    place = (0, 0, 0) if parent == "ground" else (0, 0, -size)
    given = {"com": (0, 0, -length / 2), "inertia": inertia, "link": place, "axes": (0, 1, 0)}
    return pg.Body(name=name, parent=parent, mass=m, **{**given, **more})


def chain(rng, n, size, weight, pace):
    """A serial chain with stiff joints, the stiffest of which is the fastest."""
    bodies, parent = [], "ground"
    for i in range(n):
        rate = 10 ** rng.uniform(1.2, 2.5) / pace
        k = weight * size**2 * rate**2
        damping = rng.choice([0.0, 0.02, 3.0]) * k / rate
        q = (rng.uniform(-0.3, 0.3) if i == 0 else 1e-3,)
        given = {"stiffness": (0.0 if i == 0 else k,), "damping": (float(damping) if i else 0.0,)}
        bodies.append(body(rng, f"b{i}", parent, size, weight, q=q, **given))
        parent = f"b{i}"
    return bodies, []


def spring(rng, size, weight, pace):
    """A pendulum on a stiff spring between bodies, which stiffens as it stretches by the swing."""
    rate = 10 ** rng.uniform(1.2, 2.5) / pace
    slide = {"motions": (("rotate", (0, 1, 0)), ("translate", (0, 0, -1))), "joint": "compound"}
    bob = pg.Body(
        name="bob", com=(0, 0, 0), mass=weight, inertia=np.eye(3) * 0.01 * weight * size**2,
        link=(0, 0, 0), q=(rng.uniform(0.3, 1.5), size), **slide,
    )  # fmt: skip
    pull = pg.Spring(
        name="s", body="bob", stiffness=weight * rate**2, rest=size,
        damping=float(rng.choice([0.0, 0.1, 2.0])) * weight * rate,
    )  # fmt: skip
    return [bob], [pull]


def strut(rng, size, weight, pace):
    """Two arms joined by a strut with a damper and a bump stop."""
    bodies = [body(rng, "a", "ground", size, weight, q=(0.4,))]
    bodies.append(body(rng, "b", "a", size, weight, q=(-0.8,)))
    rate = 10 ** rng.uniform(1.2, 2.5) / pace
    k = weight * rate**2
    x = np.linspace(0.3, 3.0, 4) * size
    law = pg.Lines(x=tuple(x), value=tuple(k * (x - size)))
    ends = {"point": (0, 0, -size / 2), "other_point": (1.2 * size, 0, -0.2 * size)}
    bump = {"bump_length": 0.4 * size, "bump_stiffness": 3.0 * k}
    return bodies, [pg.Strut(name="t", body="b", other="ground", spring=law, **ends, **bump)]


def drive(rng, size, weight, pace):
    """A servo with high gains."""
    bodies = [body(rng, "a", "ground", size, weight), body(rng, "b", "a", size, weight)]
    rate = 10 ** rng.uniform(1.2, 2.5) / pace
    inertia = weight * size**2
    kd = float(rng.choice([0.05, 0.5, 4.0])) * inertia * rate
    return bodies, [
        pg.Servo(name="s", body="b", kp=inertia * rate**2, kd=kd, target=rng.uniform(-0.5, 0.5))
    ]


def contact(rng, size, weight, pace):
    """A ball on soft ground."""
    r = 0.2 * size
    ball = pg.Body(
        name="ball", joint="prismatic", axes=(0, 0, 1), mass=weight, com=(0, 0, 0), q=(1.5 * r,),
        inertia=np.eye(3) * 0.4 * weight * r**2, shape=pg.Shape(kind="sphere", radius=r),
    )  # fmt: skip
    k = weight * (10 ** rng.uniform(1.2, 2.5) / pace) ** 2 / np.sqrt(r)
    return [ball], pg.Contact(name="c", body="ball", law="soft", stiffness=k, damping=0.1)


FAMILIES = {
    "chain": lambda rng, *scales: chain(rng, int(rng.integers(2, 6)), *scales),
    "spring": spring, "strut": strut, "drive": drive, "contact": contact,
}  # fmt: skip


def model_of(family, rng):
    """Return a random model, and the time in which its pendulums swing."""
    size, weight, pace = (10 ** rng.uniform(-2, 2) for _ in range(3))
    bodies, forces = FAMILIES[family](rng, size, weight, pace)
    contacts = () if isinstance(forces, list) else (forces,)
    gravity = (0, 0, -10 * size / pace**2)
    acting = forces if isinstance(forces, list) else ()
    return pg.Model(bodies=bodies, forces=acting, contacts=contacts, gravity=gravity), pace


def advised(run):
    """Return the steps that a run advises [s]."""
    texts = (run.message, *run.notices)
    return [float(x) for text in texts for how in STEPS for x in re.findall(how, text)]


def holds(model, known, step, method, pace):
    """Check that a run reaches its end, near the motion or at least as slow as it."""
    run = pg.simulate(model, t_end=2 * pace, method=method, step=step, estimate=False, frames=41)
    return run.status.ok and np.abs(run.v).max() < 3.0 * np.abs(known.v).max() + 1e-300


def followed(seed):
    """Yield (what was followed, whether it held) for a random model."""
    rng = np.random.default_rng(seed)
    family = list(FAMILIES)[seed % len(FAMILIES)]
    model, pace = model_of(family, rng)
    method = str(rng.choice(EXPLICIT))
    exact = {"method": "dop853", "rtol": 1e-6, "estimate": False, "frames": 401}
    known = pg.simulate(model, t_end=2 * pace, **exact)
    assert known.status.ok, (family, seed, known.message)
    step = 2 * pace / 25
    for _ in range(12):  # until a step is too large by a factor from 2 to 4, or none is
        run = pg.simulate(model, t_end=2 * pace, method=method, step=step, estimate=False)
        steps = advised(run)
        if steps and min(steps) < step:
            break
        step *= 2.0
        if step > pace / 15:
            break
    for each in steps:
        yield (
            f"{family} {seed} {method} step {each:g}",
            holds(model, known, 0.999 * each, method, pace),
        )
    if any("radau5" in text for text in (run.message, *run.notices)):
        ended = pg.simulate(model, t_end=2 * pace, method="radau5", step=step, estimate=False)
        yield f"{family} {seed} radau5 step {step:g}", ended.status.ok


@pytest.mark.parametrize("first", [
    0, pytest.param(QUICK, marks=pytest.mark.nightly),
])  # fmt: skip
def test_advice_holds_when_it_is_followed(first):
    last = QUICK if first == 0 else NIGHTLY
    tried = [each for seed in range(first, last) for each in followed(seed)]
    assert len(tried) >= (last - first) // 2
    assert [what for what, held in tried if not held] == []


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_advice_on_a_motion_with_switches_ignores_where_the_run_went_wrong(scale):
    """The rate of this hardening spring is 1e3/s at first, and without bound in a run that grows.

    Adaptive steps cannot repeat a run with switches, so only its first state is known to be right.
    """
    slider = pg.Body(name="a", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=(0.01 * scale,))
    pull = pg.Motor(name="pull", body="a", torque=f"=-1e6*q.a*(1 + (q.a/{scale})^2)")
    latch = pg.Weld(name="latch", body="a", active=False)
    never = {"coordinate": "a", "above": 1e30}
    switch = pg.Switch(constraint="latch", active=True, when=never)
    scenario = pg.Scenario(name="s", switches=[switch], t_end=1.0)
    model = pg.Model(
        bodies=[slider], gravity=(0, 0, 0), forces=[pull], constraints=[latch], scenarios=[scenario]
    )
    run = pg.simulate(model, scenario="s", method="rk4", step=5e-3)
    assert run.status is pg.Status.NOT_FINITE
    assert advised(run)
    assert all(1e-3 < step < 3e-3 for step in advised(run)), run.message


@pytest.mark.parametrize("pace", [1e-2, 1.0, 30.0])
@pytest.mark.parametrize("height", [0.1, 0.3])
def test_advised_steps_hold_a_nutation_which_the_semi_implicit_method_makes_grow(height, pace):
    """It swings by forces of velocities, for which no step of that method is stable for ever."""
    top = pg.Body(
        name="top", joint="spherical", mass=2.0, com=(0, 0, height),
        inertia=np.diag([0.05, 0.05, 0.04]), v=(0.3 / pace, 0.0, 200.0 / pace),
    )  # fmt: skip
    model = pg.Model(bodies=[top], gravity=(0, 0, -10 / pace**2))
    asked = {"t_end": 2 * pace, "method": "semi_implicit_euler", "estimate": False}
    run = pg.simulate(model, step=0.05 * pace, **asked)
    assert run.status is pg.Status.NOT_FINITE
    assert "forces of velocities" in run.message
    known = pg.simulate(model, t_end=2 * pace, rtol=1e-8, estimate=False)
    steps = advised(run)
    assert steps
    for step in steps:
        assert holds(model, known, step, "semi_implicit_euler", pace), run.message


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
def test_steps_for_good_accuracy_depend_on_the_order_of_the_method(method):
    slider = {"joint": "prismatic", "axes": (1, 0, 0), "mass": 1.0, "stiffness": (1e4,)}
    model = pg.Model(bodies=[pg.Body(name="a", q=(1.0,), **slider)], gravity=(0, 0, 0))
    asked = {"t_end": 1.0, "method": method, "estimate": False}
    said = " ".join(pg.simulate(model, step=0.03, **asked).notices)
    good = float(re.findall(r"and ([\d.e+-]+) s or less for good accuracy", said)[0])
    q = pg.simulate(model, step=good, **asked)["a"]
    assert np.abs(q[-1] - np.cos(100.0)) < 0.05


def stiff_pendulum(**fields):
    """A pendulum with a period of 0.06 s."""
    inertia = {"mass": 1.0, "com": (0, 0, -0.5), "inertia": (0.1,) * 3}
    return pg.Model([pg.Body("a", q=0.3, stiffness=(4000,), **inertia, **fields)])


@pytest.mark.quick
@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6", "dop853", "radau5"])
def test_the_way_to_steps_by_their_error_can_be_called(method):
    """Three steps a period are too few. Each notice says how to let the method choose them."""
    run = pg.simulate(stiff_pendulum(), t_end=1, method=method, step=0.02)
    told = [text for text in run.notices if "rtol" in text]
    ways = {
        found.group(1) or method
        for text in told
        for found in re.finditer(r"(?:method='(\w+)' with )?rtol= for adaptive steps", text)
    }
    assert told
    assert len(ways) == 1
    good = pg.simulate(stiff_pendulum(), t_end=1, method=ways.pop(), rtol=1e-8)
    assert good.relative_error[-1] < 1e-4
    assert not good.notices


@pytest.mark.quick
def test_time_stepping_is_told_of_steps_only_and_tolerances_of_smaller_ones():
    """Impacts of time stepping have no error by which to choose a step."""
    stopped = stiff_pendulum(limits=((-0.1, 0.5),))
    coarse = pg.simulate(stopped, t_end=1, method="moreau_jean", step=0.01)
    assert any("use a smaller step" in text for text in coarse.notices)
    assert not any("rtol" in text for text in coarse.notices)
    loose = pg.simulate(pg.Model.serial(2), q=[2.0, 2.0], t_end=20, rtol=1e-3)
    assert any("a smaller rtol" in text for text in loose.notices)
    assert not any("smaller step" in text for text in loose.notices)


def test_the_advice_is_of_the_motion_and_not_of_errors_beside_it():
    """A fibre at low activation contracts onto its motion within microseconds. Explicit steps that
    are limited by this rate leave errors, at which the rate is 60 times as large."""
    muscle = pg.Muscle(name="m", body="arm", point=(0.03, -0.05, 0), other_point=(0.02, 0.3, 0),
                       f_max=1730, l_opt=0.093, l_slack=0.171, model="thelen2003")  # fmt: skip
    arm = pg.Body(name="arm", mass=1.5, inertia=(0.02, 0.02, 0.02), com=(0, -0.15, 0), q=(-0.68,))
    model = pg.Model(bodies=[arm], forces=[muscle])
    run = pg.simulate(model, t_end=0.5, method="radau5", rtol=1e-8, frames=501, estimate=False)
    packed, rates = run.mechanism.packed, []
    forces = packed.drives(model.forces), packed.loads(model.forces, states=True)
    for at in zip(run.q, run.v, run.states):
        rest = np.append(at[0], np.zeros(2)), np.append(at[1], at[2])
        rates.append(abs(fastest_mode(run.mechanism, forces, np.zeros(0, int), *rest)))
    steps = {"method": "dopri5", "step": 1e-3, "estimate": False}
    notices = pg.simulate(model, t_end=0.5, **steps).notices
    (told,) = re.findall(r"lambda\*dt = (\S+),", " ".join(notices))
    assert 0.5 * max(rates) < float(told) / 1e-3 < 2.0 * max(rates)
