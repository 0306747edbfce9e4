"""Random models, computed by OpenSim in the same process: what docs/opensim.md and docs/muscles.md
say of lengths, moment arms and forces."""

import numpy as np
import pytest

import pgraph_core as pg

from .core.test_gradients import difference

pytestmark = pytest.mark.nightly
KINDS = {  # largest difference of tensions in parts of f_max; OpenSim's search leaves 1e-8
    "Thelen2003Muscle": 3e-8,
    "Millard2012EquilibriumMuscle": 3e-8,
    "DeGrooteFregly2016Muscle": 1e-9,
}
RANGE = 1.2  # rad: largest coordinates
BODY = (
    '<Body name="b{0}"><mass>{1}</mass><mass_center>{2}</mass_center>'
    "<inertia>0.03 0.02 0.03 0 0 0</inertia></Body>"
)
JOINT = """<PinJoint name="j{0}"><socket_parent_frame>at{0}</socket_parent_frame>
<socket_child_frame>/bodyset/b{0}</socket_child_frame>
<coordinates><Coordinate name="q{0}"><range>-1.2 1.2</range></Coordinate></coordinates>
<frames><PhysicalOffsetFrame name="at{0}"><socket_parent>{1}</socket_parent>
<translation>{2}</translation><orientation>{3}</orientation></PhysicalOffsetFrame></frames>
</PinJoint>"""
MUSCLE = """<{0} name="m{1}"><max_isometric_force>{2}</max_isometric_force>
<optimal_fiber_length>{3}</optimal_fiber_length><tendon_slack_length>{4}</tendon_slack_length>
<pennation_angle_at_optimal>{5}</pennation_angle_at_optimal>
<GeometryPath><PathPointSet><objects>{6}</objects></PathPointSet></GeometryPath></{0}>"""
POINT = """<{0} name="p{1}"><socket_parent_frame>{2}</socket_parent_frame>
<location>{3}</location>{4}</{0}>"""


def text(x):
    return " ".join(map(repr, np.ravel(x).tolist()))


def point(rng, k, body, kind="PathPoint"):
    """Return a point of a path on a body: fixed, moving or conditional."""
    frame, more = ("/ground", f"/bodyset/b{body - 1}")[body > 0], ""
    coordinate = f"/jointset/j{rng.integers(3)}/q"
    coordinate += coordinate[-3]
    if kind == "ConditionalPathPoint":
        more = f"<socket_coordinate>{coordinate}</socket_coordinate>"
        more += f"<range>{text(np.sort(rng.uniform(-RANGE, RANGE, 2)))}</range>"
    if kind == "MovingPathPoint":
        for axis in "xyz":
            more += f"<socket_{axis}_coordinate>{coordinate}</socket_{axis}_coordinate>"
            x, y = (-1.5, -0.4, 0.5, 1.4), rng.uniform(-0.05, 0.05, 4)
            spline = f"<x>{text(x)}</x><y>{text(y)}</y>"
            more += f"<{axis}_location><SimmSpline>{spline}</SimmSpline></{axis}_location>"
    return POINT.format(kind, k, frame, text(rng.uniform(-0.05, 0.05, 3)), more)


def document(seed, moving, lengths=(2.0,) * 6):
    """Return the text of a chain of three hinges with six muscles.

    With paths of these lengths [m], fibres are from 0.5 to 1.3 of their optimal length.
    """
    rng = np.random.default_rng(seed)
    bodies, joints, muscles = "", "", ""
    for k in range(3):
        parent = f"/bodyset/b{k - 1}" if k else "/ground"
        bodies += BODY.format(k, rng.uniform(1, 3), text(rng.uniform(-0.1, 0.1, 3)))
        place = rng.uniform(-0.05, 0.05, 3) - [0, 0.3, 0]
        joints += JOINT.format(k, parent, text(place), text(rng.uniform(-1, 1, 3)))
    for n in range(6):
        on = [0, 1, 2, 3] if n % 2 else [3, 3, 1, 0]
        kinds = ["PathPoint"] * 4
        if moving:
            kinds[1] = "ConditionalPathPoint"
            kinds[3 * (n % 2)] = "MovingPathPoint"
        path = "".join(point(rng, k, b, kind) for k, (b, kind) in enumerate(zip(on, kinds)))
        force, fibre, pennation = rng.uniform((100, 0.1, 0), (3000, 0.2, 0.4))
        slack = lengths[n] - rng.uniform(0.5, 1.3) * fibre
        kind = list(KINDS)[n % 3]
        muscles += MUSCLE.format(kind, n, force, fibre, slack, pennation, path)
    sets = {"BodySet": bodies, "JointSet": joints, "ForceSet": muscles}
    inside = "".join(f"<{x}><objects>{y}</objects></{x}>" for x, y in sets.items())
    return f'<OpenSimDocument Version="40000"><Model name="m">{inside}</Model></OpenSimDocument>'


class Both:
    """A model of ours and OpenSim's, at equal states."""

    def __init__(self, path):
        osim = pytest.importorskip("opensim", reason="needs the extra opensim")
        osim.Logger.setLevelString("off")
        self.model, self.report = pg.read_osim(path)
        self.mech, self.theirs = pg.Mechanism(self.model), osim.Model(str(path))
        self.state = self.theirs.initSystem()
        own = self.theirs.getCoordinateSet()
        self.coordinates = [own.get(i) for i in range(own.getSize())]
        forces = self.theirs.getMuscles()
        self.muscles = {forces.get(i).getName(): forces.get(i) for i in range(forces.getSize())}
        self.places = {out.name: (out.at, out.coordinate) for out in self.model.outputs}

    def columns(self, of):
        """Return the indices into q or v of their coordinates."""
        joints, places = self.mech.joints, (self.places[c.getName()] for c in self.coordinates)
        return [getattr(joints[body], of).start + k for body, k in places]

    def put(self, values):
        """Set the coordinates of both, and return our q."""
        q = self.mech.home()[0]
        q[self.columns("q")] = values
        for c, x in zip(self.coordinates, values):
            c.setValue(self.state, float(x), False)
        self.theirs.realizePosition(self.state)
        return q

    def lengths(self):
        paths = (self.muscles[name].getGeometryPath() for name in self.mech.path_names)
        return np.array([path.getLength(self.state) for path in paths])

    def arms(self):
        paths = (self.muscles[name].getGeometryPath() for name in self.mech.path_names)
        return np.array([[p.computeMomentArm(self.state, c) for c in self.coordinates]
                         for p in paths])  # fmt: skip


@pytest.fixture
def both(tmp_path):
    def made(*given, **more):
        (tmp_path / "m.osim").write_text(document(*given, **more))
        return Both(tmp_path / "m.osim")

    return made


@pytest.mark.parametrize("seed", range(4))
def test_lengths_are_those_of_opensim_and_arms_are_their_slopes(both, seed):
    """Lengths are below 2 m, with a few roundings. Where a moving point stands between two others,
    arms of OpenSim are not the slopes of its lengths, so that all are compared with differences."""
    one, rng = both(seed, moving=True), np.random.default_rng(seed)
    assert all(f._rides for f in one.model.forces)
    for values in rng.uniform(-RANGE, RANGE, (40, 3)):
        q = one.put(values)
        assert np.abs(one.mech.path_length(q) - one.lengths()).max() < 2e-15
        arms = one.mech.moment_arms(q)[:, one.columns("v")]
        for k, e in enumerate(np.eye(3)):
            slope = difference(
                lambda x, v=values, e=e: one.mech.path_length(one.put(v + x * e)), 1e-3
            )
            # beside the ends of ranges, a difference is of a jump
            assert np.median(np.abs(arms[:, k] + slope)) < 1e-11


@pytest.mark.parametrize("seed", range(4))
def test_arms_of_fixed_points_are_those_of_opensim(both, seed):
    one, rng = both(seed, moving=False), np.random.default_rng(seed)
    for values in rng.uniform(-RANGE, RANGE, (40, 3)):
        q = one.put(values)
        ours = one.mech.moment_arms(q)[:, one.columns("v")]
        np.testing.assert_allclose(ours, one.arms(), rtol=0, atol=2e-15)


@pytest.mark.parametrize("seed", range(4))
def test_muscles_at_rest_pull_as_in_opensim(both, seed):
    rng = np.random.default_rng(seed)
    for values in rng.uniform(-RANGE, RANGE, (10, 3)):
        one, a = both(seed, moving=False), rng.uniform(0.05, 1.0)
        one.put(values)
        one = both(seed, moving=False, lengths=one.lengths())
        q, mech = one.put(values), one.mech
        for name, muscle in one.muscles.items():
            muscle.setActivation(one.state, a)
            mech = mech.edit(name, start=a)
        one.theirs.equilibrateMuscles(one.state)
        one.theirs.realizeDynamics(one.state)
        run = mech.simulate(q=q, t_end=1e-6, frames=2, method="rk4", step=1e-6, estimate=False)
        for name, muscle in one.muscles.items():
            ours, theirs = run.tension[name][0], muscle.getTendonForce(one.state)
            kind, scale = muscle.getConcreteClassName(), muscle.getMaxIsometricForce()
            assert abs(ours - theirs) < KINDS[kind] * scale, (name, values, a)
