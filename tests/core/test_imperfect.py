"""Imperfect outputs: noise of a given density, bias and walk, delay, range and resolution."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.result.measured import errors, normals

from ..refusals import assert_names, refusal

N = 1_000_000
STEP = 0.01  # [s] between samples


def allan(y, m):
    """Return the overlapping Allan deviation of samples y for clusters of m (IEEE Std 952)."""
    phase = np.concatenate(([0.0], np.cumsum(y)))
    second = phase[2 * m :] - 2.0 * phase[m:-m] + phase[: -2 * m]
    return math.sqrt(np.mean(second**2) / 2.0) / m


def drawn(**fields):
    given = pg.Imperfect(sample=STEP, seed=3, **fields)
    return errors(given, "gyro", 0, N - 1)


@pytest.mark.parametrize("m", [1, 10, 100])
def test_white_noise_has_its_density(m):
    """σ(τ) = N / √τ."""
    assert abs(allan(drawn(density=2e-3), m) / (2e-3 / math.sqrt(m * STEP)) - 1.0) < 0.03


@pytest.mark.parametrize("m", [10, 100, 200])
def test_a_walk_has_its_rate(m):
    """σ(τ) = K √(τ/3) for clusters of many samples, with 1/(2 m²) of their own variance."""
    found, tau = allan(drawn(walk=5e-3), m), m * STEP
    assert abs(found / (5e-3 * math.sqrt(tau / 3.0 * (1.0 + 0.5 / m**2))) - 1.0) < 0.03


@pytest.mark.parametrize("m", [20, 100, 190])
def test_a_bias_is_a_gauss_markov_process(m):
    """σ²(τ) = 2 B² T/τ (1 - T/(2τ) (3 - 4 e^(-τ/T) + e^(-2τ/T))), with T = 1 s here."""
    found, x = allan(drawn(bias=0.02, correlation=1.0), m), m * STEP
    wanted = 2.0 * 0.02**2 / x * (1.0 - (3.0 - 4.0 * math.exp(-x) + math.exp(-2.0 * x)) / (2.0 * x))
    assert abs(found / math.sqrt(wanted) - 1.0) < 0.03
    if m == 20:
        assert abs(drawn(bias=0.02, correlation=1.0).std() / 0.02 - 1.0) < 0.03


def test_numbers_are_normal_and_belong_to_their_names():
    every = np.array([normals(seed, name, 0, N // 4) for seed in (0, 1) for name in ("a", "b")])
    n = every.shape[1]
    assert np.abs(every.mean(axis=1)).max() < 5.0 / math.sqrt(n)
    assert np.abs(np.corrcoef(every) - np.eye(4)).max() < 5.0 / math.sqrt(n)
    for x in every:
        assert abs(np.mean(x[1:] * x[:-1])) < 5.0 / math.sqrt(n)
        counts, _ = np.histogram(x, [-np.inf, -2, -1, 0, 1, 2, np.inf])
        share = np.diff(
            [0.0, *(0.5 * (1 + math.erf(z / math.sqrt(2))) for z in (-2, -1, 0, 1, 2)), 1]
        )
        assert np.abs(counts - n * share).max() < 5.0 * math.sqrt(n)


def test_a_number_is_a_function_of_its_index():
    """The digits are those of exact arithmetic, on every processor."""
    whole = normals(7, "x", -5, 100)
    assert np.array_equal(whole[20:30], normals(7, "x", 15, 24))
    assert normals(7, "x", 3, 3)[0] == whole[8]
    mpmath = pytest.importorskip("mpmath")
    from pgraph_core.result.measured import _cos_of_turns, _log

    u = np.array([1e-15, 0.1, 0.25, 0.499999, 0.5, 0.75, 0.9, 1.0 - 1e-15])
    for x, log, cos in zip(u, _log(u), _cos_of_turns(u)):
        assert abs(log - float(mpmath.log(x))) <= 4e-16 * max(abs(log), 1e-15)
        assert abs(cos - float(mpmath.cos(2 * mpmath.pi * mpmath.mpf(float(x))))) < 2e-15


def arm(**fields):
    body = pg.Body(name="arm", axes=(0, 1, 0), com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1))
    site = pg.Site(name="tip", body="arm", point=(0.5, 0.1, 0))
    outputs = [
        pg.Output(name=kind, kind=kind, at="tip", imperfect=pg.Imperfect(**fields))
        for kind in ("gyro", "accelerometer")
    ]
    angle = pg.Output(name="angle", kind="joint_position", at="arm", imperfect=fields)
    return pg.Model(bodies=[body], sites=[site], outputs=[*outputs, angle])


NOISY = {"sample": 0.02, "density": 0.01, "bias": 0.1, "correlation": 2.0, "walk": 0.1, "seed": 5}


def test_errors_do_not_depend_on_the_method_the_step_or_the_start():
    def noise(run, name="gyro"):
        samples = run.measured[name]
        return samples.t, samples.value - samples.true

    model = arm(**NOISY)
    t, whole = noise(pg.simulate(model, t_end=1.0))
    assert np.array_equal(t, 0.02 * np.arange(51))
    for options in (
        {"method": "rk4", "step": 1e-3},
        {"method": "rk4", "step": 3e-3},
        {"frames": 7},
    ):
        assert np.abs(noise(pg.simulate(model, t_end=1.0, **options))[1] - whole).max() < 1e-14
    first = pg.simulate(model, t_end=0.5)
    later = pg.simulate(model, start=first, t_end=1.0)
    assert np.abs(noise(later)[1] - whole[25:]).max() < 1e-14
    assert np.abs(noise(pg.simulate(model, t_end=1.0), "accelerometer")[1] - whole).min() > 1e-6


def test_samples_are_read_at_frames_of_the_run():
    run = pg.simulate(arm(sample=0.013, latency=0.0195), t_end=1.0)
    samples = run.measured["angle"]
    read = np.maximum(samples.t - 0.0195, 0.0)
    near = np.abs(run.t[:, None] - read).argmin(axis=0)
    assert np.abs(run.t[near] - read).max() < 1e-15
    assert np.array_equal(samples.value, run["arm"][near])
    asked = pg.simulate(arm(sample=0.013), t_end=1.0, frames=11)
    assert len(asked.t) == 11


def test_a_latency_shifts_the_phase():
    """Latency of 1.5 samples, on a motion that is a given sine."""
    body = pg.Body(name="arm", axes=(0, 1, 0), inertia=(1, 1, 1))
    turn = pg.Motion(name="turn", body="arm", q_of_t=pg.Sine(amplitude=1.0, frequency=2.0))
    angle = pg.Output(
        name="angle", kind="joint_position", at="arm", imperfect={"sample": 0.01, "latency": 0.015}
    )
    run = pg.simulate(pg.Model(bodies=[body], constraints=[turn], outputs=[angle]), t_end=1.0)
    samples = run.measured["angle"]
    wanted = np.sin(2.0 * np.maximum(samples.t - 0.015, 0.0))
    assert np.abs(samples.value - wanted).max() < 1e-9


def test_an_accelerometer_contains_an_impact_that_is_stepped():
    """The sum of the samples times their width is the change of velocity, plus gravity."""
    shape = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    box = pg.Body(name="box", joint="free", shape=shape, derived=("inertia",))
    model = pg.Model(
        bodies=[box],
        contacts=[pg.Contact(name="floor", body="box", other="ground")],
        outputs=[pg.Output(name="imu", kind="accelerometer", at="box", imperfect={"sample": 0.01})],
    )
    run = pg.simulate(model, q=[0, 0, 0.2, 1, 0, 0, 0], t_end=0.4, method="moreau_jean", step=1e-3)
    felt = run.measured["imu"].true
    assert np.isfinite(felt).all()
    change = run.velocity["box"][-1] - run.velocity["box"][0]
    assert np.abs(0.01 * felt[1:].sum(axis=0) - change - [0, 0, 9.81 * 0.4]).max() < 1e-12
    assert felt[:, 2].max() > 50.0  # of about 1.4 m/s in 0.01 s
    assert np.abs(felt[0]).max() < 1e-12  # in free fall
    assert np.abs(felt[-1] - [0, 0, 9.81]).max() < 1e-6


def test_a_mean_tends_to_the_value_at_a_point():
    def off(sample):
        run = pg.simulate(arm(sample=sample), t_end=0.5, rtol=1e-11)
        samples = run.measured["accelerometer"]
        exact = run.outputs["accelerometer"][np.searchsorted(run.t, samples.t - 1e-9)]
        return np.abs(samples.true - exact)[1:].max()

    assert off(0.001) < 0.6 * off(0.002) < 0.4 * off(0.004)


def test_values_are_limited_and_then_rounded():
    run = pg.simulate(
        arm(sample=0.01, offset=0.3, quantum=0.25, low=-0.3, high=0.6), q=[-1.0], t_end=2.0
    )
    samples = run.measured["angle"]
    assert np.array_equal(
        samples.value, 0.25 * np.rint(np.clip(samples.true + 0.3, -0.3, 0.6) / 0.25)
    )
    assert set(samples.value) == {-0.25, 0.0, 0.25, 0.5}


def test_an_imu_reads_as_outputs_do():
    run = pg.simulate(arm(sample=0.1), t_end=0.5)
    imu = run.imu("tip")
    assert np.array_equal(imu.acceleration, run.outputs["accelerometer"])
    assert np.array_equal(imu.angular_velocity, run.outputs["gyro"])
    assert np.array_equal(imu.t, run.t)
    assert_names(str(refusal(lambda: run.imu("gone"))), "gone", "tip", "arm")


def test_a_saved_run_has_the_same_samples(tmp_path):
    run = pg.simulate(arm(**NOISY), t_end=0.3)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert again.model == run.model
    assert np.array_equal(again.measured["gyro"].value, run.measured["gyro"].value)
    assert '"schema_version": 10' in run.model.to_json()
    assert (
        '"schema_version": 3'
        in arm(sample=1)
        .edit("gyro", imperfect=None)
        .edit("accelerometer", imperfect=None)
        .edit("angle", imperfect=None)
        .to_json()
    )


def test_refusals():
    def refused(make, *facts):
        assert_names(str(refusal(make)), *facts)

    refused(lambda: pg.Imperfect(density=1.0), "sample", "missing")
    refused(lambda: pg.Imperfect(sample=0.0), "sample", "> 0")
    for name in ("density", "latency", "quantum", "walk", "bias"):
        refused(lambda name=name: pg.Imperfect(sample=1.0, **{name: -0.5}), name, ">= 0", "-0.5")
    refused(lambda: pg.Imperfect(sample=1.0, low=2.0, high=1.0), "low", "high = 1", "2")
    refused(lambda: pg.Imperfect(sample=1.0, bias=1.0), "correlation")
    refused(lambda: pg.Imperfect(sample=1.0, bias=1.0, correlation=0.5), "sample = 1", "0.5")
    refused(
        lambda: pg.Output(name="a", kind="rotation", at="b", imperfect={"sample": 1.0}),
        "imperfect", "rotation", "gyro",
    )  # fmt: skip
    refused(lambda: arm(sample=0.1, noise=1), "noise", "density")
    fast = arm(sample=1e-4)
    refused(lambda: pg.simulate(fast, t_end=1.0, method="rk4", step=1e-3), "gyro", "step=0.0001")
    refused(lambda: pg.simulate(arm(sample=0.1, latency=2.0), t_end=1.0), "latency", "2 s", "1 s")
    refused(lambda: pg.simulate(arm(sample=1e-9), t_end=1.0), "samples", "allowed")
    run = pg.simulate(arm(sample=0.1), t_end=0.2)
    refused(lambda: run.measured["none"], "none", "gyro")
    refused(lambda: run.imu("none"), "none", "at")
    noisy = pg.Imperfect(sample=0.1)
    lost = pg.Output(name="lost", kind="gyro", at="none", imperfect=noisy)
    refused(lambda: pg.load("pendulum").add(lost), "lost", "none", "rod")
    refused(lambda: pg.Output(name="a\ud800", kind="gyro", at="rod", imperfect=noisy), "UTF-8")
    y, w = (lambda x=x: pg.Motor(name="m", body="rod", torque=f"=-{x}.gyro[2]") for x in "yw")
    refused(y, "out.gyro", "pg.Stepper")
    refused(w, "out", "force")


def test_a_run_that_goes_on_tells_that_late_samples_are_of_the_time_before_it():
    late = pg.Imperfect(sample=0.01, latency=0.05)
    angle = pg.Output(name="angle", kind="joint_position", at="1", imperfect=late)
    model = pg.Model.serial(1).add(angle)
    first = pg.simulate(model, t_end=0.2)
    second = pg.simulate(model, start=first, t_end=0.4)
    assert not any("samples" in text for text in first.notices)
    assert any("of angle" in text and "pg.joined" in text for text in second.notices)
    whole, both = pg.simulate(model, t_end=0.4), pg.joined([first, second])
    np.testing.assert_allclose(
        both.measured["angle"].value, whole.measured["angle"].value, atol=1e-5
    )
