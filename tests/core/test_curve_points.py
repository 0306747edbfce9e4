"""Points that stay on a curve: beside hinges, lines, equations of motion and differences."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_core.rotation import matrix
from pgraph_core.simulation.paths import Path
from tests.refusals import assert_names

G, RADIUS, MASS = 9.81, 0.7, 1.3
FINE: dict[str, Any] = {"method": "dop853", "rtol": 1e-13, "atol": 1e-13, "estimate": False}
METHODS = ("dopri5", "rk4", "radau5", "gauss6", "moreau_jean", "semi_implicit_euler")
CIRCLE = pg.Track(
    x=f"{RADIUS}*sin(q)", z=f"-{RADIUS}*cos(q)", range=(-math.pi, math.pi), closed=True
)
PARABOLA = pg.Track(x="q", z="q^2", range=(-3, 3))
EIGHT = pg.Track(x="sin(q)", z="0.5*sin(2*q)", range=(0, 2 * math.pi), closed=True)
ARCH = [(0.0, 0.0, 0.0), (0.3, 0.1, 0.1), (0.6, 0.0, 0.3), (0.8, 0.2, 0.2), (1.2, 0.1, 0.0)]


def bead(curve: Any, start: Any, v: Any = (0, 0, 0), far: bool = False, **more: Any) -> pg.Model:
    """A ball that moves without turning and stays on a curve of the ground.

    Time stepping needs a limit, which is `far` away.
    """
    slides = [("translate", axis) for axis in np.eye(3)]
    limits = [(-99, 99), None, None] if far else None
    body = pg.Body(name="bead", joint="compound", motions=slides, mass=MASS, q=start, v=v,
                   limits=limits)  # fmt: skip
    tie = pg.CurvePoint(name="wire", body="bead", point=(0, 0, 0), curve=curve)
    return pg.Model(bodies=[body], constraints=[tie], **more)


# -- the curve -------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [2.5, -0.4])
def test_a_point_on_a_circle_moves_like_a_pendulum_over_its_seam(start):
    """The coordinate of the circle jumps at the top, which both pass again and again."""
    speed = 5.5 if start > 0 else 12.0
    hinge = pg.Body(name="bead", axes=(0, -1, 0), com=(0, 0, -RADIUS), q=start, v=speed, mass=MASS)
    known = pg.simulate(pg.Model(bodies=[hinge]), t_end=5, **FINE)
    along = speed * RADIUS * np.array((math.cos(start), 0, math.sin(start)))
    place = RADIUS * np.array((math.sin(start), 0, -math.cos(start)))
    run = pg.simulate(bead(CIRCLE, place, along), t_end=5, **FINE)
    angle = known.q[:, 0]
    assert np.ptp(angle) > 4 * math.pi
    exact = RADIUS * np.column_stack((np.sin(angle), 0 * angle, -np.cos(angle)))
    assert run.status.ok, run.message
    assert np.abs(run.q - exact).max() < 1e-9
    assert run.energy_drift < 1e-10


@pytest.mark.parametrize("method", ["dop853", "moreau_jean"])
def test_a_straight_curve_is_a_line(method):
    """Between two points, and past them, on a plate that turns."""
    plate = pg.Body(name="plate", axes=(0.2, 1, 0.1), inertia=np.eye(3), v=(2.0,),
                    limits=[(-99, 99)])  # fmt: skip
    pin = pg.Body(name="pin", joint="free", mass=MASS, inertia=0.1 * np.eye(3), com=(0.1, 0, 0.2),
                  q=(0.1, 0.2, 0.3, 1, 0, 0, 0))  # fmt: skip
    way = np.array((0.6, 0.2, -0.3))
    place = {"body": "pin", "point": (0, 0, 0), "other": "plate"}
    begin = np.array((0.1, 0.2, 0.3)) - 0.2 * way
    ties = (
        pg.Line(name="tie", other_point=begin, other_axis=way, **place),
        pg.CurvePoint(name="tie", curve=[begin, begin + way], **place),
    )
    options = FINE if method == "dop853" else {"method": method, "step": 2e-3, "estimate": False}
    runs = [
        pg.simulate(pg.Model(bodies=[plate, pin], constraints=[tie]), t_end=1.0, **options)
        for tie in ties
    ]
    assert runs[0].status.ok
    assert np.linalg.norm(runs[0].q[-1, 1:4] - runs[0].q[0, 1:4]) > 1.0
    assert np.abs(runs[1].q - runs[0].q).max() < 1e-11
    found, known = (run.constraint_force["tie"] for run in runs)
    assert np.abs(found - known).max() < 1e-9 * np.abs(known).max()


def rates(t: float, y: Any) -> Any:
    """A bead on z = x² by its equation of one coordinate."""
    x, v = y
    return v, -(2 * G * x + 4 * x * v * v) / (1 + 4 * x * x)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_moves_a_bead_on_a_parabola_by_its_equation(method):
    step = {} if method in ("dopri5", "radau5") else {"step": 1e-3}
    tolerance = {} if step else {"rtol": 1e-11, "atol": 1e-11}
    model = bead(PARABOLA, (1, 0, 1), far=method == "moreau_jean")
    run = pg.simulate(model, t_end=2, frames=41, method=method, **step, **tolerance)
    assert run.status.ok, run.message
    exact = solve_ivp(rates, (0, 2), (1, 0), method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.t)
    x, v = exact.y
    error = {"moreau_jean": 1e-4, "semi_implicit_euler": 3e-2, "rk4": 1e-7}.get(method, 1e-9)
    assert np.abs(run.q[:, 0] - x).max() < error
    assert run.q[:, 2] == pytest.approx(run.q[:, 0] ** 2, abs=1e-11)
    assert run.v[:, 2] == pytest.approx(2 * run.q[:, 0] * run.v[:, 0], abs=1e-10)
    assert np.abs(run.q[:, 1]).max() < 1e-11


def test_the_force_is_normal_to_the_curve_and_does_no_work():
    run = pg.simulate(bead(PARABOLA, (1, 0, 1)), t_end=4, **FINE)
    force, (x, _, _) = run.constraint_force["wire"][:, 3:], run.q.T
    tangent = np.column_stack((np.ones_like(x), 0 * x, 2 * x))
    assert np.abs((force * tangent).sum(axis=1)).max() < 1e-10
    assert force == pytest.approx(MASS * (run.vdot + np.array((0, 0, G))), abs=1e-9)
    assert run.energy_drift < 1e-10
    assert (run.work == 0.0).all()


def pair(curve: Any = ARCH, closed: bool = False) -> pg.Model:
    """Two free bodies of which one slides along a curve of the other, without gravity."""
    plate = pg.Body(
        name="plate",
        joint="free",
        mass=2.0,
        com=(0.2, -0.1, 0.1),
        inertia=np.diag((0.3, 0.4, 0.5)),
        v=(0.2, -0.5, 0.7, 0.1, 0.2, -0.3),
    )
    pin = pg.Body(
        name="pin",
        joint="free",
        mass=MASS,
        inertia=np.diag((0.05, 0.1, 0.12)),
        q=(0, 0, 0, 1, 0, 0, 0),
        com=(0.05, 0.1, 0),
        v=(1.0, 0.5, -0.2, 1.2, 0.3, 0.2),
    )
    tie = pg.CurvePoint(name="slot", body="pin", point=(0.0, 0.0, 0.0), other="plate",
                        curve=curve, closed=closed)  # fmt: skip
    return pg.Model(bodies=[plate, pin], constraints=[tie], gravity=(0, 0, 0))  # fmt: skip


def posed(run: Any, body: str) -> Any:
    """The origin (n, 3) and the rotation (n, 3, 3) of a body."""
    pose = np.asarray(run.body_pose[body])
    return pose[:, :3], np.array([matrix(p) for p in pose[:, 3:]])


def momentum(run: Any) -> Any:
    """The momentum and the angular momentum (n, 6) of all bodies about the origin."""
    found = 0.0
    for body in run.model.bodies:
        place, turn = posed(run, body.name)
        spin, speed = np.split(np.asarray(run.body_velocity[body.name]), 2, axis=1)
        arm = turn @ np.array(body.com)
        v = speed + np.cross(spin, arm)
        inertia = turn @ np.array(body.inertia) @ turn.swapaxes(1, 2)
        own = np.einsum("nij,nj->ni", inertia, spin)
        p = body.mass * v
        found = found + np.column_stack((p, own + np.cross(place + arm, p)))
    return found


@pytest.mark.parametrize("closed", [False, True])
def test_two_free_bodies_keep_momentum_and_energy(closed):
    run = pg.simulate(pair(closed=closed), t_end=2.0, **FINE)
    assert run.status.ok, run.message
    assert run.energy_drift < 1e-10
    kept = momentum(run)
    assert np.abs(kept - kept[0]).max() < 1e-10
    track = pg.Track(points=ARCH, closed=closed)
    (plate, turn), (pin, _) = posed(run, "plate"), posed(run, "pin")
    seen = np.einsum("nji,nj->ni", turn, pin - plate)
    near = np.array([track.at(q)[0] for q in track.nearest(seen)])
    assert np.abs(near - seen).max() < 1e-10
    assert np.ptp(track.nearest(seen)) > 0.5


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_point_keeps_its_branch_where_a_curve_crosses_itself(side):
    """A figure of eight: the bead goes straight on through its centre, in either direction."""
    start = np.array((math.sin(side), 0, 0.5 * math.sin(2 * side)))
    along = 6.0 * np.array((math.cos(side), 0, math.cos(2 * side)))
    run = pg.simulate(bead(EIGHT, start, along), t_end=4, rtol=1e-10, frames=2001)
    x, _, z = run.q.T
    crossing = np.flatnonzero(x[1:] * x[:-1] < 0.0)
    assert len(crossing) > 2
    assert (z[crossing] * z[crossing + 1] < 0.0).all()  # it comes out opposite
    assert run.energy_drift < 1e-8


def test_a_pin_in_a_slot_turns_a_crank_as_a_slider_does():
    """A Scotch yoke, whose slot is a curve of two points. The yoke is at the height of the pin."""
    crank, mass = 0.3, 1.5
    bodies = (
        pg.Body(name="crank", axes=[(0, 1, 0)], inertia=0.1 * np.eye(3), v=(3.0,), q=(0.3,)),
        pg.Body(name="yoke", joint="prismatic", axes=[(0, 0, 1)], mass=mass,
                q=(-crank * math.sin(0.3),)),
    )  # fmt: skip
    slot = pg.CurvePoint(name="slot", body="crank", point=(crank, 0, 0), other="yoke",
                         curve=[(-1, 0, 0), (1, 0, 0)])  # fmt: skip
    model = pg.Model(bodies=bodies, constraints=[slot])
    run = pg.simulate(model, t_end=2.0, rtol=1e-12, atol=1e-12)
    angle, z = run.q.T
    assert z == pytest.approx(-crank * np.sin(angle), abs=1e-11)
    energy = 0.5 * (0.1 + mass * (crank * np.cos(angle)) ** 2) * run.v[:, 0] ** 2 + mass * G * z
    assert energy == pytest.approx(np.full(len(energy), energy[0]), abs=1e-9)
    found = pg.Mechanism(model).mobility()
    assert found.dof == 1  # the row across the plane says nothing new
    assert [row.constraint for row in found.redundant] == ["slot"]


# -- the same numbers everywhere -------------------------------------------------------------------


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_steps_have_the_same_bits_from_any_beginning(method):
    """In a run, in a stepper that was elsewhere before, and in a batch."""
    step, count = 2e-3, 200
    start = math.sin(0.5), 0, 0.5 * math.sin(1.0)
    model = bead(EIGHT, start, far=method == "moreau_jean")
    options = {"method": method, "step": step}
    run = pg.simulate(model, t_end=count * step, frames=count + 1, estimate=False, **options)
    stepper = pg.Stepper(model, **options)
    for _ in range(77):
        stepper.step()
    stepper.reset()
    for k in range(count):
        stepper.step()
        assert (stepper.q == run.q[k + 1]).all()
    batch = pg.BatchStepper(model, 3, **options)
    for _ in range(count):
        batch.step()
    assert (batch.q == run.q[-1]).all()


@pytest.mark.parametrize("method", ["dopri5", "radau5", "moreau_jean"])
@pytest.mark.parametrize(
    ("curve", "paths"),
    [
        (ARCH, ["constraints.wire.curve.points.1.2", "bodies.bead.mass", "gravity.2"]),
        (ARCH, ["constraints.wire.point.0"]),
    ],
)
def test_derivatives_are_those_of_differences(curve, paths, method):
    model = bead(curve, curve[3], far=method == "moreau_jean")
    options: Any = {"rtol": 1e-11} if method != "moreau_jean" else {"step": 2e-3}

    def last(model: pg.Model) -> Any:
        return pg.simulate(model, t_end=0.4, method=method, frames=2, **options).q[-1]

    run = pg.simulate(model, t_end=0.4, method=method, wrt=paths, frames=2, **options)
    for path in paths:
        present, h = Path(model, path, "test").present, 1e-3
        ends = [last(model.edit(path, present + k * h)) for k in (-2, -1, 1, 2)]
        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * h)
        found = run.derivatives[path][-1, :3]
        assert found == pytest.approx(slope, abs=1e-7 * max(1.0, np.abs(slope).max()))


def test_linearised_motions_turn_with_the_curve():
    """At the lowest point of z = x² the frequency is that of its curvature, √(2 g)."""
    found = pg.Mechanism(bead(PARABOLA, (0, 0, 0))).linearise()
    assert found.frequencies == pytest.approx([math.sqrt(2 * G)], rel=1e-9)


# -- files, copies, notices ------------------------------------------------------------------------


def test_a_run_names_a_point_past_the_end_of_its_curve():
    run = pg.simulate(bead(ARCH, ARCH[3]), t_end=1.5, rtol=1e-10)
    (text,) = [text for text in run.notices if "'wire' is past the" in text]
    assert_names(text, "end [", "t = ", "give more points")
    assert run.energy_drift < 1e-8
    closed = pg.simulate(bead({"points": ARCH, "closed": True}, ARCH[3]), t_end=1.5)
    assert not [text for text in closed.notices if "is past the" in text]


def test_a_curve_survives_files_copies_and_names():
    for curve in (ARCH, {"points": ARCH, "closed": True}, CIRCLE):
        model = bead(curve, (0, 0, 0))
        assert pg.Model.from_json(model.to_json()) == model
        assert '"schema_version": 9' in model.to_json()
    (tie,) = pair().edit("plate", name="disc").constraints
    assert tie.other == "disc"
    assert pair().remove("plate").constraints == ()
    short = pg.CurvePoint(name="a", body="b", curve=ARCH, closed=True)
    assert short.curve == pg.Track(points=ARCH, closed=True)


def test_a_mirror_image_moves_as_the_mirror_image():
    left = bead(ARCH, ARCH[3], (0.1, 0.2, 0.3)).edit("bead", name="left")
    run = pg.simulate(left.mirror("left", "y"), t_end=0.5, **FINE)
    one, other = (posed(run, name)[0] for name in ("left", "right"))
    assert np.abs(one - one[0]).max() > 0.05
    assert np.abs(other * (1, -1, 1) - one).max() < 1e-9


def test_a_run_tells_a_beginning_at_a_crossing():
    run = pg.simulate(bead(EIGHT, (0, 0, 0)), t_end=0.01)
    (text,) = [text for text in run.notices if "crosses itself" in text]
    assert "0 and 3.14159" in text
    other = pg.simulate(bead(EIGHT, (math.sin(0.1), 0, 0.5 * math.sin(0.2))), t_end=0.01)
    assert not [text for text in other.notices if "crosses itself" in text]


def test_a_point_beside_its_curve_is_moved_onto_it():
    start = np.array((1.0, 0.0, 1.0)) + 0.3 * np.array((2.0, 0.5, -1.0))
    run = pg.simulate(bead(PARABOLA, start), t_end=0.01)
    assert run.q[0, 2] == pytest.approx(run.q[0, 0] ** 2, abs=1e-12)
    assert any("moved" in text for text in run.notices)


LINE = [(0, 0, 0), (1, 0, 0)]
BAD: list[tuple[Any, tuple[str, ...]]] = [
    ([(0, 0, 0)], ("curve", "at least 2 points", "got 1")),
    ({"points": LINE, "closed": True}, ("curve", "at least 3 points", "got 2")),
    ([(0, 0, 0), (0, 0, 0), (1, 0, 0)], ("curve", "points 1 and 2 are equal", "leave one out")),
    ([(0, 0, 0), (1, 0, 0), (0, 0, 0)], ("curve", "cusp near [1.0, 0.0, 0.0]", "move a point")),
    ({"points": [*ARCH, ARCH[0]], "closed": True}, ("curve", "leave the last point out")),
    ({"points": ARCH, "up": (0, 0, 1)}, ("curve.up", "leave it out")),
    ({"x": "q^3", "range": [-1, 1]}, ("curve", "as at a cusp", "choose other functions")),
    ({"x": "q"}, ("curve", "must be given with expressions")),
    (3.0, ("curve", "two or more points", "got 3.0")),
]


@pytest.mark.parametrize(("curve", "told"), BAD)
def test_bad_curves_are_refused_with_a_remedy(curve, told):
    with pytest.raises(pg.ModelError) as refused:
        pg.CurvePoint(name="slot", body="pin", curve=curve)
    text = str(refused.value)
    assert "constraint 'slot'" in text
    for word in told:
        assert word in text
