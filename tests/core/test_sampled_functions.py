"""Torque functions at a rate: the bits of a loop of a Stepper, and memory that is named."""

import collections
import functools
import itertools
import random

import numpy as np
import pytest

import pgraph_core as pg

from ..refusals import assert_names, refusal

CART = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], damping=(1.0,))
MODEL = pg.Model(bodies=[CART], gravity=(0, 0, 0))


def integral(rate=0.01):
    kept = [0.0]

    def control(t, q, v):
        kept[0] += rate * (1.0 - v[0])
        return [5.0 * kept[0] + 2.0 * (1.0 - v[0])]

    return control


def machine():
    mode = "push"

    def control(t, q, v):
        nonlocal mode
        mode = "brake" if v[0] > 0.5 else "push" if v[0] < 0.3 else mode
        return [1.0 if mode == "push" else -1.0]

    return control


def delay():
    line = collections.deque([0.0] * 10, maxlen=10)

    def control(t, q, v):
        line.append(v[0])
        return [1.0 - line[0]]

    return control


def held():
    kept = {"next": 0.0, "u": 0.0}

    def control(t, q, v):
        if t >= kept["next"]:
            kept["u"], kept["next"] = 1.0 - v[0], kept["next"] + 0.05
        return [kept["u"]]

    return control


def log():
    rows = []

    def control(t, q, v):
        rows.append((t, v[0]))
        return [1.0 - v[0]]

    return control


REMEMBERING = [integral, machine, delay, held, log]


class Sum:
    total = 0.0

    def __call__(self, t, q, v):
        self.total += 0.01 * (1.0 - v[0])
        return [self.total]

    def method(self, t, q, v):
        return self(t, q, v)


class OfClass:
    total = 0.0

    def __call__(self, t, q, v):
        OfClass.total += 0.01
        return [OfClass.total]


class Slots:
    __slots__ = ("total",)

    def __init__(self):
        self.total = 0.0

    def __call__(self, t, q, v):
        self.total += 0.01
        return [self.total]


def attribute():
    def control(t, q, v):
        control.total += 0.01
        return [control.total]

    control.total = 0.0
    return control


def default():
    def control(t, q, v, kept=[0.0]):  # noqa: B006
        kept[0] += 0.01
        return [kept[0]]

    return control


def generator():
    def total():
        found = 0.0
        while True:
            found += 0.01 * (1.0 - (yield found))

    kept = total()
    next(kept)
    return lambda t, q, v: [kept.send(v[0])]


def cached():
    @functools.lru_cache
    def kept():
        return [0.0]

    def control(t, q, v):
        kept()[0] += 0.01
        return [kept()[0]]

    return control


def stepper():
    model = pg.Stepper(MODEL, step=0.01)

    def control(t, q, v):
        model.step(tau=[1.0 - v[0]])
        return [1.0 - model.v[0]]

    return control


OTHERS = {
    "an object": Sum,
    "a method": lambda: Sum().method,
    "a class": OfClass,
    "slots": Slots,
    "an attribute": attribute,
    "a default value": default,
    "a generator": generator,
    "an iterator": lambda: (lambda kept: lambda t, q, v: [next(kept)])(iter(np.zeros(9999))),
    "a count": lambda: (lambda kept: lambda t, q, v: [next(kept)])(itertools.count()),
    "a cache": cached,
    "a stepper": stepper,
    "by name": lambda: {"cart": (lambda f: lambda t, q, v: f(t, q, v)[0])(integral())},
    "of (t, x)": lambda: (lambda f: lambda t, x: f(t, x[:1], x[1:]))(integral()),
    "a partial function": lambda: functools.partial(lambda f, t, q, v: f(t, q, v), integral()),
    "random": lambda: lambda t, q, v: [random.random()],
    "a random state": lambda: (lambda r: lambda t, q, v: [r.normal()])(np.random.default_rng(1)),
}

PURE = {
    "a function": lambda t, q, v: -v,
    "by name": {"cart": lambda t, q, v: 1.0 - v[0]},
    "with a mechanism": (lambda m: lambda t, q, v: m.bias_force(q, v))(pg.Mechanism(MODEL)),
    "with local variables": lambda t, q, v: np.array([t]),
}


def told(tau, **options):
    run = pg.simulate(MODEL, t_end=1.0, tau=tau, method="rk4", step=5e-3, **options)
    return [text for text in run.notices if "torque function" in text]


@pytest.mark.parametrize(
    "make", [*REMEMBERING, *OTHERS.values()], ids=[*(x.__name__ for x in REMEMBERING), *OTHERS]
)
def test_memory_is_named_unless_the_function_is_sampled(make):
    assert "sample=" in told(make())[0]
    assert not told(make(), sample=0.02)


@pytest.mark.parametrize("name", PURE)
def test_a_function_of_its_arguments_is_not_named(name):
    assert not told(PURE[name])


@pytest.mark.parametrize("make", REMEMBERING)
@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6"])
def test_samples_are_the_bits_of_a_loop_of_a_stepper(make, method):
    own = make()
    st = pg.Stepper(MODEL, step=2e-3, method=method)
    parts = [st.record(10, tau=own(st.t, st.q.copy(), st.v.copy())) for _ in range(50)]
    run = pg.simulate(MODEL, t_end=1.0, tau=make(), sample=0.02, method=method, step=2e-3)
    assert np.array_equal(run.t[1:], np.concatenate([part.t[1:] for part in parts]))
    for name in ("q", "v"):
        loop = np.vstack([getattr(part, name)[1:] for part in parts])
        assert np.array_equal(getattr(run, name)[1:], loop)
        assert np.array_equal(getattr(run, name)[-1], getattr(st, name))


def box():
    shape = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    body = pg.Body(name="box", joint="free", shape=shape, derived=("inertia",))
    touch = pg.Contact(name="c", body="box", other="ground", friction=0.5)
    return pg.Model(bodies=[body], contacts=[touch])


def test_contact_forces_are_those_of_the_loop():
    def pushing():
        count = itertools.count()
        return lambda t, q, v: [0, 0, 0, 6.0 if next(count) % 20 < 10 else -3.0, 0, 0]

    q, own = [0, 0, 0.15, 1, 0, 0, 0], pushing()
    st = pg.Stepper(box(), step=2e-3, method="moreau_jean", q=q)
    parts = [st.record(10, tau=own(st.t, st.q, st.v)) for _ in range(25)]
    run = pg.simulate(
        box(), q=q, t_end=0.5, tau=pushing(), sample=0.02, method="moreau_jean", step=2e-3
    )
    force = np.vstack([part.contact_force["c"][1:] for part in parts])
    assert np.array_equal(run.contact_force["c"][1:], force)


def test_adaptive_steps_end_at_samples():
    """The linear motion between samples is known: v' = u - v."""
    v, count = [0.0], []
    own = integral()
    for _ in range(100):
        u = own(0.0, None, v)[0]
        v = [u + (v[0] - u) * np.exp(-0.01)]
    tau = integral()
    run = pg.simulate(
        MODEL, t_end=1.0, sample=0.01, tau=lambda t, q, v: count.append(t) or tau(t, q, v)
    )
    assert abs(run.v[-1, 0] - v[0]) < 1e-12
    assert np.allclose(count, 0.01 * np.arange(100), rtol=0, atol=1e-15)  # ascending, once each
    assert len(run.t) == 1001


def test_a_run_that_goes_on_samples_as_the_whole_run():
    whole = pg.simulate(MODEL, t_end=1.0, tau=integral(), sample=0.02, step=5e-3)
    tau = integral()
    first = pg.simulate(MODEL, t_end=0.5, tau=tau, sample=0.02, step=5e-3)
    second = pg.simulate(MODEL, start=first, t_end=1.0, tau=tau, sample=0.02, step=5e-3)
    assert np.abs(second.q[-1] - whole.q[-1]).max() < 1e-13  # 0.5 s is a sample
    assert np.abs(second.v[-1] - whole.v[-1]).max() < 1e-13


def test_a_second_run_is_refused_to_a_function_that_remembers():
    options = {"t_end": 1.0, "sample": 0.02, "estimate": True}
    run = pg.simulate(MODEL, tau=integral(), **options)
    assert np.isnan(run.error_estimate)
    assert "'kept'" in run.message
    run = pg.simulate(MODEL, tau=lambda t, q, v: 1.0 - v, **options)
    assert run.error_estimate < 1e-8


@pytest.mark.parametrize("options", [{"method": "rk4", "step": 1e-3}, {"rtol": 1e-10}], ids=str)
def test_a_switch_at_a_sample_acts_before_it(options):
    """A constant torque that is sampled is that torque."""
    a, b = (pg.Body(name=name, joint="prismatic", axes=[(1, 0, 0)]) for name in "ab")
    tie = pg.Constraint(name="tie", kind="point", body="a", other="b", active=False)
    model = pg.Model(bodies=[a, b], constraints=[tie], gravity=(0, 0, 0))
    options |= {
        "t_end": 0.3,
        "v": [1.0, -0.5],
        "switches": [(0.1, "tie", True), (0.2, "tie", False)],
    }
    seen = []
    run = pg.simulate(
        model, tau=lambda t, q, v: seen.append(v.copy()) or [0.3, 0.0], sample=0.05, **options
    )
    whole = pg.simulate(model, tau=[0.3, 0.0], **options)
    assert np.abs(run.q[-1] - whole.q[-1]).max() < 1e-12
    assert len(seen) == 6
    assert seen[2][0] == seen[2][1]
    assert len(run.t) == len(np.unique(run.t))


def refused(make, *facts):
    assert_names(str(refusal(make)), *facts)


def test_refusals():
    tau = integral()
    refused(lambda: pg.simulate(MODEL, sample=0.01), "sample", "tau", "pg.Sampled")
    refused(lambda: pg.simulate(MODEL, tau=[1.0], sample=0.01), "sample", "tau")
    refused(lambda: pg.simulate(MODEL, tau=tau, sample=0.0), "sample", "> 0")
    refused(lambda: pg.simulate(MODEL, tau=tau, sample=-1.0), "sample", "-1")
    refused(lambda: pg.simulate(MODEL, tau=tau, sample=1e-3, step=1e-2), "0.001", "step=0.001")
    refused(lambda: pg.simulate(MODEL, tau=tau, sample=1e-9), "samples", "allowed")
    refused(lambda: pg.simulate(MODEL, tau=lambda t, q, v: [1, 2], sample=0.1), "(2,)", "(1,)")
    run = pg.simulate(MODEL, tau=lambda t, q, v: [1.0 if t < 0.5 else np.nan], sample=0.1)
    assert run.status is pg.Status.NOT_FINITE
    assert "t = 0.5 s" in run.message
