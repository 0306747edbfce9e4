"""Marker tracking: the motion of a mechanism that follows the markers of a trial."""

import numpy as np

import pgraph_core as pg
from pgraph_core.capture.filters import moved
from pgraph_core.capture.markers import Markers, advanced
from pgraph_core.capture.smoothing import _jerk
from pgraph_core.capture.trial import Trial

from ..refusals import assert_names, refusal


def placed(mech, q, sites=None):
    """The places {site: (n, 3)} of sites in a motion q (n, nq)."""
    poses = [mech.pose(x) for x in q]
    names = sites or [s.name for s in mech.model.sites]
    return {name: np.array([pose[name].position for pose in poses]) for name in names}


def trial_of(mech, q, t=None, noise=0.0, sites=None):
    """A trial of markers at the sites of a motion, with normal errors [m]."""
    rng = np.random.default_rng(5)
    markers = placed(mech, q, sites)
    t = np.arange(len(q)) / 100 if t is None else t
    return Trial(t=t, markers={k: x + noise * rng.normal(size=x.shape) for k, x in markers.items()})


def sites(*bodies):
    """Three sites on each body, not in line."""
    points = {"a": (0.1, 0.02, 0), "b": (0.0, 0.1, 0.03), "c": (0.05, 0, -0.1)}
    return [pg.Site(name=f"{b}.{k}", body=b, point=p) for b in bodies for k, p in points.items()]


def walker():
    """A trunk that floats, with ball hips, hinged knees, and a cylindrical joint."""
    bodies = [pg.Body(name="trunk", joint="free", mass=5)]
    for side, y in (("l", 0.1), ("r", -0.1)):
        bodies += [
            pg.Body(name=f"thigh {side}", parent="trunk", joint="spherical", link=(0, y, -0.1)),
            pg.Body(name=f"shank {side}", parent=f"thigh {side}", axes=(0, 1, 0),
                    link=(0, 0, -0.4)),
        ]  # fmt: skip
    bodies.append(pg.Body(name="arm", parent="trunk", joint="cylindrical", link=(0, 0, 0.3)))
    return pg.Mechanism(pg.Model(bodies=bodies, sites=sites(*[b.name for b in bodies])))


def strides(mech, n=40):
    """A smooth motion, in which the trunk travels and turns by more than a full turn."""
    t, rng = np.arange(n) / 100, np.random.default_rng(2)
    size, phase = 3 * rng.uniform(0.3, 1, mech.nv), rng.uniform(0, 6, mech.nv)
    q, found = mech.home()[0][None], []
    for x in t:
        v = size * np.cos(9 * x + phase)
        v[2] = 17.0
        q = advanced(mech, q, v[None] * 0.01)
        found.append(q[0])
    return np.array(found)


def same(mech, a, b):
    """The largest difference of two motions, of poses for attitudes."""
    pairs = ((mech.poses(x), mech.poses(y)) for x, y in zip(a, b))
    return max(
        np.abs(np.hstack((p[0] - r[0], (p[1] - r[1]).reshape(-1, 9)))).max() for p, r in pairs
    )


def test_markers_without_noise_give_the_motion_of_a_tree():
    mech = walker()
    q = strides(mech)
    fit = pg.track(mech, trial_of(mech, q))
    assert same(mech, fit.q, q) < 1e-10
    assert np.nanmax(fit.residual) < 1e-10
    assert fit.gradient.max() < 1e-10
    assert fit.undetermined == ()
    assert np.allclose(
        np.abs(np.diff(fit.q[:, :3], axis=0)).max(), np.abs(np.diff(q[:, :3], axis=0)).max()
    )


def four_bar():
    hinged = {"axes": (0, 1, 0), "inertia": (0.1, 0.1, 0.1)}
    crank, coupler, rocker = (
        pg.Body(name="crank", **hinged),
        pg.Body(name="coupler", parent="crank", link=(0.3, 0, 0), q=0.9, **hinged),
        pg.Body(name="rocker", link=(0.8, 0, 0), q=1.7, **hinged),
    )
    close = pg.Point(
        name="close", body="coupler", point=(0.7, 0, 0), other="rocker", other_point=(0.5, 0, 0)
    )
    marks = sites("crank", "coupler", "rocker")
    return pg.Mechanism(pg.Model(bodies=[crank, coupler, rocker], constraints=[close], sites=marks))


def opened(mech, q):
    """The largest distance of the two ends of the four-bar's loop."""
    ends = [(mech.pose(x, "coupler").place((0.7, 0, 0)), mech.pose(x, "rocker").place((0.5, 0, 0)))
            for x in q]  # fmt: skip
    return max(np.linalg.norm(a - b) for a, b in ends)


def turned_crank(mech, n=30):
    """The motion for turns of the crank, by the triangle of coupler, rocker and diagonal."""
    crank = -0.4 + 2.0 * np.sin(np.linspace(0, 2, n))
    joint = 0.3 * np.exp(1j * crank)
    far = 0.8 - joint  # from the crank's end to the rocker's pivot
    angle = np.arccos((0.7**2 + np.abs(far) ** 2 - 0.5**2) / (2 * 0.7 * np.abs(far)))
    coupler = np.angle(far) + angle
    rocker = np.angle(joint + 0.7 * np.exp(1j * coupler) - 0.8)
    return np.unwrap(np.stack((crank, coupler - crank, rocker), axis=1), axis=0)


def test_markers_without_noise_give_the_motion_of_a_loop():
    mech = four_bar()
    q = turned_crank(mech)
    fit = pg.track(mech, trial_of(mech, q))
    assert same(mech, fit.q, q) < 1e-10
    noisy = pg.track(mech, trial_of(mech, q, noise=0.005))
    # loops stay closed, to rounding, where markers would open them
    assert opened(mech, noisy.q) < 1e-11
    assert noisy.gradient.max() < 1e-9


def test_the_cost_is_least_and_the_gradient_zero():
    """No step of a few sizes in any direction makes the sum of squares smaller."""
    mech = walker()
    trial = trial_of(mech, strides(mech, 5), noise=0.02)
    weights = {"trunk.a": 3.0, "arm.b": 0.2}
    fit = pg.track(mech, trial, weights=weights)
    problem = Markers.of(mech, trial, weights, None)
    frames, rng = np.arange(5), np.random.default_rng(0)
    assert np.allclose(problem.normal(fit.q, frames)[0], fit.cost, rtol=1e-12)
    for size in (1e-1, 1e-3, 1e-5):
        other = advanced(mech, fit.q, size * rng.normal(size=(5, mech.nv)))
        assert (problem.normal(other, frames)[0] > fit.cost).all()


def test_a_marker_that_is_not_seen_has_no_weight():
    mech = walker()
    q = strides(mech)
    trial = trial_of(mech, q)
    trial.markers["trunk.a"][3:9] = np.nan
    fit = pg.track(mech, trial)
    assert same(mech, fit.q, q) < 1e-10
    assert np.isnan(fit.residual[3:9, fit.markers.index("trunk.a")]).all()
    for x in trial.markers.values():
        x[20] = np.nan
    fit = pg.track(mech, trial)
    assert np.isfinite(fit.q).all()
    assert_names(repr(fit), "no marker is seen in 1 frame")


def test_limits_hold():
    body = pg.Body(name="arm", axes=(0, 1, 0), limits=(-0.5, 0.5))
    free = pg.Mechanism(pg.Model(bodies=[pg.Body(name="arm", axes=(0, 1, 0))], sites=sites("arm")))
    mech = pg.Mechanism(pg.Model(bodies=[body], sites=sites("arm")))
    q = np.linspace(-1, 1, 21)[:, None]
    fit = pg.track(mech, trial_of(free, q))
    assert np.abs(fit.q - np.clip(q, -0.5, 0.5)).max() < 1e-10


def test_a_limit_of_a_loop_holds():
    mech = four_bar()
    q = turned_crank(mech)
    top = float(q[:, 0].max()) - 0.3
    bound = pg.Mechanism(mech.model.edit("crank", limits=(None, top)))
    fit = pg.track(bound, trial_of(mech, q))
    over = q[:, 0] > top
    assert over.any()
    assert np.abs(fit.q[over, 0] - top).max() < 1e-9
    assert same(mech, fit.q[~over], q[~over]) < 1e-9


def test_what_markers_do_not_show_is_named_and_stays():
    mech = walker()
    names = [s.name for s in mech.model.sites if s.body not in ("shank l", "arm")]
    trial = trial_of(mech, strides(mech), sites=names)
    fit = pg.track(mech, trial)
    assert_names(repr(fit), "3 directions", "shank l", "arm.0", "arm.1", "sites without a marker")
    assert np.ptp(fit.q[:, mech.joints["shank l"].q]) < 1e-12
    few = [x for x in names if x not in ("shank r.a", "shank r.b", "shank r.c")]
    assert_names(
        pg.track(mech, trial_of(mech, strides(mech, 5), sites=few)).undetermined[0], "shank r"
    )


def test_exchanged_markers_are_named():
    mech = walker()
    trial = trial_of(mech, strides(mech), noise=0.001)
    a, b = trial.markers["shank l.a"], trial.markers["shank l.b"]
    a[10:15], b[10:15] = b[10:15].copy(), a[10:15].copy()
    assert_names(repr(pg.track(mech, trial)), "shank l.a and shank l.b look exchanged in 5 frames")


def test_markers_in_another_unit_are_named():
    mech = walker()
    trial = trial_of(mech, strides(mech, 2))
    large = Trial(t=trial.t, markers={k: 1000 * x for k, x in trial.markers.items()})
    assert_names(repr(pg.track(mech, large)), "is the unit right", "units='mm'")
    assert "unit" not in repr(pg.track(mech, trial))


def test_calls_that_fit_no_model_are_refused():
    mech = walker()
    trial = trial_of(mech, strides(mech, 3))
    for call, *facts in (
        (lambda: pg.track(mech, 3), "trial", "pg.read_trial"),
        (lambda: pg.track(mech, trial, weights={"heel": 1}), "weights", "'heel'", "trunk.a"),
        (lambda: pg.track(mech, trial, weights={"arm.a": -1}), "weights", "'arm.a'", ">= 0"),
        (lambda: pg.track(mech, trial, markers={"arm.a": "X"}), "markers", "'X'", "arm.a"),
        (lambda: pg.track(mech, trial, smooth=-2), "smooth", "-2"),
        (lambda: pg.track(pg.Model.serial(2), trial), "trial", "sites", "none"),
    ):
        assert_names(str(refusal(call)), *facts)


def test_a_progress_function_stops_the_call():
    mech, told = walker(), []
    trial = trial_of(mech, strides(mech))

    def stop(fraction):
        told.append(fraction)
        return False

    assert_names(str(refusal(lambda: pg.track(mech, trial, progress=stop))), "stopped")
    assert len(told) == 1
    told.clear()
    pg.track(mech, trial, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_a_tracked_joint_drives_a_run():
    mech = four_bar()
    fit = pg.track(mech, trial_of(mech, turned_crank(mech)))
    drive = fit.motion("crank")
    run = pg.simulate(mech.model.replace(constraints=[*mech.model.constraints, drive]), t_end=0.2,
                      q=fit.q[0])  # fmt: skip
    assert np.abs(run["crank"][-1] - np.interp(0.2, fit.t, fit.q[:, 0])) < 1e-4


def test_a_table_of_the_fit_has_units(tmp_path):
    mech = walker()
    fit = pg.track(mech, trial_of(mech, strides(mech, 3)))
    head = fit.to_csv(tmp_path / "ik.csv").splitlines()[0].split(",")
    assert head[:2] == ["t [s]", "trunk.0 [m]"]
    assert "shank l [rad]" in head
    assert "residual.arm.a [m]" in head
    assert (tmp_path / "ik.csv").read_text() == fit.to_csv()
    again = pg.read_trial(tmp_path / "ik.csv")
    assert np.allclose(again.coordinates["shank l"], fit.q[:, mech.joints["shank l"].q.start])


def test_smoothing_gives_velocities_and_accelerations_of_noisy_markers():
    """The weight by cross-validation; errors of accelerations are a hundredth of differences'."""
    mech, t = walker(), np.arange(80) / 100
    q = strides(mech, 80)
    fit = pg.track(mech, trial_of(mech, q, noise=0.001), smooth=True)
    alone = pg.track(mech, trial_of(mech, q, noise=0.001))
    _, v, a = moved(mech, t, q, np.inf, 1)
    _, rough, rougher = moved(mech, t, alone.q, np.inf, 1)
    middle = slice(10, -10)
    rms = lambda x: float(np.sqrt(np.mean(x[middle] ** 2)))  # noqa: E731
    assert rms(fit.v - v) < 0.2 * rms(rough - v)
    assert rms(fit.vdot - a) < 0.02 * rms(rougher - a)
    assert 0 < fit.smooth < np.inf


def test_a_smoothed_motion_is_the_least_of_its_sum():
    mech = walker()
    trial, rng = trial_of(mech, strides(mech, 20), noise=0.002), np.random.default_rng(0)
    fit = pg.track(mech, trial, smooth=1e-8)
    problem, frames = Markers.of(mech, trial, None, None), np.arange(20)

    def total(q):
        return problem.normal(q, frames)[0].sum() + 1e-8 * (_jerk(problem, q)[0] ** 2).sum()

    least = total(fit.q)
    for size in (1e-2, 1e-4, 1e-5):
        step = size * rng.normal(size=(20, mech.nv))
        assert total(advanced(mech, fit.q, step)) > least
    # the derivative of the penalty, whose attitudes turn far between frames
    h, way = 1e-6, rng.normal(size=(20, mech.nv))
    ends = [_jerk(problem, advanced(mech, fit.q, s * way))[0] for s in (h, -h)]
    slope = _jerk(problem, fit.q)[1] @ way.ravel()
    assert np.abs((ends[0] - ends[1]) / (2 * h) - slope).max() < 1e-6 * np.abs(slope).max()


def test_smoothing_passes_over_frames_without_markers_and_keeps_loops():
    mech = four_bar()
    q = turned_crank(mech)
    trial = trial_of(mech, q)
    for x in trial.markers.values():
        x[12:15] = np.nan
    fit = pg.track(mech, trial, smooth=1e-15)
    assert np.abs(fit.q - q).max() < 1e-3
    assert opened(mech, fit.q) < 1e-11
    few = trial_of(mech, q[:5])
    assert_names(str(refusal(lambda: pg.track(mech, few, smooth=True))), "smooth", "8 frames", "5")
