"""Conflicts: constraints that drive bodies against contacts and limits end a run, and no others do.

A run ends where no velocities satisfy what touches, with the names of the bodies and the time. What
merely needs large forces goes on.
"""

import numpy as np
import pytest

import pgraph_core as pg

from ..refusals import assert_names

START, SPEED = 0.1, 0.3  # m between the press and what it reaches, m/s


def box(name="b", size=0.1, **fields):
    return pg.Body(
        name=name, joint="free", mass=0.2, shape={"kind": "box", "size": (size,) * 3},
        derived=("inertia",), **fields,
    )  # fmt: skip


def press(height, speed=SPEED, own=None, **shape):
    """A plate above the given height with its `own` fields, and the motion that lowers it."""
    shape = shape or {"kind": "box", "size": (0.3, 0.3, 0.05)}
    half = shape["radius"] if "radius" in shape else shape["size"][2] / 2
    fields = {"link": (0, 0, height + START + half), "v": (-speed,), "shape": shape, **(own or {})}
    plate = pg.Body(name="p", joint="prismatic", axes=[(0, 0, 1)], **fields)
    motion = pg.Motion(name="m", body="p", q_of_t=pg.Polynomial(coefficients=(0, -speed)))
    return plate, motion


def stack(count, floor="ground", **shape):
    """A press above a stack of boxes, on the ground or on a slab that is welded to it."""
    size, bodies, contacts = 0.1, [], []
    below = floor
    for k in range(count):
        bodies.append(box(f"b{k}", size, link=(0, 0, size * (k + 0.5))))
        contacts.append(pg.Contact(name=f"c{k}", body=f"b{k}", other=below))
        below = f"b{k}"
    plate, motion = press(count * size, **shape)
    if floor != "ground":
        slab = {"kind": "box", "size": (1, 1, 0.1)}
        bodies.append(pg.Body(name=floor, joint="weld", link=(0, 0, -0.05), shape=slab))
    contacts.append(pg.Contact(name="top", body=below, other="p"))
    return pg.Model(bodies=[*bodies, plate], constraints=[motion], contacts=contacts)


def assert_stopped(run, t, *names, late=1e-5):
    assert run.status is pg.Status.CANNOT_CLOSE, (run.status, run.notices)
    for name in names:
        assert name in run.message
    assert run.t[-1] <= t + late
    assert run.t[-1] > t - 0.02  # what was computed until then is kept
    assert np.abs(run.q).max() < 10.0
    time = float(run.message.split("t = ")[1].split(" s")[0])
    assert abs(time - t) < late


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("floor", ["ground", "slab"])
def test_a_press_that_reaches_a_box_on_the_ground_ends_with_both_names(step, floor):
    run = pg.simulate(stack(1, floor), t_end=0.36, step=step, estimate=False, frames=30)
    t = START / SPEED
    names = ("'m'", "'p'", "'b0'", "'top'", "'c0'", "the ground" if floor == "ground" else "'slab'")
    late = step if step > 5e-3 else 2e-5  # impacts too slow for the step are not located
    assert_stopped(run, t, *names, late=late)
    assert "torque_limit" in run.message


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_press_above_several_boxes(count):
    run = pg.simulate(stack(count), t_end=0.4, estimate=False)
    assert_stopped(run, START / SPEED, "'m'", "'p'", "'top'", late=1e-4)


@pytest.mark.parametrize("speed", [0.1, 0.3, 20.0])
def test_a_round_press_at_any_speed(speed):
    plate = {"kind": "sphere", "radius": 0.05, "speed": speed}
    t = START / speed
    run = pg.simulate(stack(1, **plate), t_end=1.2 * t, step=t / 300, estimate=False)
    assert_stopped(run, t, "'m'", "'p'", "'b0'", late=1e-3 * t)


def test_a_pusher_presses_a_box_against_a_wall():
    pusher = pg.Body(
        name="p", joint="prismatic", axes=[(1, 0, 0)], link=(-0.4, 0, 0.05), v=(0.3,),
        shape={"kind": "box", "size": (0.1, 0.1, 0.05)},
    )  # fmt: skip
    wall = pg.Body(
        name="w", joint="weld", link=(0.35, 0, 0.5), shape={"kind": "box", "size": (0.1, 1, 1)}
    )
    motion = pg.Motion(name="m", body="p", q_of_t=pg.Polynomial(coefficients=(0, 0.3)))
    contacts = [
        pg.Contact(name="f", body="b"), pg.Contact(name="c", body="b", other="p"),
        pg.Contact(name="w", body="b", other="w"),
    ]  # fmt: skip
    model = pg.Model(
        bodies=[pusher, box(link=(0, 0, 0.05)), wall], constraints=[motion], contacts=contacts
    )
    run = pg.simulate(model, t_end=2.5, estimate=False)
    assert_stopped(run, 0.55 / 0.3, "'m'", "'b'", "'w'", late=2e-3)


@pytest.mark.parametrize("how", [{}, {"rtol": 1e-8}, {"method": "rk4", "step": 1e-3}], ids=str)
def test_a_motion_beyond_a_limit(how):
    arm = pg.Body(name="arm", axes=(0, 0, 1), inertia=(0.1,) * 3, v=(1.0,), limits=[(-1.0, 0.25)])
    motion = pg.Motion(name="m", body="arm", q_of_t=pg.Polynomial(coefficients=(0, 1.0)))
    run = pg.simulate(pg.Model(bodies=[arm], constraints=[motion]), t_end=0.5, **how)
    assert run.status is pg.Status.CANNOT_CLOSE
    assert run.t[-1] < 0.2501
    for name in ("'m'", "'arm'", "limit"):
        assert name in run.message


@pytest.mark.parametrize("how", [{}, {"rtol": 1e-8}, {"method": "rk4", "step": 1e-3}], ids=str)
def test_a_motion_into_the_ground(how):
    foot = pg.Body(
        name="foot", joint="prismatic", axes=[(0, 0, 1)], mass=1.0, link=(0, 0, 0.3), v=(-1.0,),
        shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    motion = pg.Motion(name="m", body="foot", q_of_t=pg.Polynomial(coefficients=(0, -1.0)))
    contact = pg.Contact(name="c", body="foot", restitution=0.5)
    model = pg.Model(bodies=[foot], constraints=[motion], contacts=[contact])
    run = pg.simulate(model, t_end=0.5, **how)
    assert run.status is pg.Status.CANNOT_CLOSE
    assert run.t[-1] < 0.2001
    for name in ("'m'", "'foot'", "'c'", "the ground"):
        assert name in run.message


def test_steppers_stop_there_too():
    stepper = pg.Stepper(stack(1), step=1e-3)
    while stepper.t < 0.4 and stepper.step() is pg.Status.DONE:
        pass
    assert stepper.status is pg.Status.CANNOT_CLOSE
    assert "'m'" in stepper.message
    assert stepper.t == pytest.approx(START / SPEED, abs=2e-3)


# -- no false alarms ------------------------------------------------------------------------------


@pytest.mark.parametrize("force", [1e2, 1e5])
def test_a_strong_servo_may_press(force):
    plate, _ = press(0.1, own={"mass": 1.0, "v": (0.0,)})
    servo = pg.Servo(name="s", body="p", kp=1e7, kd=1e4, target=-0.3, torque_limit=force)
    contacts = [pg.Contact(name="f", body="b"), pg.Contact(name="c", body="b", other="p")]
    model = pg.Model(
        bodies=[plate, box(link=(0, 0, 0.05))], forces=[servo],
        contacts=contacts,
    )  # fmt: skip
    run = pg.simulate(model, t_end=0.3, step=1e-3, estimate=False)
    assert run.status is pg.Status.DONE, run.message


@pytest.mark.parametrize("tilt", [0.5, 0.1, 1e-3])
def test_a_wedge_that_can_slide_out_goes_on(tilt):
    """A press with an oblique face pushes a box aside, the faster the flatter it is."""
    turn = (float(np.cos(tilt / 2)), 0.0, float(np.sin(tilt / 2)), 0.0)
    shape = pg.Shape(kind="box", size=(0.6, 0.3, 0.05), rotation=turn)
    plate, motion = press(0.1 + 0.3 * np.sin(tilt), own={"shape": shape})
    contacts = [pg.Contact(name="f", body="b"), pg.Contact(name="c", body="b", other="p")]
    model = pg.Model(
        bodies=[plate, box(link=(0, 0, 0.05))], constraints=[motion],
        contacts=contacts,
    )  # fmt: skip
    t_end = START / SPEED + 0.05 * tilt
    run = pg.simulate(model, t_end=t_end, step=1e-4, estimate=False)
    assert run.status is pg.Status.DONE, run.message


@pytest.mark.parametrize("step", [1e-2, 1e-3, 3e-4])
def test_a_motion_that_ends_at_a_touch_is_no_conflict(step):
    """A press that slows down and stops on the box, and a joint that just reaches a limit."""
    plate, _ = press(0.1, own={"v": (0.0,)})
    soft = pg.Motion(name="m", body="p", q_of_t=pg.Sine(mean=-START / 2, amplitude=START / 2,
                     frequency=np.pi, phase=np.pi / 2))  # fmt: skip
    contacts = [pg.Contact(name="f", body="b"), pg.Contact(name="c", body="b", other="p")]
    model = pg.Model(
        bodies=[plate, box(link=(0, 0, 0.05))], constraints=[soft],
        contacts=contacts,
    )  # fmt: skip
    run = pg.simulate(model, t_end=2.0, step=step, estimate=False)
    assert run.status is pg.Status.DONE, run.message
    arm = pg.Body(name="arm", axes=(0, 0, 1), inertia=(0.1,) * 3, limits=[(-1.0, 0.5)], v=(1.0,))
    swing = pg.Motion(name="m", body="arm", q_of_t=pg.Sine(mean=0, amplitude=0.5, frequency=2.0))
    run = pg.simulate(
        pg.Model(bodies=[arm], constraints=[swing]), t_end=4.0, step=step, estimate=False
    )
    assert run.status is pg.Status.DONE, run.message


@pytest.mark.quick
@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_a_motion_that_stops_at_a_touch_is_told_of_its_impulse_only(law):
    """The work of the impulse is missing from the energies, which no step and no tolerance mends.
    The force of the touch is rounding, and so is its error.
    """
    body = pg.Body(
        "b", joint="prismatic", axes=(0, 0, 1), mass=1.0, inertia=(0.01,) * 3, q=0.3, v=-0.4,
        shape=pg.Shape("sphere", radius=0.1),
    )  # fmt: skip
    stop = pg.Motion(name="m", body="b", q_of_t="=max(0.3-0.4*t,0.1)")
    contact = pg.Contact("c", body="b", law=law)
    run = pg.simulate(pg.Model([body], constraints=[stop], contacts=[contact]), t_end=1, rtol=1e-6)
    assert run.status is pg.Status.DONE
    impulse, balance = run.notices
    assert_names(impulse, "'m'", "0.4", "0.5 s", "not in the energies")
    assert_names(balance, "energy balance", "impulses named above")
    assert not any(word in text for text in run.notices for word in ("smaller", "a step"))


def test_a_box_that_two_motions_carry_together_goes_on():
    jaws = [
        pg.Body(
            name=n, joint="prismatic", axes=[(0, 1, 0)], link=(x, 0, 0.5), v=(0.3,),
            shape={"kind": "box", "size": (0.1, 0.1, 0.1)},
        )
        for n, x in (("l", -0.1), ("r", 0.1))
    ]  # fmt: skip
    lift = [
        pg.Motion(name=f"m{n}", body=n, q_of_t=pg.Polynomial(coefficients=(0, 0.3)))
        for n in ("l", "r")
    ]
    contacts = [pg.Contact(name=n, body="b", other=n, friction=0.5) for n in ("l", "r")]
    model = pg.Model(
        bodies=[*jaws, box(link=(0, 0, 0.5), v=(0, 0, 0, 0, 0.3, 0))], constraints=lift,
        contacts=contacts, gravity=(0, 0, 0),
    )  # fmt: skip
    run = pg.simulate(model, t_end=1.0, estimate=False)
    assert run.status is pg.Status.DONE, run.message


@pytest.mark.parametrize("step", [1e-3, 1e-4])
@pytest.mark.parametrize("every", [True, False])
def test_a_contact_of_bodies_that_a_constraint_fastens_is_named_with_a_remedy(every, step):
    """The two overlap, so that the weld and the contact cannot both hold."""
    bar = {"kind": "box", "size": (0.4, 0.04, 0.06), "position": (0.2, 0, 0)}
    turned = (np.cos(np.pi / 18), 0, 0, np.sin(np.pi / 18))
    bodies = [
        pg.Body("a", joint="spherical", link=(2, 0, 1), shape=bar, mass=1.0, inertia=(0.1,) * 3),
        pg.Body("b", joint="free", shape=bar, q=(2.4, 0, 1, *turned), mass=1.0, inertia=(0.1,) * 3),
    ]
    contact = {"body": "*", "other": "*"} if every else {"body": "a", "other": "b"}
    weld = pg.Constraint(kind="weld", name="w", body="b", other="a")
    model = pg.Model(bodies, constraints=[weld], contacts=[pg.Contact("touch", **contact)])
    run = pg.simulate(model, t_end=0.05, step=step, estimate=False)
    said = " ".join((*run.notices, run.message))
    assert_names(said, "'w' fastens 'b' to 'a'", "contact 'touch'")
    assert "rtol" not in said
    assert "servo" not in said
    remedy = "active=False" if every else "remove contact 'touch'"
    assert remedy in said
    off = pg.Contact("b and a", body="b", other="a", active=False)
    mended = model.add(off) if every else model.remove("touch")
    found = pg.simulate(mended, t_end=0.05, step=step, estimate=False)
    assert found.status.ok
    assert not found.notices
