"""The first frame of time stepping has the forces of the step that begins there."""

import numpy as np
import pytest

import pgraph_core as pg

G = 9.81
SHAPES = {
    "box": {"kind": "box", "size": (0.2, 0.2, 0.2)},
    "ball": {"kind": "sphere", "radius": 0.1},
    "cylinder": {"kind": "cylinder", "radius": 0.1, "length": 0.2},
}


def resting(shape, height=0.1, speed=0.0, **more):
    body = pg.Body(
        name="b", joint="free", q=(0, 0, height, 1, 0, 0, 0), v=(0, 0, 0, 0, 0, speed),
        shape=SHAPES[shape], derived=("inertia",),
    )  # fmt: skip
    return pg.Model(
        bodies=[body], contacts=[pg.Contact(name="c", body="b", **more)],
        sites=[pg.Site(name="imu", body="b")],
        outputs=[pg.Output(name="acc", kind="accelerometer", at="imu")],
    )  # fmt: skip


@pytest.mark.parametrize("step", [None, 1e-2, 1e-4])
@pytest.mark.parametrize("shape", SHAPES)
def test_an_accelerometer_at_rest_begins_with_gravity(shape, step):
    run = pg.simulate(resting(shape), t_end=0.05, step=step, estimate=False)
    assert abs(run.outputs["acc"] - (0, 0, G)).max() < 1e-6 * G
    assert run.contact_force["c"][0, 5] == pytest.approx(G, rel=1e-6)
    assert run.vdot[0] == pytest.approx(0.0, abs=1e-6)


def test_a_body_that_slides_begins_with_its_friction():
    model = resting("box", friction=0.3)
    run = pg.simulate(model, v=(0, 0, 0, 1.0, 0, 0), t_end=0.05, estimate=False)
    assert run.contact_force["c"][0, 3:] == pytest.approx((-0.3 * G, 0, G), rel=1e-6)


@pytest.mark.parametrize("height", [0.5, 0.1 + 1e-4])
def test_a_body_that_falls_begins_without_force(height):
    """What hits within the first step is left to its end."""
    run = pg.simulate(resting("ball", height, speed=-1.0), t_end=0.05, step=1e-3, estimate=False)
    assert run.outputs["acc"][0] == pytest.approx(np.zeros(3), abs=1e-12)


def test_the_first_forces_change_nothing_after_them():
    """The rehearsal leaves no trace: runs that go on from a later frame's state agree."""
    model = resting("cylinder", friction=0.3)
    run = pg.simulate(model, v=(0, 0, 1.0, 1.0, 0, 0), t_end=0.02, step=1e-3, estimate=False)
    assert run.counters["steps"] == 20
    assert len(run.t) == len(run.contact_force["c"])
