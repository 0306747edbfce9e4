"""A person's minute in a browser: docs/tutorial.md, and a URDF with meshes whose loop is closed."""

from __future__ import annotations

from typing import Any

from benchmarks.tutorial import FILE_STEPS, STEPS, Person
from pgraph_app.playback.update import Pause
from pgraph_app.server import Server

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
