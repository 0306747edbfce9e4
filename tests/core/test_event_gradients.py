"""Derivatives through events that stop or switch a run with contacts."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from .test_contact_gradients import swing_free
from .test_gradients import missed


def test_user_events_do_not_change_derivatives():
    model = swing_free()
    wrt = ["q.arm", "bodies.arm.mass"]
    for method in ("rk4", "dop853"):
        options: dict[str, Any] = {"t_end": 1.0, "frames": 21, "estimate": False, "step": 1e-2}
        options["method"] = method
        plain = pg.simulate(model, wrt=wrt, **options)
        run = pg.simulate(model, wrt=wrt, events=lambda t, q, v: q[0] - 0.1, **options)
        assert run.user_events
        for path in wrt:
            assert missed(run.sensitivity(path), plain.sensitivity(path)) < 1e-6


FALLING = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), q=(0.5,), limits=((0.0, None),))


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("options", [{}, {"method": "moreau_jean", "step": 2e-3}])
def test_events_of_a_fall_have_the_derivatives_of_the_closed_form(options, count):
    """Time stepping takes shorter steps to locate them, which must not be added to the motion."""

    def passed(t, q, v):
        return q[0] - 0.3

    def low(t, q, v):
        return q[0] - 0.01

    low.terminal = True
    model = pg.Model(bodies=(FALLING,))
    run = pg.simulate(model, t_end=0.3, wrt=["v.b"], events=[passed] * count, **options)
    assert run.sensitivity("v.b")[-1, 0] == pytest.approx(0.3, rel=1e-6)
    run = pg.simulate(model, t_end=1.0, wrt=["v.b"], events=[passed, low], **options)
    assert run.gradient(lambda r: r.t[-1])["v.b"] == pytest.approx(1.0 / 9.81, rel=1e-6)
    assert run.sensitivity("v.b")[-1, 1] == pytest.approx(0.0, abs=1e-6)


GROUND = pg.Contact(name="c", body="b", points=((0, 0, 0),), restitution=0.5, friction=0.0)


BOUNCING = {
    "limit": pg.Model(bodies=(FALLING.model_copy(update={"limit_restitution": (0.5,)}),)),
    "ground": pg.Model(bodies=(FALLING.model_copy(update={"limits": None}),), contacts=(GROUND,)),
}


def ended_by(model, event, wrt=(), **options):
    """The run that an event ends."""
    event.terminal = True
    run = pg.simulate(model, t_end=1.0, events=[event], wrt=wrt, estimate=False, **options)
    assert run.status == pg.Status.STOPPED
    return run


def last_slopes(*given, **options):
    """{path: derivatives of (q, v, t) of the last frame}."""
    run = ended_by(*given, **options)
    ends = run.gradient(lambda r: r.t[-1])
    return {path: np.append(run.sensitivity(path)[-1], end) for path, end in ends.items()}


@pytest.mark.parametrize(
    ("kind", "options", "after"),
    combined(BOUNCING, [{}, {"method": "moreau_jean", "step": 2e-3}], [0.6e-3, 3e-3, 2e-2]),
)
def test_an_event_in_the_step_of_an_impact_or_later(kind, options, after):
    """After a fall from h, e v rises at a speed w to a level at the time (v + e v - w) / g."""
    h, g, e = 0.5, 9.81, 0.5
    v = np.sqrt(2.0 * g * h)
    level = e * v * after - 0.5 * g * after**2
    found = last_slopes(BOUNCING[kind], rising_to(level), ["q.b", "v.b"], **options)
    w, by_h = np.sqrt(e * e * v * v - 2.0 * g * level), e * e * g
    wanted = np.array((0.0, by_h / w, ((1.0 + e) * g / v - by_h / w) / g))
    np.testing.assert_allclose(found["q.b"], wanted, atol=1e-6)
    np.testing.assert_allclose(found["v.b"], (0.0, 0.0, 1.0 / g), atol=1e-6)


def rising_to(level):
    def up(t, q, v):
        return q[0] - level

    vars(up)["direction"] = 1
    return up


@pytest.mark.parametrize(
    ("kind", "options", "level"),
    combined(BOUNCING, [{}, {"method": "moreau_jean", "step": 1e-3}], [-1.0, 0.5, 1.0]),
)
def test_an_event_on_a_velocity_that_an_impact_reverses_has_the_time_of_the_impact(
    kind, options, level
):
    def turned(t, q, v):
        return v[0] - level

    turned.direction = 1
    found = last_slopes(BOUNCING[kind], turned, ["q.b", "v.b"], **options)
    speed = np.sqrt(2.0 * 9.81 * 0.5)  # (h, v): position 0, speed e (v^2 + 2 g h)^(1/2) after it
    np.testing.assert_allclose(found["q.b"], (0.0, 0.5 * 9.81 / speed, 1.0 / speed), atol=1e-6)
    np.testing.assert_allclose(found["v.b"], (0.0, 0.0, 1.0 / 9.81), atol=1e-6)


def test_the_last_frame_has_the_rates_of_the_steps():
    """A wide step is another motion than the exact one, of which runs have the differences."""

    def fast(t, q, v):
        return v[0] + 0.9

    fast.direction = 1

    def make(top=1.2, mass=1.0):
        arm = pg.Body(name="arm", axes=(0, 1, 0), com=(1, 0, 0), inertia=(0.01,) * 3, mass=mass,
                      q=[0.3], v=[1.5], limits=[(-1.0, top)], limit_restitution=(0.6,))  # fmt: skip
        push = pg.Torsion(name="s", body="arm", stiffness=3.0)
        return pg.Model(bodies=[arm], forces=[push])

    def end(**numbers):
        run = ended_by(make(**numbers), fast, method="moreau_jean", step=2e-2)
        return np.concatenate((run.q[-1], run.v[-1], run.t[-1:]))

    paths = {"bodies.arm.limits.0.1": ("top", 1.2), "bodies.arm.mass": ("mass", 1.0)}
    found = last_slopes(make(), fast, list(paths), method="moreau_jean", step=2e-2)
    for path, (name, at) in paths.items():
        slope = (end(**{name: at + 1e-5}) - end(**{name: at - 1e-5})) / 2e-5
        np.testing.assert_allclose(found[path], slope, atol=1e-4 * np.abs(slope).max())


STEPPED = {"method": "moreau_jean", "step": 1e-2}


@pytest.mark.parametrize("options", [STEPPED, {"method": "rk4", "step": 1e-2}, {}])
def test_an_event_that_touches_zero_or_jumps_ends_derivatives(options):
    thrown = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), v=(1.0,), limits=((-9.0, None),))
    model = pg.Model(bodies=(thrown,), gravity=(0, 0, -10))

    def highest(t, q, v):
        return q[0] - 0.05

    def sign(t, q, v):
        return 1.0 if q[0] > 0.03 else -1.0

    for event in (highest, sign) if options is STEPPED else (sign,):
        run = ended_by(model, event, ["v.b"], **options)
        assert np.isnan(run.sensitivity("v.b")[-1]).all()
        assert any("derivatives end" in text for text in run.notices)


def test_an_event_after_the_end_of_derivatives_is_not_evaluated_at_nan():
    contact = pg.Contact(name="c", body="b", points=((0, 0, 0),), restitution=0.5, friction=0.0)
    model = pg.Model(bodies=(FALLING.model_copy(update={"limits": None}),), contacts=(contact,))
    landed = np.sqrt(2.0 * 0.5 / 9.81)
    for after in (0.1, 0.5, 1.1, 2.0):  # steps after the impact
        rise = 0.5 * 9.81 * landed * 0.01 * after - 0.5 * 9.81 * (0.01 * after) ** 2

        def up(t, q, v, rise=rise):
            return q[0] - rise

        up.terminal, up.direction = True, 1
        run = pg.simulate(
            model, t_end=1.0, events=[up], wrt=["q.b"], method="moreau_jean", step=0.01
        )
        assert run.status == pg.Status.STOPPED
