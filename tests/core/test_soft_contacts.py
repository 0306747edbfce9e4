"""Soft and penalty contacts: restitution, friction, energy, and steps that resolve them."""

from math import gamma
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.rotation import matrix

from ..nights import combined
from ..worlds import ball, box, on_ground

SHAPES = {
    "box": {"kind": "box", "size": (0.2, 0.3, 0.1)},
    "sphere": {"kind": "sphere", "radius": 0.1},
    "capsule": {"kind": "capsule", "radius": 0.08, "length": 0.2},
}


def drop(lower, upper, law, up="y", **options):
    middle = "xyz".index(up)
    links = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.02]])
    links[:, middle] = 0.25, 0.6
    bodies = [
        pg.Body(
            name=name, joint="free", link=link, mass=mass, inertia=mass * np.eye(3) * 0.01,
            shape=SHAPES[shape],
        )
        for name, link, mass, shape in zip("ab", links.tolist(), (2.0, 1.0), (lower, upper))
    ]  # fmt: skip
    contacts = (
        pg.Contact(name="floor", body="*", law=law),
        pg.Contact(name="pair", body="b", other="a", law=law),
    )
    model = pg.Model(bodies=tuple(bodies), up=up, contacts=contacts)
    return pg.simulate(pg.Mechanism(model), t_end=0.4, estimate=False, **options)


@pytest.mark.parametrize(
    ("lower", "upper", "up"), [("box", "capsule", "z"), ("sphere", "box", "y")]
)
def test_chosen_steps_close_the_ledger(lower, upper, up):
    run = drop(lower, upper, "soft", up)
    assert run.header["step"] is None
    assert run.status.ok
    assert run.energy_drift < 1e-6
    assert -1e-3 < min(gap.min() for gap in run.contact_gap.values()) < 0
    assert all("too coarse for the contact forces" in text for text in run.notices)
    run = drop(lower, upper, "soft", up, method="dop853", rtol=1e-6)  # steps that leap in
    assert run.status.ok
    assert run.energy_drift < 1e-3
    assert abs(run.v).max() < 20
    run = drop(lower, upper, "penalty", up)
    assert run.header["step"] < 2e-4
    assert run.energy_drift < 0.05


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_steps_that_do_not_resolve_a_contact_are_reported(law):
    """The state may blow up."""
    run = drop("sphere", "box", law, step=1e-3)
    assert any("rates" in text for text in run.notices)


@pytest.mark.parametrize("method", ["gauss6", "rk4", "semi_implicit_euler", "radau5"])
def test_steps_far_too_wide_for_a_contact_throw_nothing(method):
    """A ball of 4 t falls by 3 m. The first step that ends inside the contact threw it to 34 m by
    gauss6 and to 197 m by semi_implicit_euler."""
    shape = {"kind": "sphere", "radius": 0.5}
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), mass=4e3, q=(3.5,), shape=shape)
    hard = {"stiffness": 9.4e16, "damping": 0.013, "friction": 0.0}
    contact = pg.Contact(name="c", body="b", law="soft", **hard)
    model = pg.Model(bodies=[body], contacts=[contact])
    run = pg.simulate(model, t_end=4.0, method=method, step=0.01, frames=101)
    assert any("rates" in text for text in run.notices) == (method != "radau5")
    assert run.q.max() == 3.5
    assert run.dissipation.min() > -1e-3 * 4e3 * 9.81 * 3.0


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_the_energy_of_a_contact_at_the_start_is_no_gain(law):
    """The ledger books it as a negative dissipation when the contact opens."""
    shape = {"kind": "sphere", "radius": 0.5}
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), mass=4.0, q=(0.47,), shape=shape)
    contact = pg.Contact(name="c", body="b", law=law, stiffness=1e5, damping=0.3, friction=0.0)
    run = pg.simulate(pg.Model(bodies=[body], contacts=[contact]), t_end=0.3)
    assert run.dissipation.min() < -1.0
    assert not any("dissipation" in text for text in run.notices)


def two_balls(m, r, v, apart, law="soft", **fields):
    line = {"joint": "prismatic", "axes": ((1, 0, 0),), "shape": {"kind": "sphere", "radius": r}}
    one = pg.Body(name="a", mass=m[0], v=(v,), inertia=np.zeros((3, 3)), **line)
    two = pg.Body(name="b", mass=m[1], link=(apart, 0, 0), inertia=np.zeros((3, 3)), **line)
    hit = pg.Contact(name="c", body="a", other="b", law=law, **fields)
    return pg.Model(bodies=(one, two), gravity=(0, 0, 0), contacts=(hit,))


@pytest.mark.parametrize("given", [{"rtol": 1e-13}, {"rtol": 1e-7}, {"step": 1e-3}])
def test_a_step_ends_where_hard_soft_contacts_meet(given):
    """The first stages of DOP853 have no weight, so that those inside went unseen."""
    m, v = (5.708, 0.1213), 0.7706
    model = two_balls(m, 0.548, v, 14.944, damping=0.0)
    run = pg.simulate(model, t_end=30.0, method="dop853", estimate=False, **given)
    after = np.array([m[0] - m[1], 2 * m[0]]) / sum(m) * v  # of elastic balls
    np.testing.assert_allclose(run.v[-1], after, rtol=1e-5)


@pytest.mark.parametrize(("law", "speed"), [("soft", 1000.0), ("penalty", 1.0)])
def test_balls_that_meet_after_10_m_have_their_restitution(law, speed):
    model = two_balls((1.0, 1.0), 0.01, speed, 10.02, law, restitution=0.5)
    run = pg.simulate(model, t_end=12 / speed, estimate=False)
    np.testing.assert_allclose(run.v[-1], [0.25 * speed, 0.75 * speed], rtol=0.01)


def test_runs_that_agree_by_chance_do_not_make_a_small_estimate():
    """Errors of steps that a contact begins or ends in are not smooth in the tolerance."""
    m, v, r, gap = (0.06462, 728.2), 3.745e5, 8.562e4, 1.259e6
    deep, mass = 0.002971 * r, 1 / sum(1 / m for m in m)
    lasts = 2 * np.sqrt(np.pi) * gamma(1.4) / gamma(0.9) * deep / v  # Hertz
    model = two_balls(m, r, v, 2 * r + gap, damping=0.0, stiffness=1.25 * mass * v**2 / deep**2.5)
    leaves = gap + m[0] / sum(m) * v * lasts  # the ball's place when it leaves, and its speed
    back = v * (m[0] - m[1]) / sum(m)
    for rtol in 10.0 ** np.arange(-5.0, -4.0, 0.25):
        run = pg.simulate(model, t_end=14.1, method="dopri5", rtol=rtol, frames=11)
        error = abs(run.q[-1, 0] - leaves - back * (14.1 - gap / v - lasts))
        assert 0.0 < error < 10 * run.error_estimate


def test_penalty_friction_does_not_brake_a_rolling_ball():
    rolls = ball(v=(0, 10.0, 0, 1.0, 0, 0))
    run = pg.simulate(on_ground(rolls, law="penalty", friction=0.5), t_end=0.2, estimate=False)
    assert run.v[-1, 3] == pytest.approx(1.0, abs=1e-3)
    assert run.v[-1, 1] == pytest.approx(10.0, abs=1e-2)


def test_penalty_friction_holds_a_gripped_cube():
    cube = box("cube", (0, 0, 0), (0.1, 0.1, 0.1))
    bodies, contacts, forces = [cube], [], []
    for name, way in (("left", -1), ("right", 1)):
        slides = {"joint": "prismatic", "axes": (1, 0, 0), "mass": 0.2}
        bodies.append(box(name, (way * 0.06, 0, 0), (0.02, 0.06, 0.06), **slides))
        contacts.append(pg.Contact(name=name, body="cube", other=name, friction=0.5, law="penalty"))
        forces.append(pg.Motor(name=f"push {name}", body=name, torque=-way * 1.2 * 9.81))
    model = pg.Model(bodies=tuple(bodies), contacts=tuple(contacts), forces=tuple(forces))
    run = pg.simulate(model, t_end=0.1, frames=3, estimate=False)
    fallen = -run["cube"][:, 2]
    assert fallen[-1] < 1e-4
    assert fallen[-1] - fallen[1] < 1e-5  # it crept at 1 mm/s


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize(("depth", "said"), [(0.002, True), (1e-5, False)])
def test_a_start_deeper_than_the_weight_presses_is_reported(law, depth, said):
    model = on_ground(box(place=(0, 0, 0.1 - depth)), law=law)
    run = pg.simulate(model, t_end=1e-4, frames=2, estimate=False)
    assert any("'floor'" in notice for notice in run.notices) == said


def bounce(
    e, speed, *, size=0.1, mass=1.0, hit="face", tree: Any = "free", law: Any = "soft", steps=None
):
    """Restitution of a cube without gravity that goes in by about 1e-4 of its size, with this
    number of time steps or without time stepping.
    """
    deep = 1e-4 * size
    stiffness = mass * speed**2 * (1.25 / deep**2.5 if law == "soft" else 1.0 / deep**2)
    corners = 0.5 * size * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    turn = {"face": (1, 0, 0, 0), "edge": (0.9, 0.3, 0, 0), "corner": (0.9, 0.3, 0.2, 0)}[hit]
    turn = tuple((np.array(turn) / np.linalg.norm(turn)).tolist())
    corners = corners @ matrix(turn).T
    low = corners[:, 2].min()
    motion = {"free": (0, 0, 0, 0, 0, -speed), "prismatic": (-speed,)}[tree]
    cube = box(
        size=3 * (size,), joint=tree, axes=() if tree == "free" else (0, 0, 1), v=motion, mass=mass,
        place=(0, 0, 1e-4 * size - low), rotation=turn,
    )  # fmt: skip
    fields = {"law": law, "restitution": e, "friction": 0.0, "stiffness": stiffness}
    model = on_ground(cube, model={"gravity": (0, 0, 0)}, **fields)
    t_end = 0.01 * size / speed
    method = {"method": "moreau_jean", "step": t_end / steps} if steps else {}
    run = pg.simulate(model, t_end=t_end, frames=2, estimate=False, **method)
    assert run.status.ok
    arm = corners[corners[:, 2] < low + 1e-9 * size].mean(axis=0)
    turned = np.cross(run.v[-1, :3], arm)[2] if tree == "free" else 0.0
    return (run.v[-1, -1] + turned) / speed


@pytest.mark.parametrize(
    ("law", "e", "speed"),
    [("soft", 0.05, 1e-3), ("soft", 0.5, 100.0), ("soft", 1.0, 1.0), ("penalty", 0.05, 1.0),
     ("penalty", 0.9, 1.0)],
)  # fmt: skip
def test_a_cube_bounces_with_its_restitution_however_it_hits(law, e, speed):
    """At any size and speed, and however many points hit."""
    close = 2e-3 if law == "soft" else 5e-3
    sizes = ((0.1, 1.0), (1e-3, 1e-6), (10.0, 1e4)) if law == "soft" else ((0.1, 1.0),)
    for size, mass in sizes:
        given = {"size": size, "mass": mass, "law": law}
        for hit in ("face", "edge", "corner"):
            assert bounce(e, speed, hit=hit, **given) == pytest.approx(e, abs=close)
        if law == "soft":
            assert bounce(e, speed, tree="prismatic", **given) == pytest.approx(e, abs=close)


@pytest.mark.parametrize(("law", "mass"), combined(["soft", "penalty"], [1e-3, 1.0, 1e3]))
def test_time_stepping_keeps_the_restitution_at_any_mass(law, mass):
    """60 steps touch the ground. Their second pass takes the inertias of the first."""
    for tree in ("free", "prismatic"):
        assert bounce(0.3, 1.0, mass=mass, law=law, tree=tree, steps=2000) == pytest.approx(
            0.3, abs=5e-3
        )


def fingers():
    """Two links of one chain that hit each other: their paths to the ground meet."""
    ball = {"kind": "sphere", "radius": 0.1, "position": (0.5, 0, 0)}
    palm = pg.Body(name="palm", joint="prismatic", axes=(1, 0, 0), mass=3.0)
    turn = {"joint": "revolute", "axes": (0, 0, 1), "parent": "palm", "com": (0.5, 0, 0)}
    one = pg.Body(name="h", q=(0.21,), v=(-1.0,), shape=ball, inertia=np.eye(3) * 0.05, **turn)
    two = pg.Body(name="o", q=(-0.21,), mass=2.0, shape=ball, inertia=np.eye(3) * 0.02, **turn)
    return [palm, one, two], {"body": "h", "other": "o"}


def on_a_ball_joint():
    slide = {"joint": "prismatic", "axes": (0, 0, 1), "mass": 0.5}
    arm = pg.Body(name="arm", link=(0, 0, 0.2), v=(-1,), **slide)
    hung = {"parent": "arm", "joint": "spherical", "rotation": (0.995, 0.05, 0.03, 0)}
    plate = box("h", (0, 0, -0.08), (0.6, 0.4, 0.1), mass=2.0, **hung)
    return [arm, plate], {"body": "h"}


@pytest.mark.parametrize("scene", [fingers, on_a_ball_joint])
@pytest.mark.parametrize(("law", "e"), [("soft", 0.2), ("penalty", 0.7)])
def test_bodies_of_a_tree_part_with_their_restitution(scene, law, e):
    bodies, pair = scene()
    stiff = {"stiffness": 1e8 if law == "soft" else 1e6}
    contact = pg.Contact(name="c", law=law, friction=0.0, restitution=e, **stiff, **pair)
    model = pg.Model(bodies=bodies, contacts=[contact], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.06, frames=6001, estimate=False)
    touches = np.flatnonzero(run.contact_gap["c"] < 0.0)
    first, last = touches[0], touches[np.flatnonzero(np.diff(touches, append=10**6) > 1)[0]]
    rate = np.diff(run.contact_gap["c"]) / np.diff(run.t)
    before, after = rate[first - 2], rate[last + 1]
    assert before < -0.2
    assert -after / before == pytest.approx(e, abs=0.02)
    assert not run.notices


@pytest.mark.parametrize(
    ("held", "feet", "law"), [(False, 1, "soft"), (True, 1, "penalty"), (False, 2, "soft")]
)
def test_a_restitution_that_is_only_near_is_reported(held, feet, law):
    """It is exact for a tree on one contact, not with constraints or several contacts."""
    bodies = [box("box", (0, 0, 0.06), 3 * (0.1,))]
    bodies.append(pg.Body(name="arm", parent="box", com=(0.1, 0, 0), mass=0.5))
    rope = [pg.Distance(name="rod", body="arm", other_point=(1.0, 0, 0.1))] if held else []
    soft = {"body": "box", "law": law, "restitution": 0.5}
    sets = [{"name": "all"}] if feet == 1 else [
        {"name": f"foot {x}", "points": [(x, 0, -0.05)]} for x in (-0.05, 0.05)
    ]  # fmt: skip
    contacts = [pg.Contact(**soft, **one) for one in sets]
    model = pg.Model(bodies=bodies, constraints=rope, contacts=contacts)
    run = pg.simulate(model, t_end=0.1, estimate=False)
    assert any("restitution" in notice for notice in run.notices) == (held or feet == 2)


def test_a_mesh_much_smaller_than_its_hull_is_reported(tmp_path):
    """A cup is reported unless hull 'convex' states the intention."""
    trimesh = pytest.importorskip("trimesh")
    profile = [[0, 0], [0.5, 0], [0.5, 1], [0.45, 1], [0.45, 0.05], [0, 0.05]]
    trimesh.creation.revolve(np.array(profile), sections=24).export(tmp_path / "cup.stl")
    for hull, told in ((None, True), ("convex", False)):
        shape = {"kind": "mesh", "file": str(tmp_path / "cup.stl"), "hull": hull}
        model = on_ground(pg.Body(name="b", joint="free", shape=shape))
        run = pg.simulate(model, t_end=1e-3, step=1e-3, frames=2, estimate=False)
        assert any("'b'" in n and "hull" in n for n in run.notices) == told


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize("mass", [0.5, 20.0])
def test_frames_that_miss_a_hit_are_told(law, mass):
    """A peak force is a property of the motion, and frames every millisecond do not show it."""
    inertia = (1e-3 * mass,) * 3
    shape = pg.Shape(kind="box", size=(0.1, 0.1, 0.1))
    box = pg.Body(name="box", joint="free", mass=mass, inertia=inertia, shape=shape,
                  q=(0, 0, 0.3, 1, 0, 0, 0))  # fmt: skip
    contact = pg.Contact(name="floor", body="box", law=law, restitution=0.3)
    model = pg.Model(bodies=[box], contacts=[contact])

    def peak(times):
        run = pg.simulate(model, t_eval=times, t_end=times[-1], rtol=1e-9, estimate=False)
        told = [text for text in run.notices if "too coarse for the contact forces" in text]
        return np.abs(run.contact_force["floor"][:, 5]).max(), told

    coarse, told = peak(np.linspace(0.0, 0.3, 301))
    hit = np.linspace(0.22, 0.24, 20001)
    fine, silent = peak(np.concatenate(([0.0], hit, [0.3])))
    assert not silent
    assert bool(told) == (abs(coarse - fine) > 0.1 * fine)
    assert peak(np.array((0.0, 0.15, 0.3)))[1]
    assert told or law == "penalty"


def test_a_box_that_slides_to_rest_has_no_hits():
    shape = pg.Shape(kind="box", size=(0.1, 0.1, 0.1))
    body = pg.Body(name="b", joint="free", mass=2.0, inertia=(3e-3,) * 3, shape=shape,
                   q=(0, 0, 0.05, 1, 0, 0, 0), v=(0, 0, 0, 0.5, 0, 0))  # fmt: skip
    contact = pg.Contact(name="floor", body="b", law="soft", friction=0.3)
    model = pg.Model(bodies=[body], contacts=[contact])
    settled = pg.simulate(model, t_end=1.0, estimate=False)  # it starts above its springs
    assert any("too coarse" in text for text in settled.notices)
    run = pg.simulate(model, settled.q[-1], body.v, t_end=1.0, estimate=False)
    assert not any("too coarse" in text for text in run.notices)
