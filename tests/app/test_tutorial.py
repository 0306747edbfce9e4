"""A person's minute in a browser: docs/tutorial.md, a URDF with meshes whose loop is closed, an arm
that picks up a box."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

import pgraph_core as pg
from benchmarks.tutorial import ARM_STEPS, FILE_STEPS, STEPS, Person
from pgraph_app.playback.update import Pause
from pgraph_app.server import Server
from pgraph_core.rotation import matrix

from .conftest import NOBODY, until

BUDGET = 60.0  # [s]


def test_a_four_bar_from_new_to_play_takes_a_person_less_than_a_minute(page: Any, served: Server):
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    person = Person(page)
    for step in STEPS:
        person.think()
        step(person)
    until(lambda: served.store.state.playback.time > 0, "a picture that moves")
    served.send(Pause(NOBODY))
    page.get_by_role("tab", name="Properties").click()
    page.get_by_role("tab", name="Digraph").click()
    model, run = served.store.state.model, served.store.state.run
    assert [body.parent for body in model.bodies] == ["ground", "crank", "coupler"]
    assert [c.kind for c in model.constraints] == ["revolute"]
    assert model.body("coupler").q == (0.7,)
    assert run is not None
    result = run.result
    assert result.status.ok
    assert abs(result.q[-1] - result.q[0]).max() > 0.1  # it swings
    assert result.constraint_drift[:, 0].max() < 1e-6  # [m] the loop stays closed
    assert person.seconds < BUDGET


def test_a_urdf_with_meshes_is_closed_run_and_exported_in_less_than_a_minute(
    page: Any, served: Server
):
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    person = Person(page)
    with page.expect_download(timeout=200_000) as saved:
        for step in FILE_STEPS:
            person.think()
            step(person)
    served.send(Pause(NOBODY))
    headline = page.locator(".report .headline").inner_text()
    page.get_by_role("tab", name="Properties").click()
    page.get_by_role("tab", name="Digraph").click()
    model, run = served.store.state.model, served.store.state.run
    assert [b.shape.kind for b in model.bodies if b.shape] == ["mesh"] * 3
    (closed,) = model.constraints
    assert {closed.body, closed.other} == {"pin", "rocker"}
    assert headline.startswith("1 degree of freedom")
    assert run is not None
    assert run.result.status.ok
    assert run.result.constraint_drift[:, 0].max() < 1e-6  # [m] the loop stays closed
    assert abs(run.result.q[-1] - run.result.q[0]).max() > 0.1  # it swings
    assert saved.value.suggested_filename.endswith(".zip")  # with its meshes
    print(f"{person.seconds:.1f} s of a person's time")
    assert person.seconds < BUDGET


CLICKS, KEYS = 40, 60


def inertia_of(shape: pg.Shape, mass: float) -> np.ndarray:
    """(3, 3) of a solid box or capsule about its centre, in the body's axes [kg m²]."""
    if shape.kind == "box":
        a, b, c = np.square(shape.size)
        moments = mass / 12 * np.array([b + c, a + c, a + b])
    else:
        r, length = shape.radius, shape.length
        rod, ends = pi * r**2 * length, 4 / 3 * pi * r**3
        rod, ends = mass * rod / (rod + ends), mass * ends / (rod + ends)
        across = ends * (0.4 * r**2 + length**2 / 4 + 3 / 8 * length * r)
        across += rod * (r**2 / 4 + length**2 / 12)
        moments = np.array([across, across, rod * r**2 / 2 + 0.4 * ends * r**2])
    turn = matrix(shape.rotation)
    return turn @ np.diag(moments) @ turn.T


def test_an_arm_that_picks_up_a_box_takes_few_clicks_and_keys(page: Any, served: Server):
    """Issue 15: what is drawn is what is simulated, and the gripper lifts the box."""
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    person = Person(page)
    for step in ARM_STEPS:
        step(person)
    until(lambda: served.store.state.run is not None, "the run", seconds=300)
    served.send(Pause(NOBODY))
    page.get_by_role("tab", name="Digraph").click()
    model, run = served.store.state.model, served.store.state.run
    assert person.clicks <= CLICKS
    assert person.keys <= KEYS
    axes = [body.axes[0] for body in model.bodies if body.joint == "revolute"]
    assert axes == [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    for body in model.bodies:
        (shape,) = body.shapes
        assert np.allclose(body.com, shape.position, rtol=0, atol=1e-9)
        solid = inertia_of(shape, body.mass)
        assert np.allclose(body.inertia, solid, rtol=0, atol=1e-9 * np.abs(solid).max())
    assert run is not None
    assert run.result.status.ok
    box = run.result.body_pose[:, run.result.mechanism.names.index("7"), 2]
    assert box[0] == 0.025
    assert box[-1] > 0.2  # [m] lifted
    assert abs(run.result.contact_force["contact"][-1]).max() == 0  # off the ground
