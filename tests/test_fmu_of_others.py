"""FMUs of all built-in models and of robots that others publish, in both versions and kinds."""

import re
from functools import cache

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from tests.models_of_others import files
from tests.native_runs import has_library
from tests.test_fmu import HERE, fmpy, run

pytestmark = [has_library, pytest.mark.nightly]
ROBOTS = 40
STEPS = 20
COMPARED = "same", "same in both kinds", "both fail"
LARGEST = 3_000_000  # bytes of a file, since the rest of the test takes seconds


@cache
def robots():
    """Return files of robots with different names."""
    found = {}
    for path in (*files("gymnasium", ".xml"), *files("example-robot-data", ".urdf")):
        if path.stat().st_size < LARGEST:
            found.setdefault(path.name, path)
    return [*found.values()][:ROBOTS]


def outcome(model, path, version):
    """Check the FMU of a model, and return "same", or the reason why there is none."""
    from fmpy.validation import validate_fmu

    try:
        report = pg.write_fmu(model, path, version=version, platforms=HERE)
    except pg.InputError as refused:
        return str(refused)
    assert validate_fmu(str(path)) == []
    (told,) = (str(line) for line in report.of("read") if "method" in str(line))
    method = re.search(r"is (\w+) with", told)[1]
    want = pg.simulate(model, t_end=STEPS * 1e-3, step=1e-3, method=method, estimate=False)
    if not want.status.ok:
        with pytest.raises(Exception, match="Step"):
            run(path, "CoSimulation", STEPS * 1e-3, 1e-3)
        return "both fail"
    found = run(path, "CoSimulation", STEPS * 1e-3, 1e-3)
    np.testing.assert_array_equal(found, [*want.q[-1], *want.v[-1]])
    if fmpy.read_model_description(str(path)).modelExchange is None:
        return "same"
    found = run(path, "ModelExchange", STEPS * 1e-3, 1e-3, relative_tolerance=1e-10)
    want = pg.simulate(model, t_end=STEPS * 1e-3, rtol=1e-12, estimate=False)
    state = np.array([*want.q[-1], *want.v[-1]])
    np.testing.assert_allclose(found, state, rtol=1e-6, atol=1e-6 * np.abs(state).max(initial=1.0))
    return "same in both kinds"


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", pgraph_models.names())
def test_built_in_models_run_as_here(name, version, tmp_path, record_property):
    found = outcome(pg.load(pgraph_models.path(name)), tmp_path / "m.fmu", version)
    record_property(name, found)
    assert "same" in found


@pytest.mark.parametrize("number", range(ROBOTS))
def test_robots_of_others_run_as_here_or_are_refused_with_a_reason(
    number, tmp_path, record_property
):
    if number >= len(robots()):
        pytest.skip("the packages cannot be downloaded")
    path = robots()[number]
    try:
        model = pg.load(path)
    except pg.PgraphError as refused:
        pytest.skip(f"{path.name} is not read: {refused}")
    for version in (2, 3):
        found = outcome(model, tmp_path / f"m{version}.fmu", version)
        record_property(path.name, found)
        assert found in COMPARED or ": " in found  # or a refusal, which names its field
