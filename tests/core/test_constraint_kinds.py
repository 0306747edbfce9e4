"""Every kind of constraint: dense rows against differences, kernels against dense algebra."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.analysis.rows import Rows, apart
from pgraph_core.paper import Operators
from tests.oracle.constraint_rows import prescribed, radius_of_gyration, rows_of

from ..nights import combined
from ..oracle.constrained import constrained_dynamics
from .trees import moved, random_case, random_model, random_state, scaled_error

EPS = 1e-4  # rad, m: central differences of order 4 are good to EPS^4 and rounding / EPS
ROWS = {
    "point": 3, "weld": 6, "revolute": 5, "prismatic": 5, "cylindrical": 4, "universal": 4,
    "distance": 1, "line": 2, "plane": 1, "orientation": 3, "gear": 1, "relation": 1, "motion": 1,
    "rolling": 3, "skate": 1, "velocity": 1, "disc": 3, "curve_point": 2,
}  # fmt: skip
ROLLING = ("rolling", "disc")
SCALAR = ("revolute", "prismatic", "universal", "cylindrical", "planar")
IN_JOINTS = ("gear", "relation", "motion")
WITHOUT_DEFAULTS = (*IN_JOINTS, "rolling", "disc", "curve_point")
RELATIONS = (
    pg.Polynomial(coefficients=(0.1, 0.2, -0.3, 0.4, 0.05)),
    pg.Curve(x=(-0.8, 0.1, 0.5, 1.2), value=(0.2, 0.4, -0.3, 0.9), kind="periodic"),
    pg.Curve(x=(-0.8, 0.1, 0.5, 1.2), value=(0.2, 0.4, -0.3, 0.9), kind="quintic"),
)
CURVES = (
    pg.Sine(mean=0.1, amplitude=0.4, frequency=3.0, phase=0.2),
    pg.Polynomial(coefficients=(0.1, 0.2, -0.3, 0.4)),
    pg.Table(t=(0.0, 0.5, 0.7, 2.0), value=(0.0, 1.0, -0.5, 0.3)),
)


def case(kind, seed):
    rng = np.random.default_rng(seed)
    kinds = SCALAR if kind in IN_JOINTS else (*SCALAR, "spherical", "free")
    model = random_model(rng, 5, kinds, roots=2)
    a, b = rng.choice(5, 2, replace=False)
    alone = kind in ("motion", "velocity") or (seed % 2 and kind not in ("gear", "relation"))
    fields = {"body": f"b{a}", "other": "ground" if alone else f"b{b}"}
    takes = pg.Constraint.KINDS["rolling" if kind == "disc" else kind].model_fields
    for name in ("point", "other_point", "axis", "other_axis"):
        if name in takes:
            fields[name] = tuple(rng.normal(size=3))
    if kind in ("line", "plane", "rolling"):
        del fields["axis"]
    if kind == "prismatic":
        del fields["axis" if seed % 3 else "other_axis"]
    if kind in ROLLING:
        fields["radius"] = 0.7
    if kind == "gear":
        fields |= {"ratio": -1.7, "offset": 0.3}
    if kind == "curve_point":
        fields |= {"curve": beside(rng, model, fields), "closed": bool(seed % 2)}
    if kind == "relation":
        fields |= {"curve": RELATIONS[seed % 3]}
    if kind == "motion":
        fields["q_of_t"] = CURVES[seed % 3]
    if kind == "velocity":
        dof = [model.body(f"b{k}").dof for k in (a, b)]
        values = {f"b{k}": tuple(rng.normal(size=n)) for k, n in zip((a, b), dof)}
        fields |= {"coefficients": values, "value": 0.4}
    c = pg.Constraint(name="c", kind="rolling" if kind == "disc" else kind, **fields)
    model = model.replace(constraints=(c,))
    return random_state(rng, model), c


def beside(rng, model, fields):
    """A flat curve in a random plane that passes by the point in the initial state."""
    tree = pg.Mechanism(model)
    position, rotation = tree.poses(tree.home()[0])
    a, b = (tree.topology.number(fields[name]) - 1 for name in ("body", "other"))
    place = position[a] + rotation[a] @ fields["point"]
    place = rotation[b].T @ (place - position[b]) if b >= 0 else place
    across, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = 4.0 * np.array(((-1.0, 0.3), (-0.2, 0.1), (0.7, -0.2), (1.5, 0.5), (0.8, 1.4)))
    return place + 0.1 * rng.normal(size=3) + flat @ across[:2]


def rows_at(s, c, q, v, t=0.0):
    op = Operators(s.model, s.topology, q, v)
    return rows_of(op, c, radius_of_gyration(op), t)


def rate(f, s):
    """d/dt of f(q) along v, by central differences of order 4."""
    one, two = (
        f(moved(s.model, s.q, k * EPS * s.v)) - f(moved(s.model, s.q, -k * EPS * s.v))
        for k in (1, 2)
    )
    return (8 * one - two) / (12 * EPS)


@pytest.mark.parametrize(("kind", "seed"), combined(ROWS, range(2)))
def test_jacobian_and_drift_are_the_derivatives_of_the_residual(kind, seed):
    s, c = case(kind, seed)
    rows = rows_at(s, c, s.q, s.v)
    assert len(rows.J) == ROWS[kind]
    holonomic = kind not in ("skate", "velocity")
    count = 1 if kind in ROLLING else ROWS[kind] if holonomic else 0  # of a wheel only the gap
    found = rate(lambda q: rows_at(s, c, q, s.v).residual[:count], s)
    size = np.linalg.norm(rows.J, axis=1).max() * np.linalg.norm(s.v)
    np.testing.assert_allclose(rows.J[:count] @ s.v, found, atol=1e-10 * size)
    bent = rate(lambda q: rows_at(s, c, q, s.v).J @ s.v, s)
    moving = prescribed(c.q_of_t, 0.0)[2] if kind == "motion" else 0.0
    np.testing.assert_allclose(rows.drift + moving, bent, atol=1e-9 * size * (1 + size))


@pytest.mark.parametrize("kind", [k for k in ROWS if k not in WITHOUT_DEFAULTS])
def test_omitted_points_and_axes_hold_in_the_initial_state(kind):
    s, c = case(kind, 3)
    if kind not in ("distance", "velocity"):
        left = {k: {"axis": (1, 2, 3)} for k in ("line", "plane", "skate")}
        c = pg.Constraint(name="c", kind=kind, body="b3", other="b1", **left.get(kind, {}))
    q, _ = pg.Mechanism(s.model).home()
    np.testing.assert_allclose(rows_at(s, c, q, s.v).residual, 0.0, atol=1e-14)


@pytest.mark.parametrize(("kind", "seed"), combined(ROWS, range(2)))
def test_kernels_equal_the_dense_pseudo_inverse(kind, seed):
    """Accelerations and forces, at states that the constraint does not hold in, too."""
    s, c = case(kind, seed)
    vdot, force = pg.Mechanism(s.model).constrained_dynamics(s.q, s.v, s.tau)
    op = Operators(s.model, s.topology, s.q, s.v)
    expected, forces = constrained_dynamics(op, s.tau)
    assert scaled_error(vdot, expected) < 1e-9
    if kind != "velocity":  # of which the force is that of its first coefficient alone
        assert scaled_error(force["c"], forces["c"]) < 1e-9


@pytest.mark.parametrize(("seed", "t"), [(0, 0.6), (1, 0.2), (2, 0.0), (2, 0.6), (2, 3.0)])
@pytest.mark.parametrize("kind", ROWS)
def test_rows_of_the_kernels_are_those_of_the_operators(kind, seed, t):
    """Directions normal to an axis may be any two, so their span and its measure are compared."""
    s, c = case(kind, seed)
    expected = rows_at(s, c, s.q, s.v, t)
    found = Rows.of(pg.Mechanism(s.model), np.zeros(1, dtype=np.int64), s.q, s.v, t)
    assert len(found.J) == ROWS[kind] == c.ROWS
    slip = expected.J @ s.v - expected.speed
    for mine, theirs in ((found.gap, expected.residual), (found.slip, slip)):
        size = np.linalg.norm(theirs)
        assert scaled_error(mine @ found.J, theirs @ expected.J) < 1e-12
        assert abs(np.linalg.norm(mine) - size) < 1e-12 * (1 + size)
    assert scaled_error(found.J.T @ found.J, expected.J.T @ expected.J) < 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_a_finite_move_is_taken_back_by_its_own_size(seed):
    s = random_case(seed)
    mech, step = pg.Mechanism(s.model), 0.3 * s.v
    q = Rows.of(mech, np.zeros(0, dtype=np.int64), s.q).advanced(step)
    assert scaled_error(q, moved(s.model, s.q, step)) < 1e-12
    assert scaled_error(apart(mech, s.q, q), step) < 1e-12


@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"rtol": 1e-6, "step": 4e-3}])
def test_a_gear_between_rotors_without_lengths(options):
    """Nothing has a size in metres, so the last digit of an angle must not count as a gap."""
    ratio, offset, push = 0.0183, 0.4038, 2.0
    bodies = tuple(pg.Body(name=n, q=(x,), inertia=np.eye(3)) for n, x in (("a", 0), ("b", offset)))
    tie = pg.Gear(name="tie", body="b", other="a", ratio=ratio, offset=offset)
    motor = pg.Motor(name="motor", body="a", torque=push)
    model = pg.Model(bodies=bodies, constraints=(tie,), forces=(motor,))
    run = pg.simulate(model, t_end=0.8, method="radau5", frames=101, **options)
    assert run.status.ok, run.message
    exact = 0.5 * push / (1 + ratio**2) * run.t**2
    np.testing.assert_allclose(run.q, np.column_stack((exact, ratio * exact + offset)), atol=1e-9)
    assert np.isfinite(run.error_estimate)


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0)])
@pytest.mark.parametrize("ratio", [3.0, -0.5])
def test_the_torque_of_a_gear_in_the_second_joint_is_that_in_the_first_times_minus_ratio(
    axis, ratio
):
    """Inertia times acceleration of each rotor is the torque on it, also across crossed axes."""
    first, second = (
        pg.Body(name=n, axes=a, inertia=np.eye(3)) for n, a in (("a", (0, 0, 1)), ("b", axis))
    )
    tie = pg.Gear(name="tie", body="a", other="b", ratio=ratio)
    push = pg.Motor(name="push", body="a", torque=1.0)
    model = pg.Model(bodies=(first, second), constraints=(tie,), forces=(push,))
    run = pg.simulate(model, t_end=0.1)
    torque = run.constraint_force["tie"][0, 2]
    assert run.vdot[0] == pytest.approx([1.0 + torque, -ratio * torque], rel=1e-12)
    assert run.vdot[0, 0] == pytest.approx(ratio * run.vdot[0, 1], rel=1e-12)


@pytest.mark.parametrize(
    ("curve", "begin"), combined([*CURVES, pg.Polynomial(coefficients=(0.3,))], [-4.0, -1.0, 0.25])
)
def test_motions_hold_for_all_times(curve, begin):
    """A polynomial and a sine before t = 0 too; a table is constant before its first knot."""
    at = np.linspace(begin, begin + 4.0, 9)
    start = prescribed(curve, begin)
    body = pg.Body(name="b", joint="prismatic", q=start[:1], v=start[1:2])
    drive = pg.Motion(name="m", body="b", q_of_t=curve)
    model = pg.Model(bodies=(body,), constraints=(drive,))
    run = pg.simulate(model, t_start=begin, t_end=begin + 4.0, t_eval=at)
    known = np.array([prescribed(curve, t) for t in at])
    size = np.abs(known).max()
    assert run.q[:, 0] == pytest.approx(known[:, 0], abs=1e-9 * size)
    assert run.v[:, 0] == pytest.approx(known[:, 1], abs=1e-9 * size)
    assert run.vdot[:-1, 0] == pytest.approx(known[:-1, 2], abs=1e-9 * size)


@pytest.mark.parametrize("method", ["rk4", "dopri5", "radau5", "semi_implicit_euler"])
@pytest.mark.parametrize(("size", "time"), [(0.05, 1.0), (-2.0, 10.0), (1e-4, 0.1)])
def test_a_monotone_motion_stays_between_its_knots(method: str, size: float, time: float):
    """The values of a kerb, where a spline swings out by half of its height."""
    t, value = np.array([0.0, 0.1, 0.12, 0.2]) * time, np.array([0.0, 0.0, 1.0, 1.0]) * size
    kerb = {"t": t, "value": value}
    runs = {}
    for interpolation in ("spline", "monotone"):
        drive = pg.Motion(name="m", body="b", q_of_t=kerb, interpolation=interpolation)
        body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1))
        model = pg.Model(bodies=(body,), constraints=(drive,))
        assert pg.Model.from_json(model.to_json()) == model
        runs[interpolation] = pg.simulate(
            model, t_end=0.25 * time, method=method, step=1e-3 * time, frames=251
        )
    low, high = sorted((0.0, size))
    assert np.ptp(runs["spline"].q) > 1.5 * abs(size)
    run = runs["monotone"]
    assert run.status.ok, run.message
    assert run.q.min() == pytest.approx(low, abs=1e-9 * abs(size))
    assert run.q.max() == pytest.approx(high, abs=1e-9 * abs(size))
    assert (np.diff(run.q[:, 0]) * size >= -1e-12 * size**2).all()
    s = np.clip((run.t - t[1]) / (t[2] - t[1]), 0.0, 1.0)  # zero slopes: a cubic step
    np.testing.assert_allclose(run.q[:, 0], size * s**2 * (3 - 2 * s), atol=1e-9 * abs(size))
