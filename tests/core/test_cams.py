"""Cams: laws of lift, profiles, pressure angles and forces of followers."""

import math
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.cams import LAWS, riding, values

H, BETA, SPEED, BASE = 0.02, math.pi / 2, 300 * 2 * math.pi / 60, 0.04
# largest second derivative of a rise by 1 within 1 (Norton, Cam Design, tables 2-2 and 3-5)
PEAKS = {
    "3-4-5": 10 / math.sqrt(3),
    "4-5-6-7": 84 * math.sqrt(5) / 25,
    "cycloidal": 2 * math.pi,
    "modified sine": 4 * math.pi**2 / (4 + math.pi),
}
PRINTED = {"3-4-5": 5.773503, "4-5-6-7": 7.5132, "cycloidal": 6.283185, "modified sine": 5.5280}
POINTS = pg.Curve(
    x=np.linspace(0, 2 * math.pi, 9),
    value=(0.0, 0.005, 0.015, 0.02, 0.02, 0.018, 0.01, 0.003, 0.0),
    kind="periodic",
)
FOLLOWERS: dict[str, dict[str, Any]] = {
    "knife": {},
    "knife beside the axis": {"eccentricity": 0.015},
    "roller": {"follower": "roller", "roller_radius": 0.01},
    "roller beside the axis": {
        "follower": "roller", "roller_radius": 0.012, "eccentricity": -0.01,
    },
    "flat": {"follower": "flat", "base_radius": 0.08},
    "turning knife": {"distance": 0.12, "arm": 0.1},
    "turning roller": {"distance": 0.12, "arm": 0.1, "follower": "roller", "roller_radius": 0.01},
    "turning flat": {"distance": 0.12, "follower": "flat", "base_radius": 0.05},
}  # fmt: skip


def turn(law: Any = "3-4-5", lift: float = H) -> list[pg.CamSegment]:
    """Up within 90 degrees, there for 60, down within 110, and rest."""
    return [
        pg.CamSegment(lift=lift, angle=BETA, law=law),
        pg.CamSegment(lift=lift, angle=math.pi / 3),
        pg.CamSegment(lift=0.0, angle=math.radians(110), law=law),
        pg.CamSegment(lift=0.0),
    ]


def made(name: str = "knife", motion: Any = None, **more: Any) -> pg.Cam:
    given = {"base_radius": BASE, **FOLLOWERS[name], **more}
    if motion is None:
        motion = turn("cycloidal", 0.15 if "distance" in given else H)
    return pg.Cam(name="lift", body="follower", other="cam", motion=motion, **given)


def machine(cam: pg.Cam, driven: bool = True, **first: Any) -> pg.Model:
    """A cam about y with its follower, which slides along z or turns about y, not in line with the
    axes of their bodies. The cam turns at 300 rpm."""
    turned = (math.cos(0.4), 0.0, math.sin(0.4), 0.0)
    shaft = pg.Body(name="cam", axes=[(0, 1, 0)], inertia=(0.02, 0.02, 0.02), rotation=turned,
                    link=(0.1, 0.2, 0.3), **first)  # fmt: skip
    follower: dict[str, Any] = {"joint": "prismatic", "axes": [(0, 0, 1)], "link": (0.1, 0.2, 0.4)}
    if cam.distance is not None:
        at = (0.1, 0.25, 0.3 + cam.distance)
        follower = {"axes": [(0, 1, 0)], "link": at, "inertia": (0.01, 0.01, 0.01)}
    follower["com"] = (0.0, 0.01, 0.03)
    drive = pg.Motion(name="drive", body="cam", q_of_t=pg.Polynomial(coefficients=(0.0, SPEED)))
    ties = (cam, drive) if driven else (cam,)
    bodies = (shaft, pg.Body(name="follower", mass=0.5, **follower))
    return pg.Model(bodies=bodies, constraints=ties)


# -- laws ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
def test_a_law_has_its_largest_acceleration_and_continuous_slopes(law):
    cam = made(motion=turn(law))
    x = np.linspace(0.0, 2 * math.pi, 40001)
    f, slope, bend = values(cam.lift, x)
    rise = x <= BETA
    peak = np.abs(bend[rise]).max() * BETA**2 / H
    assert peak == pytest.approx(PEAKS[law], rel=1e-6)  # of the nearest angle
    assert peak == pytest.approx(PRINTED[law], abs=5e-5)
    before, after = (values(cam.lift, cam.lift.places[:-1] + k * 1e-13) for k in (-1, 1))
    sizes = np.abs(f).max(), np.abs(slope).max(), np.abs(bend).max()
    for a, b, size in zip(before, after, sizes):
        assert np.abs(a - b).max() < 2e-11 * size  # a jerk of 40 within the 2e-13 between them
    # the mean of the slope is the rise, and that of the bend the rise of the slope
    for low, high in ((f, slope), (slope, bend)):
        means = np.diff(low) / np.diff(x)
        assert np.abs(means - 0.5 * (high[1:] + high[:-1])).max() < 1e-4 * np.abs(high).max()


@pytest.mark.parametrize("law", LAWS)
def test_a_follower_has_the_peak_acceleration_of_its_law_at_300_rpm(law):
    """At the angle of the peak, and beyond it: 10/√3, 2π, ... h/β² ω²."""
    at = {"3-4-5": 0.5 - math.sqrt(3) / 6, "4-5-6-7": 0.5 - math.sqrt(5) / 10,
          "cycloidal": 0.25, "modified sine": 0.125}[law]  # fmt: skip
    times = np.array([0.0, at, 1.0 - at]) * BETA / SPEED
    run = pg.simulate(machine(made(motion=turn(law))), t_eval=times, rtol=1e-10)
    peak = PEAKS[law] * H / BETA**2 * SPEED**2
    assert run.vdot[1:, 1] == pytest.approx([peak, -peak], rel=1e-9)


def test_a_cam_turns_for_ever():
    cam = made(phase=0.7)
    x = np.linspace(-40.0, 40.0, 1001)
    f = values(cam.lift, x)[0]
    assert f == pytest.approx(values(made().lift, x - 0.7)[0], abs=1e-13)
    run = pg.simulate(machine(cam), t_end=5.0, frames=101, estimate=False)
    assert run.q[:, 1] == pytest.approx(values(cam.lift, run.q[:, 0])[0], abs=1e-12)
    assert run.q[-1, 0] == pytest.approx(50 * math.pi)


def test_points_are_a_lift_too():
    cam = made(motion=POINTS)
    assert values(cam.lift, np.array(POINTS.x))[0] == pytest.approx(POINTS.value, abs=1e-15)
    run = pg.simulate(machine(cam), t_end=0.3, frames=31, estimate=False)
    relation = pg.Relation(name="lift", body="follower", other="cam", curve=POINTS)
    drive = machine(cam).constraints[1]
    model = machine(cam).replace(constraints=[relation, drive])
    other = pg.simulate(model, t_end=0.3, frames=31, estimate=False)
    assert run.q == pytest.approx(other.q, abs=1e-14)


# -- geometry --------------------------------------------------------------------------------------


def touching_point(cam: pg.Cam) -> np.ndarray:
    """The knife edge, the centre of the roller or a point of the face, in the world at lift 0.

    By real lengths. The axis of the cam is y, so that the direction of z × y is -x.
    """
    prime = cam.base_radius + (cam.roller_radius or 0.0)
    across, up = cam.eccentricity, math.sqrt(prime**2 - cam.eccentricity**2)
    if cam.distance is not None:
        up = cam.distance
        if cam.arm is not None:  # a triangle
            up = (cam.distance**2 - cam.arm**2 + prime**2) / (2 * cam.distance)
            across = math.sqrt(prime**2 - up**2)
    return CENTRE + np.array([-across, 0.0, up])


CENTRE = np.array([0.1, 0.2, 0.3])  # of the cam in `machine`


class Seen:
    """What a model moves to at angles of the cam, in plain vectors of the cam's body."""

    def __init__(self, cam: pg.Cam):
        self.cam, self.model = cam, machine(cam)
        self.mech = pg.Mechanism(self.model)
        at, R = self.mech.pose(np.zeros(2), "follower")
        self.own = R.T @ (touching_point(cam) - at)

    def at(self, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """The point that touches, or is the centre of a roller, and the normal of a face."""
        q = np.array([angle, values(self.cam.lift, np.array([angle]))[0][0]])
        (place, R), (origin, T) = (self.mech.pose(q, name) for name in ("follower", "cam"))
        normal = np.array([0.0, 0.0, 1.0])
        if self.cam.distance is not None:  # across the face, which leads through the joint
            across = math.asin(self.cam.base_radius / self.cam.distance)
            normal = np.array([-math.cos(across), 0.0, math.sin(across)])
        return T.T @ (place + R @ self.own - origin), T.T @ (R @ normal)

    def gaps(self, points: np.ndarray, angle: float) -> np.ndarray:
        """The distances of the follower from points of the cam [m]."""
        at, normal = self.at(angle)
        if self.cam.follower == "flat":
            return (at - points) @ normal
        return np.linalg.norm(at - points, axis=1) - (self.cam.roller_radius or 0.0)


@pytest.mark.parametrize("name", FOLLOWERS)
def test_a_profile_is_the_envelope_of_all_positions_of_its_follower(name):
    """No position of the follower is inside a point of the profile, and one touches it."""
    cam = made(name)
    seen, count = Seen(cam), 240
    points, flat = cam.profile(seen.model, count), cam.profile(points=count)
    assert np.linalg.norm(flat, axis=1) == pytest.approx(np.linalg.norm(points, axis=1), abs=1e-15)
    assert np.abs(points[:, 1]).max() < 1e-15  # across the axis
    (x, y), (x1, y1) = flat.T, np.roll(flat, -1, axis=0).T
    assert (x * y1 - y * x1).sum() > 6.0 * cam.base_radius**2  # twice the area: counter-clockwise
    angles = 2 * math.pi * np.arange(count)[::-1] / count
    gaps = np.array([seen.gaps(points, angle) for angle in angles])
    assert np.abs(np.diagonal(gaps)).max() < 1e-12
    assert gaps.min() > -1e-12


@pytest.mark.parametrize("name", FOLLOWERS)
def test_pressure_angles_are_those_of_the_drawn_profile(name):
    """Tangents and speeds are central differences, of fourth order."""
    cam = made(name)
    weights, h = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0, 1e-4
    for middle in (0.3, 0.9, 1.4, 3.0, 3.5):
        angle = middle + h * np.array([-2, -1, 0, 1, 2])
        found = riding(cam.rule, *values(cam.lift, angle))
        tangent = weights @ (np.exp(-1j * angle) * found.contact)[[0, 1, 3, 4]] / h
        normal = 1j * tangent / abs(tangent) * np.exp(1j * middle)
        seen = Seen(cam)
        lifts = values(cam.lift, angle)[0]
        turned = [seen.mech.pose(np.array([0.0, y]), "follower") for y in lifts]
        x_axis, y_axis = np.array([-1.0, 0, 0]), np.array([0.0, 0, 1])
        own = seen.own  # the centre of a roller, or what is at the point of contact
        if cam.follower == "flat":
            contact = found.contact[2]
            at = CENTRE + contact.real * x_axis + contact.imag * y_axis
            own = turned[2][1].T @ (at - turned[2][0])
        way = weights @ np.array([p + R @ own for p, R in turned])[[0, 1, 3, 4]]
        way = way if values(cam.lift, angle)[1][2] > 0 else -way
        ahead = complex(way @ x_axis, way @ y_axis)
        assert np.angle(normal / ahead) == pytest.approx(found.pressure[2], abs=1e-7)
        assert found.normal[2] == pytest.approx(normal, abs=1e-8)


def test_the_pressure_angle_of_a_knife_edge_is_that_of_textbooks():
    """tan α = (f' - e) / (s + f), with s² = r² - e²."""
    for name in ("knife", "knife beside the axis", "roller beside the axis"):
        cam = made(name)
        f, slope, bend = values(cam.lift, np.linspace(0.0, 6.0, 50))
        rule = cam.rule
        known = np.arctan2(
            slope - rule.eccentricity, np.sqrt(rule.prime**2 - rule.eccentricity**2) + f
        )
        assert riding(rule, f, slope, bend).pressure == pytest.approx(known, abs=1e-14)


@pytest.mark.parametrize("name", FOLLOWERS)
def test_contact_forces_are_in_equilibrium_with_both_joints(name):
    """The guide of a follower has no force along its motion, and the contact does no work."""
    cam = made(name)
    run = pg.simulate(machine(cam), t_end=0.1, frames=101, rtol=1e-10, estimate=False)
    found = run.cams["lift"]
    along = run.constraint_force["lift"]
    z = np.array([0.0, 0.0, 1.0])
    size = np.abs(found.force).max()
    if cam.distance is None:
        assert run.joint_force["follower"][:, 3:] @ z == pytest.approx(0.0, abs=1e-11 * size)
        assert along[:, 3:] @ z == pytest.approx(found.push)
    else:
        assert run.joint_force["follower"][:, 1] == pytest.approx(0.0, abs=1e-11 * size)
        assert along[:, 1] == pytest.approx(found.push)
    assert found.force @ np.array([0.0, 1.0, 0.0]) == pytest.approx(0.0, abs=1e-12 * size)
    assert np.linalg.norm(found.force, axis=1) == pytest.approx(np.abs(found.normal_force))
    arm = found.point - CENTRE
    torque = np.cross(arm, found.force)[:, 1]
    slope = values(cam.lift, run.q[:, 0])[1]
    assert torque == pytest.approx(slope * found.push, abs=1e-12 * size)
    # the drive holds the cam against it
    drive = run.constraint_force["drive"][:, 1]
    assert drive == pytest.approx(torque, abs=1e-9 * size)


def test_columns_have_the_contact():
    run = pg.simulate(machine(made("roller")), t_end=0.1, frames=11, estimate=False)
    assert run["pressure_angle.lift"] == pytest.approx(run.cams["lift"].pressure_angle)
    assert run["normal_force.lift"] == pytest.approx(run.cams["lift"].normal_force)
    assert run["contact_point.lift.z"] == pytest.approx(run.cams["lift"].point[:, 2])
    with pytest.raises(KeyError, match="lift"):
        run.cams["lif"]


# -- profiles that do not exist --------------------------------------------------------------------


@pytest.mark.parametrize("name", ["roller", "roller beside the axis", "flat", "turning roller",
                                  "turning flat"])  # fmt: skip
def test_an_undercut_profile_is_refused_with_the_least_base_radius(name):
    """The base radius that the sentence gives works, and one of a thousandth less does not."""
    more = {"roller_radius": 0.03} if "roller_radius" in FOLLOWERS[name] else {}
    motion = turn("4-5-6-7", 0.2 if "distance" in FOLLOWERS[name] else 0.03)
    with pytest.raises(pg.ModelError, match="undercut") as found:
        made(name, motion, **more, base_radius=0.005)
    text = str(found.value)
    assert "'lift'" in text
    assert "base_radius" in text
    least = float(text.split("at least ")[1].split(" m")[0])
    cam = made(name, motion, **more, base_radius=least)
    f, slope, bend = values(cam.lift, np.linspace(0.0, 2 * math.pi, 20001))
    assert riding(cam.rule, f, slope, bend).margin.min() > 0.0
    with pytest.raises(pg.ModelError, match="undercut"):
        made(name, motion, **more, base_radius=0.998 * least)
    if name == "flat":
        assert least == pytest.approx(-(f + bend).min(), rel=1e-3)


def test_an_undercut_roller_is_larger_than_the_radius_of_curvature():
    """By differences of the path of its centre on the cam."""
    knife = made(motion=turn("4-5-6-7", 0.04), base_radius=0.05)
    x, h = np.linspace(0.2, 2.2, 400), 1e-3
    at = [np.exp(-1j * a) * riding(knife.rule, *values(knife.lift, a)).contact
          for a in (x - h, x, x + h)]  # fmt: skip
    first, second = (at[2] - at[0]) / (2 * h), (at[2] - 2 * at[1] + at[0]) / h**2
    radius = -(np.abs(first) ** 3) / np.imag(np.conj(first) * second)
    least = radius[radius > 0].min()
    for share, fits in ((0.99, True), (1.01, False)):
        given = {"follower": "roller", "roller_radius": share * least,
                 "base_radius": 0.05 - share * least}  # fmt: skip
        if fits:
            made(motion=knife.motion, **given)
        else:
            with pytest.raises(pg.ModelError, match="larger than the curvature"):
                made(motion=knife.motion, **given)


# -- motions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["roller", "turning flat"])
def test_a_cam_does_no_work(name):
    model = machine(made(name), driven=False, v=(30.0,)).replace(gravity=(0.0, 0.0, 0.0))
    run = pg.simulate(model, t_end=1.0, rtol=1e-12, estimate=False)
    assert np.ptp(run.energy) < 1e-9 * run.energy[0]
    assert run.q[-1, 0] > 2 * math.pi
    assert run.q[:, 1] == pytest.approx(values(model.cams[0].lift, run.q[:, 0])[0], abs=1e-12)


@pytest.mark.parametrize("method", ["dopri5", "radau5", "gauss6", "semi_implicit_euler"])
def test_every_method_keeps_the_lift(method):
    model = machine(made("roller"), driven=False, v=(SPEED,))
    step: dict[str, Any] = {} if method in ("dopri5", "radau5") else {"step": 5e-4}
    run = pg.simulate(model, t_end=0.4, frames=41, method=method, estimate=False, **step)
    assert run.status.ok, run.message
    lift = values(model.cams[0].lift, run.q[:, 0])
    assert run.q[:, 1] == pytest.approx(lift[0], abs=1e-11)
    assert run.v[:, 1] == pytest.approx(lift[1] * run.v[:, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("motion", "paths"),
    [
        (None, ["motion.0.lift", "motion.0.angle", "motion.2.angle", "phase"]),
        (POINTS, ["motion.value.2", "motion.x.3"]),
    ],
)
def test_derivatives_are_those_of_differences(motion, paths):
    model = machine(made("roller", motion), driven=False, v=(20.0,))
    options: dict[str, Any] = {"t_end": 0.2, "frames": 2, "rtol": 1e-12, "estimate": False}
    paths = [f"constraints.lift.{path}" for path in paths]
    run = pg.simulate(model, wrt=paths, **options)
    for path in paths:
        part, _, rest = path.partition(".lift.")
        del part
        h = 1e-4 if "angle" in path or "phase" in path or "x." in path else 1e-5

        def at(k, rest=rest, h=h):
            found = model.edit(f"constraints.lift.{rest}", present(model, rest) + k * h)
            return pg.simulate(found, **options).q[-1]

        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ [at(k) for k in (-2, -1, 1, 2)] / (12 * h)
        found = run.derivatives[path][-1, :2]
        assert found == pytest.approx(slope, abs=2e-6 * np.abs(slope).max())


def present(model: pg.Model, path: str) -> float:
    found: Any = model.constraints[0]
    for word in path.split("."):
        found = found[int(word)] if word.isdigit() else getattr(found, word)
    return found


@pytest.mark.parametrize("name", ["roller", "flat", "turning roller"])
def test_a_run_says_where_a_follower_would_leave_its_cam_and_what_holds_it(name):
    model = machine(made(name))
    run = pg.simulate(model, t_end=0.2, frames=201, estimate=False)
    (told,) = [text for text in run.notices if "would leave its cam 'lift'" in text]
    frame = int(np.argmax(run.cams["lift"].normal_force < 0.0))
    assert f"t = {run.t[frame]:.6g} s" in told
    press = float(told.split("press it on with ")[1].split()[0])
    assert press == pytest.approx(-run.cams["lift"].push.min(), rel=1e-3)
    held = model.add(pg.Motor(name="press", body="follower", torque=-press))
    run = pg.simulate(held, t_end=0.2, frames=201, estimate=False)
    assert not [text for text in run.notices if "would leave" in text]
    assert run.cams["lift"].normal_force.min() > -1e-6


# -- descriptions ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOLLOWERS)
def test_a_cam_survives_files_names_and_mirrors(name):
    model = machine(made(name))
    assert pg.Model.from_json(model.to_json()) == model
    assert '"schema_version": 9' in model.to_json()
    assert model.edit("cam", name="shaft").cams[0].other == "shaft"
    assert [c.name for c in model.remove("follower").constraints] == ["drive"]


def test_a_cam_of_a_branch_is_copied_and_mirrored():
    """The image of the profile is the profile of the image."""
    base = pg.Body(name="left base", joint="weld", link=(0.0, 0.5, 0.0))
    for name in ("roller beside the axis", "turning knife"):
        bodies = [b.model_copy(update={"parent": "left base"}) for b in machine(made(name)).bodies]
        model = pg.Model(bodies=[base, *bodies], constraints=[made(name)])
        both = model.mirror("left base", "y")
        first, second = both.cams
        shapes = [c.profile(both) for c in both.cams]
        mech = pg.Mechanism(both)
        q = np.zeros(mech.nq)
        places = []
        for c, points in zip(both.cams, shapes):
            at, R = mech.pose(q, c.other)
            places.append(at + points @ R.T)
        image = places[0] * (1.0, -1.0, 1.0)
        gaps = np.linalg.norm(image[:, None] - places[1][None], axis=2).min(axis=1)
        assert first.motion == second.motion
        assert gaps.max() < 1e-12


@pytest.mark.parametrize("name", FOLLOWERS)
def test_the_face_of_a_follower_is_where_it_touches(name):
    """At each position a point of a roller's circle, or of the face, is at the point of contact."""
    cam = made(name)
    model = machine(cam)
    run = pg.simulate(model, t_end=0.2, frames=41, estimate=False)
    face = cam.face(model, 7200)
    for i, point in enumerate(run.cams["lift"].point):
        pose = run.body_pose["follower"][i]
        own = pg.Mechanism(model).pose(run.q[i], "follower")[1].T @ (point - pose[:3])
        if cam.follower == "flat":
            along = (face[1] - face[0]) / np.linalg.norm(face[1] - face[0])
            assert np.linalg.norm(np.cross(own - face[0], along)) < 1e-12
            share = (own - face[0]) @ along / np.linalg.norm(face[1] - face[0])
            assert -1e-6 < share < 1 + 1e-6
        else:
            assert np.linalg.norm(face - own, axis=1).min() < 1e-5 + 1e-3 * (cam.roller_radius or 0)


def closed_form(law: str, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """The lift of a rise by 1 within 1 and its derivatives, as Norton's handbook has them."""
    if law in ("3-4-5", "4-5-6-7"):
        powers = {"3-4-5": {3: 10, 4: -15, 5: 6}, "4-5-6-7": {4: 35, 5: -84, 6: 70, 7: -20}}[law]
        f = np.polynomial.Polynomial([powers.get(k, 0) for k in range(8)])
        return f(u), f.deriv(1)(u), f.deriv(2)(u)
    pi, sin, cos = math.pi, np.sin, np.cos
    if law == "cycloidal":
        return u - sin(2 * pi * u) / (2 * pi), 1 - cos(2 * pi * u), 2 * pi * sin(2 * pi * u)
    c, x = pi / (4 + pi), 4 * pi * u
    parts = (u < 1 / 8, u <= 7 / 8)
    y = (pi + x) / 3
    f = np.select(parts, (u - sin(x) / (4 * pi), 2 / pi + u - 9 / (4 * pi) * sin(y)),
                  4 / pi + u - sin(x) / (4 * pi))  # fmt: skip
    slope = np.select(parts, (1 - cos(x), 1 - 3 * cos(y)), 1 - cos(x))
    bend = np.select(parts, (4 * pi * sin(x), 4 * pi * sin(y)), 4 * pi * sin(x))
    return c * f, c * slope, c * bend


@pytest.mark.parametrize("law", LAWS)
def test_a_law_follows_its_formula(law):
    u = np.linspace(0.0, 1.0, 10001)[1:-1]
    cam = made(motion=turn(law))
    for k, (found, known) in enumerate(zip(values(cam.lift, BETA * u), closed_form(law, u))):
        size = H / BETA**k
        assert found == pytest.approx(size * known, abs=1e-12 * size)


def test_a_stepper_reads_the_contact():
    model = machine(made("turning roller"), driven=False, v=(20.0,))
    stepper = pg.Stepper(model, method="rk4", step=1e-3)
    for _ in range(20):
        stepper.step()
    run = pg.simulate(model, t_end=0.02, method="rk4", step=1e-3, frames=2, estimate=False)
    found, known = stepper.cams["lift"], run.cams["lift"]
    for name in ("pressure_angle", "normal_force"):
        assert getattr(found, name) == pytest.approx(getattr(known, name)[-1], rel=1e-12)


@pytest.mark.parametrize("writer", ["to_mjcf", "to_urdf"])
def test_writers_name_the_loss_of_a_cam(writer, tmp_path):
    write = {"to_mjcf": pg.write_mjcf, "to_urdf": pg.write_urdf}[writer]
    report = write(machine(made()), tmp_path / f"cam.{writer[3:]}")
    assert any("'lift'" in str(row) and "cam" in str(row) for row in str(report).splitlines())


@pytest.mark.parametrize("name", ["roller", "flat", "turning roller"])
def test_a_solid_has_the_area_of_the_profile_and_gives_the_body_its_mass(name, tmp_path):
    import trimesh

    cam = made(name)
    model = machine(cam)
    cam.write_stl(tmp_path / "cam.stl", 0.01, model)
    solid = trimesh.load(tmp_path / "cam.stl")
    (x, y), (x1, y1) = cam.profile().T, np.roll(cam.profile(), -1, axis=0).T
    area = 0.5 * (x * y1 - y * x1).sum()
    assert solid.is_watertight
    assert solid.volume == pytest.approx(0.01 * area, rel=1e-6)  # of single precision
    shape = pg.Shape(kind="mesh", file=str(tmp_path / "cam.stl"))
    shaft = pg.Body(name="cam", axes=[(0, 1, 0)], shape=shape, density=7800.0)
    assert shaft.mass == pytest.approx(78.0 * area, rel=1e-6)
    with pytest.raises(pg.InputError, match="width"):
        cam.write_stl(tmp_path / "cam.stl", 0.0, model)


def test_points_over_a_turn_that_is_rounded_repeat_without_a_jump():
    x = (0.0, 2.0, 4.0, 6.28318)
    cam = made(motion=pg.Curve(x=x, value=(0.0, 0.01, 0.02, 0.0), kind="periodic"))
    before, after = (values(cam.lift, np.array([2 * math.pi + k * 1e-12])) for k in (-1, 1))
    for a, b in zip(before, after):
        assert a == pytest.approx(b, abs=1e-12)


def test_a_saved_run_has_the_contact(tmp_path):
    run = pg.simulate(machine(made("roller")), t_end=0.05, frames=6, estimate=False)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert again.cams["lift"].normal_force == pytest.approx(run.cams["lift"].normal_force)


@pytest.mark.parametrize("points", [2, 0, 7.5])
def test_a_profile_has_three_points_or_more(points):
    with pytest.raises(pg.InputError, match="3 or more"):
        made().profile(points=points)
