"""Derivatives by every number of every kind of part, against differences of the same steps.

One small scene a kind has the part with its defaults, another with numbers of all its fields.
"""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.simulation.paths import Path

from .test_gradients import state

HELD = {"method": "rk4", "step": 2e-3, "t_end": 0.3, "frames": 4, "estimate": False}
CLOSE = 1e-5  # of the largest derivative. Differences over 2e-5 are good to about 1e-8
MOVING = 1e-2  # by times at which slopes jump: a first order error of steps, which end there
TABLE = pg.Table(t=[0.0, 0.1, 0.4], value=[0.3, 0.9, 0.2])


def arm(name="r", **fields):
    given = {"axes": (0, 1, 0), "mass": 1.2, "com": (0.3, 0.02, -0.1), "q": (0.4,), "v": (2.5,)}
    return pg.Body(name=name, inertia=(0.05, 0.06, 0.02), **given | fields)


ARMS = arm(), arm("k", parent="r", link=(0.5, 0, 0), axes=(0.6, 0.8, 0), q=(0.3,), v=(3.0,))
SUM = {"r": [1.0], "k": [0.7]}
PLACED = {"body": "k", "point": (0.2, 0.1, 0), "other_point": (0.1, 0, -0.6)}
VIA = [{"body": "r", "point": (0.3, 0.1, 0.2)}, {"body": "ground", "point": (0.4, -0.2, 0.3)}]
LATE = {"lag": 0.05, "start": 0.1, "torque_limit": 50.0, "gear": 1.7, "torque": 0.3}
PARTS = {
    "motor": pg.Motor(name="x", body="r", torque=2.0),
    "motor of a sum": pg.Motor(name="x", torque=2.0, coefficients={"r": [1.0], "k": [0.0]}),
    "motor with a lag": pg.Motor(name="x", body="r", **LATE),
    "motor of a table": pg.Motor(name="x", body="r", torque=TABLE),
    "servo": pg.Servo(name="x", body="r", target=1.0, kp=5.0, kd=0.3),
    "idle servo": pg.Servo(name="x", body="r", target=1.0),
    "servo with a lag": pg.Servo(name="x", body="k", target=0.5, kp=9.0, kd=0.2, **LATE),
    "speed servo": pg.SpeedServo(name="x", body="r", speed=1.0, kd=0.3),
    "actuator": pg.Actuator(name="x", body="r", input=1.0),
    "general actuator": pg.Actuator(
        name="x", body="r", input=1.0, gain=3.0, kp=2.0, kd=0.3, gear=2
    ),
    "tendon": pg.Tendon(name="x", coefficients={"r": [1.0], "k": [0.0]}, stiffness=5.0),
    "idle tendon": pg.Tendon(name="x", coefficients=SUM),
    "full tendon": pg.Tendon(
        name="x", coefficients=SUM, stiffness=1.0, damping=0.05, rest=0.2, friction=0.05
    ),
    "spring": pg.Spring(name="x", **PLACED, stiffness=40.0),
    "idle spring": pg.Spring(name="x", **PLACED, rest=0.2),
    "full spring": pg.Spring(name="x", **PLACED, stiffness=40.0, damping=1.5, rest=0.3),
    "spring over points": pg.Spring(name="x", **PLACED, stiffness=40.0, damping=1.5, via=VIA),
    "torsion": pg.Torsion(name="x", body="k", other="r", axis=(0.6, 0.8, 0), stiffness=3.0),
    "full torsion": pg.Torsion(
        name="x", body="k", axis=(0.5, 0.8, 0.1), stiffness=3.0, damping=0.2, rest=0.4
    ),
    "bushing": pg.Bushing(name="x", **PLACED, stiffness=np.diag([40, 30, 20, 3, 2, 1.0])),
    "drag": pg.Drag(name="x", body="k", size=(0.2, 0.3, 0.1), density=200.0),
    "full drag": pg.Drag(
        name="x", body="k", size=(0.2, 0.3, 0.1), density=200.0, viscosity=0.7, point=(0.1, 0.2, 0)
    ),
    "idle wrench": pg.Wrench(name="x", body="k", torque=(0, 0, 0)),
    "wrench": pg.Wrench(
        name="x", body="k", torque=(0, 0.1, 0), force=(1.0, 0, 2), point=(0.1, 0, 0)
    ),
    "strut": pg.Strut(name="x", **PLACED, spring=pg.Lines(x=[0.2, 0.5, 0.9], value=[-9, 2, 30.0])),
    "linear actuator": pg.LinearActuator(
        name="x", **PLACED, via=VIA, input=2.0, gain=3.0, bias=1.0, kp=5.0, kd=0.4
    ),
    "coupling": pg.Coupling(name="x", coefficients={"r": [1.0], "k": [0.0]}, value=0.4),
    "full coupling": pg.Coupling(name="x", coefficients=SUM, value=0.61),
    "velocity": pg.Velocity(name="x", coefficients={"r": [1.0], "k": [0.0]}, value=0.5),
    "motion": pg.Motion(name="x", body="k", q_of_t=pg.Sine(amplitude=0.2, frequency=0.5, mean=0.3)),
    "distance": pg.Distance(name="x", **PLACED),
    "plane": pg.Plane(name="x", body="k", point=(0.3, 0, 0), other_axis=(0.1, 0.2, 0.9)),
    "gear": pg.Gear(name="x", body="k", other="r", ratio=1.0, offset=-0.1),
    "polynomial relation": pg.Relation(
        name="x", body="k", other="r", curve=pg.Polynomial(coefficients=(-0.1, 0.8, 0.3))
    ),
    "periodic relation": pg.Relation(
        name="x",
        body="k",
        other="r",
        curve=pg.Curve(x=(-0.2, 0.1, 0.4, 1.1), value=(0.0, 0.1, 0.5, 1.4), kind="periodic"),
    ),
    "quintic relation": pg.Relation(
        name="x",
        body="k",
        other="r",
        curve=pg.Curve(x=(-0.2, 0.1, 0.4, 1.1), value=(0.0, 0.1, 0.5, 1.4), kind="quintic"),
    ),
    "cam": pg.Cam(
        name="x",
        body="k",
        other="r",
        distance=0.3,
        arm=0.25,
        base_radius=0.1,
        phase=0.05,
        motion=[{"lift": 0.4, "angle": 1.3}, {"lift": 0.0, "angle": 2.0}, {"lift": 0.0}],
    ),
    "cam by points": pg.Cam(
        name="x",
        body="k",
        other="r",
        distance=0.3,
        arm=0.25,
        base_radius=0.1,
        motion=pg.Curve(
            x=np.arange(6) * np.pi / 2.5, value=(0, 0.2, 0.3, 0.2, 0.1, 0), kind="periodic"
        ),
    ),
    "pid": pg.PID(name="x", signal="=q.r", setpoint=1.0, filter=0.05),
    "full pid": pg.PID(
        name="x", signal="=q.r", setpoint=1.0, kp=3.0, ki=2.0, kd=0.1, filter=0.05, start=0.2
    ),
    "filter": pg.Filter(name="x", input="=v.r", lag=0.1),
    "state": pg.State(name="x", rate="=1 - q.r"),
    "joint": {},
    "damped joint": {"damping": (0.2,)},
    "full joint": {"damping": (0.2,), "stiffness": (3.0,), "rest": (0.1,), "friction": (0.1,)},
}


def made(name):
    part, bodies = PARTS[name], ARMS
    if isinstance(part, pg.Cam):  # whose joints are side by side
        bodies = ARMS[0], arm("k", link=(0.3, 0, 0), v=(3.0,))
    if isinstance(part, dict):
        return pg.Model(bodies=[arm(**part), ARMS[1]])
    if isinstance(part, (pg.PID, pg.Filter, pg.State)):
        drive = pg.Motor(name="drive", body="r", torque="=x.x")
        return pg.Model(bodies=bodies, controls=[part], forces=[drive])
    kind = "constraints" if isinstance(part, pg.Constraint) else "forces"
    return pg.Model(bodies=bodies, **{kind: [part]})


def numbers_in(value, inside=()):
    """Yield the places of all numbers of a value."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return
    if isinstance(value, (int, float)):
        yield inside
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from numbers_in(entry, (*inside, key))
    elif isinstance(value, (tuple, list)):
        for n, entry in enumerate(value):
            yield from numbers_in(entry, (*inside, n))
    else:
        for field in getattr(type(value), "model_fields", ()):
            yield from numbers_in(getattr(value, field), (*inside, field))


def paths_of(model):
    """All paths of the part that a scene is about, which are numbers and have a derivative."""
    groups = ("controls", "forces", "constraints", "bodies")
    group = next(one for one in groups if getattr(model, one))
    part = getattr(model, group)[0]
    return [(group, part.name, *place) for place in numbers_in(part) if place != ("coordinate",)]


def difference(model, path):
    """Central differences, or those to one side at the end of what is allowed."""
    h = 2e-5 * (abs(path.present) or 1.0)

    def at(k):
        return state(pg.simulate(path.set(model, path.present + k * h), **HELD))

    for side, weights in (
        (1, {-1: -0.5, 1: 0.5}),
        (1, {0: -1.5, 1: 2.0, 2: -0.5}),
        (-1, {0: -1.5, 1: 2.0, 2: -0.5}),
    ):
        try:
            return side * sum(w * at(side * k) for k, w in weights.items()) / h
        except pg.PgraphError:
            continue
    return None


@pytest.mark.parametrize("name", PARTS)
def test_no_derivative_is_wrong_without_a_notice(name):
    model, found = made(name), []
    for given in paths_of(model):
        try:
            path = Path(model, given, "simulate")
            run = pg.simulate(model, wrt=[given], **HELD)
        except pg.PgraphError:
            continue  # says why
        expected = difference(model, path)
        if expected is None:
            continue
        slope, size = run.sensitivity(path.text), np.abs(expected).max()
        told = [text for text in run.notices if path.text in text]
        close = MOVING if given[-1] == "lag" or "t" in given else CLOSE
        wrong = not np.abs(slope - expected).max() <= close * max(size, 1e-3)
        if wrong and (not told or (size > 1e-6 and "no influence" in told[0])):
            found.append((path.text, slope[-1], expected[-1]))
    assert not found
