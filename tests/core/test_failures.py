"""Runs that fail at once, absurd numbers, and models in which nothing moves."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, on_ground


def hinge(**fields):
    return pg.Model(bodies=(pg.Body(name="b", mass=1.0, com=(1, 0, 0), **fields),))


def test_a_velocity_that_overflows_at_the_start_keeps_its_first_frame():
    run = pg.simulate(hinge(axes=((0, 1, 0),), q=(0.2,)), t_end=1.0, v=np.array([1e200]))
    assert len(run.t) >= 1
    assert run.q[0, 0] == 0.2


@pytest.mark.parametrize("fields", [{"mass": 1e308}, {"com": (1e200, 0, 0)}, {"tip": (0, 1e90, 0)}])
def test_absurd_sizes_are_refused_by_the_body(fields):
    body = pg.Body(name="huge", **{"mass": 1.0, "com": (1, 0, 0), **fields})
    with pytest.raises(pg.InputError, match=r"body 'huge': .*mass, length or inertia"):
        pg.simulate(pg.Model(bodies=(body,)), t_end=1.0)
    with pytest.raises(pg.InputError, match="simulate, frames: "):
        pg.simulate(hinge(), t_end=1.0, frames=10**9)


LINE = {"kind": "polynomial", "coefficients": (0, 2)}
TO_TWO = {"name": "drive", "kind": "motion", "q_of_t": LINE}


def blamed(run, *names):
    named = [f"'{name}'" for name in ("drive", *names)]
    return any(all(name in text for name in named) for text in (*run.notices, run.message))


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-3}])
def test_a_motion_into_a_limit_names_both(options):
    """q = 2 t and a limit at 1 rad contradict each other from t = 0.5 s on."""
    body = pg.Body(name="b", mass=1.0, inertia=np.eye(3), limits=((-1.0, 1.0),))
    model = pg.Model(bodies=(body,), constraints=({"body": "b", **TO_TWO},))
    run = pg.simulate(model, t_end=1.0, **options)
    assert blamed(run, "b high limit", "b")
    assert run.t[np.searchsorted(run.t, 0.49)] < 0.52


@pytest.mark.parametrize(
    ("law", "options"),
    [("complementarity", {}), ("soft", {}), ("penalty", {}), ("soft", {"rtol": 1e-8})],
)
def test_a_motion_into_the_ground_names_both(law, options):
    driven = ball(place=(0, 0, 0.6), joint="prismatic", axes=(0, 0, -1))
    model = on_ground(driven, law=law, model={"constraints": ({"body": "b", **TO_TWO},)})
    assert blamed(pg.simulate(model, t_end=1.0, **options), "floor", "b")


def test_limits_that_hold_are_not_noticed():
    body = pg.Body(name="b", mass=1.0, com=(1, 0, 0), axes=((0, 1, 0),), limits=((-0.5, 0.5),))
    drive = {"body": "b", **TO_TWO, "q_of_t": {"kind": "sine", "amplitude": 0.49}}
    for constraints in ((), (drive,)):
        model = pg.Model(bodies=(body,), constraints=constraints)
        for options in ({}, {"rtol": 1e-8}):
            run = pg.simulate(model, t_end=2.0, **options)
            assert run.status.ok
            assert not any("limit" in text for text in run.notices)


def test_a_model_in_which_nothing_moves_is_noticed():
    """A hinge about the vertical, the default, is noticed, but not one that hangs at rest."""
    still = pg.simulate(hinge(axes=((0, 0, 1),)), t_end=0.5)
    assert any("moves" in text for text in still.notices)
    (told,) = pg.simulate(
        hinge(axes=((0, 1, 0),)).edit("b", mass=0, inertia=(1, 1, 1)), t_end=0.5
    ).notices[-1:]
    assert "mass" in told
    hanging = pg.Body(name="b", mass=1.0, com=(0, 0, -1), axes=((0, 1, 0),))
    turning = hinge(axes=((0, 0, 1),), v=(1.0,))
    for model in (pg.Model(bodies=(hanging,)), turning, hinge(axes=((0, 1, 0),))):
        run = pg.simulate(model, t_end=0.5)
        assert not any("moves" in text for text in run.notices)


def test_a_start_in_degrees_is_noticed():
    """The start of a hinge, as an array and by name, but not of a slider."""
    model = hinge(axes=((0, 1, 0),))
    for q in ([90.0], {"b": 90}):
        run = pg.simulate(model, q=q, t_end=0.01)
        assert [text for text in run.notices if "np.radians(90)" in text and "'b'" in text]
        assert "np.radians(90)" in str(run)
    once = pg.simulate(model.edit("b", q=90.0), t_end=0.01).notices
    assert sum("np.radians(90)" in text for text in once) == 1
    far = pg.Body(name="s", joint="prismatic", axes=(1, 0, 0))
    for body, q in ((far, [90.0]), (model.bodies[0], [1.5]), (model.bodies[0], [31.4])):
        quiet = pg.simulate(pg.Model(bodies=[body]), q=q, t_end=0.01).notices
        assert not any("radians" in text for text in quiet)


def heavy_tip(count, ratio):
    """A chain whose last body has `ratio` times the mass of the others."""
    bodies = [
        pg.Body(
            name=f"b{k}", parent=f"b{k - 1}" if k else "ground", link=(float(k > 0), 0, 0),
            com=(1, 0, 0), axes=((0, 1, 0),), mass=ratio if k == count - 1 else 1.0,
            inertia=np.eye(3) * 0.01, q=(0.3,),
        )
        for k in range(count)
    ]  # fmt: skip
    return pg.Model(bodies=tuple(bodies))


@pytest.mark.parametrize(
    ("model", "options"),
    [
        (heavy_tip(8, 1e6), {"method": "dop853", "rtol": 1e-13}),
        (heavy_tip(5, 1e8), {"method": "dopri5", "rtol": 1e-13}),
        (
            pg.Model(bodies=(pg.Body(name="b", inertia=np.eye(3), stiffness=(1e14,), q=(0.1,)),)),
            {"method": "dop853"},
        ),
    ],
)
def test_a_run_that_crawls_says_so_early_and_proposes_a_setting(
    model: pg.Model, options: dict[str, Any]
):
    with pytest.warns(UserWarning, match="rtol"):
        run = pg.simulate(model, t_end=100.0, max_steps=20_000, frames=11, **options)
    assert not run.status.ok
    (text,) = (text for text in run.notices if "in all" in text)
    assert "radau5" in text


def test_a_run_whose_progress_is_followed_warns_nobody(recwarn):
    """A stability map follows its reference run, whose tolerance its caller has not given."""
    options = {"method": "dop853", "rtol": 1e-13, "max_steps": 20_000, "frames": 11}
    run = pg.simulate(heavy_tip(8, 1e6), t_end=100.0, progress=lambda _: None, **options)
    assert any("in all" in text for text in run.notices)
    assert not recwarn.list


@pytest.mark.parametrize("ratio", [1.0, 1e6])
def test_a_run_of_reasonable_steps_is_not_called_slow(ratio, recwarn):
    run = pg.simulate(heavy_tip(4, ratio), t_end=5.0, rtol=1e-8, estimate=False)
    assert run.status.ok
    assert not any("in all" in text for text in run.notices)
    assert not recwarn.list
