"""What a call leaves out, or cannot know, is said where a newcomer meets it."""

import warnings
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..refusals import assert_names

pytestmark = pytest.mark.quick

SLIDER = pg.Body("a", joint="prismatic", axes=(1, 0, 0), mass=1.0)
TWO = pg.Model.serial(2)
TABLE = {"x": (0.0, 1.0), "value": (0.0, 100.0)}


def notices(force: pg.Force, q: float) -> str:
    model = pg.Model([SLIDER], gravity=0, forces=[force])
    return "\n".join(pg.simulate(model, q=[q], t_end=0.1).notices)


@pytest.mark.parametrize(
    ("force", "q", "said"),
    [
        (pg.Spring("s", "a", "ground", stiffness=100.0, rest=0.1), 0.0, True),
        (pg.Spring("s", "a", "ground", stiffness=100.0, rest=0.1, point=(2, 0, 0)), -2.0, True),
        (pg.Strut("s", "a", "ground", spring=TABLE), 0.0, True),
        (pg.Spring("s", "a", "ground", stiffness=100.0, rest=0.1), 1e-6, False),
        (pg.Spring("s", "a", "ground", stiffness=100.0, rest=0.0), 0.0, False),
        (pg.Spring("s", "a", "ground", stiffness=100.0), 0.0, False),  # at rest there
        (pg.Spring("s", "a", "ground", stiffness=100.0, other_point=(1, 0, 0)), 1.0, True),
    ],
)
def test_a_spring_or_strut_without_a_direction_at_the_start_is_named(force, q, said):
    assert ("'s'" in notices(force, q)) == said


@pytest.mark.parametrize(
    ("force", "said"),
    [
        (pg.Servo("s", "2", kp=5.0), True),
        (pg.Motor("s", "2", torque=1.0), True),
        (pg.Motor("s", "2", torque='=-2*v["2"]'), True),
        (pg.Motor("s", "2"), False),  # an input
        (pg.Torsion("s", "2", "1", stiffness=1.0), False),  # acts
    ],
)
@pytest.mark.parametrize("call", ["forward_dynamics", "constrained_dynamics"])
def test_dynamics_at_a_state_name_the_drives_that_they_leave_out_once(force, said, call):
    mech = pg.Mechanism(TWO.add(force))
    at_rest = np.zeros(2), np.zeros(2)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for _ in range(3):
            mech.inverse_dynamics(*at_rest, np.zeros(2))
            getattr(mech, call)(*at_rest)
    assert ["'s'" in str(one.message) for one in told] == [True] * said
    assert all(one.filename == __file__ for one in told)


def test_a_gradient_beyond_the_end_of_derivatives_says_why_there_is_none():
    """A box spins while it slides on four corners."""
    shape = pg.Shape("box", size=(0.2, 0.15, 0.4))
    body = pg.Body("b", joint="free", link=(0, 0, 0.2), shape=shape, v=(0, 0, 1.0, 1.0, 0, 0))
    model = pg.Model([body], contacts=[pg.Contact(body="b", friction=0.3, restitution=0.2)])
    given: dict[str, Any] = {"t_end": 0.02, "method": "moreau_jean", "step": 1e-3}
    run = pg.simulate(model, wrt=["v.b.1"], **given)
    assert any("derivatives end" in text for text in run.notices)
    with pytest.warns(UserWarning, match=r"v\.b\.1.*derivatives end"):
        assert np.isnan(run.gradient(lambda run: run.q[-1, 2])["v.b.1"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run.gradient(lambda run: run.v[0, 1])["v.b.1"] == pytest.approx(1.0)


def test_derivatives_by_a_state_far_from_the_constraints_name_the_remedy():
    model = pg.load("four_bar")
    mech = pg.Mechanism(model)
    path, far = f"q.{mech.names[0]}", mech.home()[0] + [0.3, 0.3, -0.3]
    run = pg.simulate(model, q=far, t_end=0.1, wrt=[path])
    assert any("mech.assemble(" in text for text in run.notices)
    near = pg.simulate(model, q=mech.assemble(far)[0], t_end=0.1, wrt=[path])
    assert not any("derivatives" in text for text in near.notices)


def test_the_error_of_a_joined_run_is_known_for_its_first_part_only():
    """Of a double pendulum that is pushed to and fro, errors of the start grow."""
    first = pg.simulate(TWO, q=[2.0, 0.0], t_end=2.0, rtol=1e-4)
    second = pg.simulate(TWO, first.q[-1], first.v[-1], t_start=2.0, t_end=4.0, rtol=1e-4)
    third = pg.simulate(TWO, second.q[-1], second.v[-1], t_start=4.0, t_end=5.0, rtol=1e-4)
    run = pg.joined([pg.joined([first, second]), third])
    n = len(first.t)
    np.testing.assert_array_equal(run.error_at[:n], first.error_at[:n])
    assert np.isinf(run.error_at[n:]).all()
    assert "2 s" in run.accuracy
    assert sum("joined" in text for text in run.notices) == 1
    assert pg.joined([first]).error_estimate == first.error_estimate
    silent = pg.simulate(TWO, t_end=2.0, estimate=False)
    assert np.isnan(pg.joined([silent, second]).error_estimate)


def test_a_derivative_without_a_filter_is_refused_with_a_usual_one():
    with pytest.raises(pg.ModelError, match=r"filter.*0\.025"):
        pg.PID("p", signal="=q.a", kp=2.0, kd=0.5)


def test_the_numbers_of_a_free_joint_are_named_where_they_do_not_fit():
    model = pg.Model([pg.Body("b", joint="free")])
    for given, form in (({"v": {"b": [1, 2, 3]}}, "angular"), ({"q": {"b": [1]}}, "w, x, y, z")):
        with pytest.raises(pg.InputError, match=form):
            pg.simulate(model, **given)


def test_a_drag_has_derivatives_where_the_body_is_at_rest_along_an_edge():
    """|u| u has the slope 0 at rest. The derivative of x = ln(1 + k v t) / k is by k."""
    model = pg.Model([SLIDER], gravity=0).add(pg.Drag("d", "a", size=(0.1, 0.1, 0.1), density=50.0))
    run = pg.simulate(model, v=[2.0], t_end=1.0, wrt=["forces.d.density"], rtol=1e-11)
    k = 0.5 * 50.0 * 0.01
    slope = 2.0 / (k * (1 + 2.0 * k)) - np.log(1 + 2.0 * k) / k**2
    found = run.sensitivity("forces.d.density")[-1, 0]
    assert found == pytest.approx(slope * k / 50.0, rel=1e-8)
    assert not run.notices


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-3}])
def test_a_mechanism_moved_at_the_start_is_said_with_and_without_a_contact(options):
    """The start of another body on the ground, or of a joint on its stop, changes nothing in it."""
    a = pg.Body("a", axes=(0, 1, 0), mass=1, com=(0.2, 0, 0), inertia=(0.02,) * 3, q=1.2, v=1)
    b = pg.Body("b", "a", link=(0.4, 0, 0), axes=(0, 1, 0), mass=1, inertia=(0.02,) * 3, q=-0.9)
    gear = pg.Gear(name="g", body="b", other="a", ratio=0.5)
    ball = pg.Body(
        "r", joint="prismatic", axes=(0, 0, 1), q=0.1, link=(5, 0, 0),
        shape=pg.Shape(kind="sphere", radius=0.1),
    )  # fmt: skip
    alone = pg.Model([a, b, ball], constraints=[gear])
    others = [
        alone.add(pg.Contact(name="c", body="r")), alone.edit("r", limits=((0.1, 1),)),
        alone.edit("b", limits=((-1, 0),)),  # beyond which the gear moves it
    ]  # fmt: skip
    start = pg.simulate(alone, t_end=0.01, estimate=False, **options)
    (said,) = start.notices
    assert_names(said, "start", "moved", "'b'", f"{abs(start['b'][0] + 0.9):.3g} rad")
    for model in others:
        run = pg.simulate(model, t_end=0.01, estimate=False, **options)
        assert said in run.notices
