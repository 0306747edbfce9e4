"""Time stepping is of second order between events, whatever the speed and the step."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

FAINT = 1e-9  # N m: joint friction that selects time stepping, and moves nothing notable
INERTIA = (0.02, 0.03, 0.025)


def body(name: str, joint: Any = "revolute", **fields: Any) -> pg.Body:
    """A link of a mechanism."""
    given = {"mass": 1.0, "com": (0.02, 0.0, -0.25), "inertia": INERTIA, **fields}
    if joint in {"revolute", "prismatic"}:
        given.setdefault("axes", (0, 1, 0))
    return pg.Body(name=name, joint=joint, **given)


def double_pendulum(friction: float = FAINT) -> tuple[pg.Model, dict[str, Any]]:
    two = pg.Model.serial(2)
    for one in two.bodies:
        two = two.edit(one.name, friction=(friction,))
    return two, {"q": [1.0, 0.5]}


def with_limit() -> tuple[pg.Model, dict[str, Any]]:
    """A limit that is not reached."""
    two, start = double_pendulum()
    return two.edit(two.bodies[1].name, limits=((-2.5, 2.5),)), start


def beside_a_box() -> tuple[pg.Model, dict[str, Any]]:
    """A box at rest far from it."""
    two, _ = double_pendulum()
    box = pg.Body(
        name="box", joint="free", mass=1.0, link=(5, 0, 0.05),
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.1)),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="box", friction=0.5)
    names = [one.name for one in two.bodies]
    model = pg.Model(bodies=[*two.bodies, box], contacts=[floor])
    return model, {"q": dict(zip(names, (1.0, 0.5)))}


def arm() -> tuple[pg.Model, dict[str, Any]]:
    """Springs and dampers in joints, which a step takes implicitly."""
    model = pg.Model(
        bodies=[
            body("a", damping=(0.4,), friction=(FAINT,)),
            body("b", parent="a", link=(0, 0, -0.5), stiffness=(30.0,), damping=(0.2,)),
            body("c", parent="b", link=(0, 0, -0.4), axes=(1, 0, 0)),
        ]
    )
    return model, {"q": [0.3, 0.6, 0.2], "v": [1.0, 0.0, 3.0]}


def floating() -> tuple[pg.Model, dict[str, Any]]:
    """A tree in flight, with a ball joint."""
    model = pg.Model(
        bodies=[
            body("a", "free", com=(0.1, 0, 0.05)),
            body("b", parent="a", link=(0.2, 0, 0), friction=(FAINT,)),
            body("c", "ball", parent="b", link=(0.2, 0, 0), com=(0.1, 0.1, 0.1)),
        ]
    )
    return model, {"v": [1.0, 2.0, 3.0, 0.5, 0, 1, 2.0, 1, -1, 2]}


def loop() -> tuple[pg.Model, dict[str, Any]]:
    """A four-bar linkage whose coupler is a rod, with rows that turn within a step."""
    model = pg.Model(
        bodies=[body("a", friction=(FAINT,)), body("b", link=(0.8, 0, 0))],
        constraints=[
            pg.Distance(
                name="rod", body="a", point=(0, 0, -0.5), other="b", other_point=(0, 0, -0.7),
                length=float(np.hypot(0.8, 0.2)),
            )
        ],
    )  # fmt: skip
    return model, {"v": [3.0, 3.0 * 5 / 7]}


def dragged() -> tuple[pg.Model, dict[str, Any]]:
    """A force of the velocity of bodies."""
    two, start = double_pendulum()
    drag = pg.Drag(name="oil", body=two.bodies[1].name, size=(0.1, 0.1, 0.5), viscosity=0.5)
    return two.replace(forces=(drag,)), start


SMOOTH = (double_pendulum, with_limit, beside_a_box, arm, floating, loop, dragged)


def errors(model: pg.Model, steps: tuple[float, ...], t_end: float, **start: Any) -> np.ndarray:
    """Largest error of a coordinate against an adaptive run without joint friction, by step."""
    t = np.linspace(0, t_end, 4)
    bare = model.replace(contacts=())
    for one in bare.bodies:
        bare = bare.edit(one.name, friction=None, limits=None)
    known = [one.name for one in model.bodies if one.name != "box"]
    exact = pg.simulate(bare, t_eval=t, t_end=t_end, rtol=1e-12, **start)
    found = []
    for step in steps:
        run = pg.simulate(
            model, t_eval=t, t_end=t_end, step=step, method="moreau_jean", estimate=False, **start
        )
        found.append(max(np.abs(run[name] - exact[name]).max() for name in known))
    return np.array(found)


@pytest.mark.parametrize("made", SMOOTH, ids=lambda f: f.__name__)
def test_the_error_falls_with_the_square_of_the_step(
    made: Callable[[], tuple[pg.Model, dict[str, Any]]],
) -> None:
    """From turns of bodies in a step above the threshold of the implicit rule to far below it.

    The constants of the two rules differ by up to 3.
    """
    model, start = made()
    steps = (1e-2, 2e-3, 4e-4, 1e-4)
    error = errors(model, steps, 0.6, **start)
    orders = np.diff(np.log(error)) / np.diff(np.log(steps))
    assert (orders > (1.2, 1.9, 1.9)).all(), (error, orders)


def test_a_smaller_step_is_never_worse() -> None:
    """The error of a double pendulum falls from 20 ms to 0.1 ms, and is small at the default."""
    model, start = double_pendulum()
    steps = (2e-2, 1e-2, 5e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    error = errors(model, steps, 3.0, **start)
    assert (np.diff(error) < 0.0).all(), error
    assert error[5] < 0.0787 / 50  # a fiftieth of that of a rule of first order


def test_feet_on_the_ground_are_of_second_order() -> None:
    """A leg that stands on a point, and a ball whose centre of mass is not its centre, roll on."""
    knee, straight = 0.4, 0.4 * np.cos(0.4)
    leg = pg.Model(
        bodies=[
            body("hip", "free", q=(0, 0, 2 * straight, 1, 0, 0, 0), mass=4.0, com=(0, 0, 0)),
            body("thigh", parent="hip", q=knee, com=(0, 0, -0.2)),
            body("shin", parent="thigh", link=(0, 0, -0.4), q=-2 * knee, com=(0, 0, -0.2)),
        ],
        contacts=[pg.Contact(name="foot", body="shin", points=((0, 0, -0.4),), friction=3.0)],
    )
    ball = pg.Model(
        bodies=[
            body(
                "ball", "free", q=(0, 0, 0.1, 1, 0, 0, 0), com=(0.03, 0, 0.01),
                inertia=(0.004, 0.005, 0.006), shape=pg.Shape(kind="sphere", size=0.1),
            )
        ],
        contacts=[pg.Contact(name="floor", body="ball", friction=3.0)],
    )  # fmt: skip
    for model, v in ((leg, None), (ball, [0.0, 4.0, 2.0, 0.4, 0.0, 0.0])):
        ends = [
            pg.simulate(model, v=v, t_end=0.15, frames=2, step=0.15 / n, estimate=False).q[-1]
            for n in (30, 120, 480, 1920)
        ]
        apart = [np.abs(a - b).max() for a, b in pairwise(ends)]
        assert np.log(apart[0] / apart[2]) / np.log(16) > 1.8, apart


@pytest.mark.parametrize("stiffness", [1e2, 1e5, 1e9])
def test_stiff_drives_stay_calm(stiffness: float) -> None:
    """A servo of any stiffness brings its joint to the target, and does not ring."""
    servo = pg.Servo(name="s", body="a", kp=stiffness, kd=stiffness / 10, target=0.5)
    model = pg.Model(bodies=[body("a", friction=(1e-3,))], forces=[servo])
    run = pg.simulate(model, t_end=2.0, step=1e-2, method="moreau_jean", estimate=False)
    late = run.q[run.t > 1.0, 0]
    assert np.abs(late - 0.5).max() < 10.0 / stiffness + 1e-3
    assert np.ptp(late) < 1e-3
