"""Drives that are stronger than everything, against limits and against contacts."""

import re
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg


@pytest.mark.parametrize("kd", [0.0, 0.1])
@pytest.mark.parametrize("inertia", [1e-3, 1e-5])
@pytest.mark.parametrize("step", [None, 1e-4, 5e-3])
def test_a_servo_does_not_push_a_hinge_through_its_limit(inertia, kd, step):
    finger = pg.Body(
        name="finger", axes=(0, 0, 1), mass=0.05, inertia=np.eye(3) * inertia, limits=[(0, 1.5708)]
    )
    drive = pg.Servo(name="drive", body="finger", kp=100, kd=kd, target=12.217)
    model = pg.Model(bodies=[finger], forces=[drive])
    run = pg.simulate(model, t_end=0.2, step=step, method="moreau_jean", estimate=False)
    assert run["finger"].max() < 1.5708 * (1 + 1e-6)
    assert run["finger"][-1] == pytest.approx(1.5708, rel=1e-6)
    torque = run.contacts.limit["finger high limit"][-1]
    assert abs(torque) == pytest.approx(100 * (12.217 - 1.5708), rel=1e-3)


@pytest.mark.parametrize(("kp", "step"), [(1e6, 1e-3), (1e4, 5e-3), (1e2, 1e-3)])
def test_a_servo_does_not_push_a_slider_through_its_limit(kp, step):
    slide = pg.Body(name="s", joint="prismatic", axes=(1, 0, 0), mass=1.0, limits=[(-0.5, 0.5)])
    drive = pg.Servo(name="drive", body="s", kp=kp, kd=0.0, target=2.0)
    model = pg.Model(bodies=[slide], forces=[drive])
    run = pg.simulate(model, t_end=0.5, step=step, method="moreau_jean", estimate=False)
    assert abs(run["s"]).max() < 0.5 * (1 + 1e-6)
    assert run["s"][-1] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_a_falling_arm_does_not_pass_its_limits(friction, step):
    """What one joint's limit or friction does leads another joint towards its own."""
    arm = [
        pg.Body(
            name=f"b{n}", parent=f"b{n - 1}" if n else "ground", axes=(0, 1, 0), mass=1.0,
            link=(0.4, 0, 0) if n else (0, 0, 0), com=(0.2, 0, 0), inertia=np.eye(3) * 0.01,
            limits=((-0.5, 0.5),), limit_restitution=(0.3,), friction=(friction,), damping=(0.05,),
        )
        for n in range(3)
    ]  # fmt: skip
    run = pg.simulate(
        pg.Model(bodies=arm), t_end=5.0, step=step, method="moreau_jean", estimate=False
    )
    assert np.abs(run.q).max() < 0.5 + 1e-9
    assert np.abs(run.v[-1]).max() < 1e-3


def _crush(mass: float, step: float, t_end: float = 0.3, **parts: Any) -> pg.Result:
    """Return the run of a plate that is driven onto a box on the ground."""
    own = {"mass": mass, "derived": ("inertia",)}
    plate = pg.Body(
        name="plate", joint="prismatic", axes=(0, 0, 1), link=(0, 0, 0.5), mass=mass,
        shape=pg.Shape(kind="box", size=(1, 1, 0.1)),
    )  # fmt: skip
    box = pg.Body(
        name="box", joint="free", q=(0, 0, 0.1, 1, 0, 0, 0),
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.2)), **own,
    )  # fmt: skip
    touches = [pg.Contact(name="top", body="box", other="plate"), pg.Contact(name="g", body="box")]
    model = pg.Model(bodies=[plate, box], contacts=touches, **parts)
    return pg.simulate(model, t_end=t_end, step=step, estimate=False)


def _pressed(force: float, mass: float, step: float, kind: str) -> pg.Result:
    drive: Any = pg.Motor(name="drive", body="plate", torque=-force)
    if kind == "servo":
        drive = pg.Servo(
            name="drive", body="plate", kp=1e9, kd=1e6, target=-1.0, torque_limit=force
        )
    return _crush(mass, step, forces=[drive])


@pytest.mark.parametrize("kind", ["motor", "servo"])
@pytest.mark.parametrize(
    ("force", "mass", "step"), [(1e6, 1.0, 1e-3), (1e3, 1e-3, 1e-3), (1e7, 1e3, 1e-2)]
)
def test_a_drive_too_strong_for_contacts_is_named_with_remedies_that_help(force, mass, step, kind):
    run = _pressed(force, mass, step, kind)
    assert run["plate"][-1] < -0.5  # through the box
    text = " ".join(run.notices)
    assert "'drive' moves 'plate'" in text
    found = re.search(r"of 'drive' to (\S+) N, or use a step of (\S+) s", text)
    assert found is not None
    weaker, finer = (float(x) for x in found.groups())
    for held in (_pressed(weaker, mass, step, kind), _pressed(force, mass, finer, kind)):
        assert held["plate"].min() > -0.26  # it lies on the box, 0.25 m below its start
        assert "'drive'" not in " ".join(held.notices)


@pytest.mark.parametrize(
    "course", [pg.Table(t=[0, 0.55], value=[0, -0.3]), pg.Polynomial(coefficients=[0, -0.6])]
)
def test_a_motion_that_crushes_a_box_is_named_where_the_box_rebounds(course):
    motion = pg.Motion(name="drive", body="plate", q_of_t=course)
    run = _crush(1.0, 1e-3, 0.55, constraints=[motion])
    assert run.status is pg.Status.CANNOT_CLOSE
    assert "'drive' drives 'plate' against 'box' (contact 'top')" in run.message
    assert "'box' against the ground (contact 'g')" in run.message
