"""The commands `pgraph track` and `pgraph moments`."""

import json

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.cli import main

from .refusals import assert_names
from .test_trials import mot, plated, trc

pytestmark = pytest.mark.quick

POINTS = {"a": (0.1, 0.02, 0), "b": (0.0, 0.1, 0.03), "c": (0.05, 0, -0.1)}


@pytest.fixture
def files(tmp_path):
    """A pendulum, and a trial of it with a plate that bears it."""
    arm = pg.Body(name="arm", axes=(0, 1, 0), com=(0, 0, -0.2), inertia=[0.01] * 3)
    sites = [pg.Site(name=name, body="arm", point=x) for name, x in POINTS.items()]
    model = pg.Model(bodies=[arm], sites=sites)
    model.save(tmp_path / "arm.json")
    mech, q = pg.Mechanism(model), 0.3 * np.sin(np.arange(60) / 10)
    poses = [mech.pose([x]) for x in q]
    markers = {n: 1000 * np.array([p[n].position for p in poses]) for n in POINTS}
    trc(tmp_path / "swing.trc", {**markers, "A": markers.pop("a")})
    force = np.tile([0.0, 0, 100], (60, 1))
    mot(tmp_path / "plate.mot", **plated(force, 0 * force, 0 * force))
    mot(tmp_path / "known.mot", arm=q)
    return tmp_path


def test_track_and_moments_write_tables(files, capsys):
    model, trial = str(files / "arm.json"), str(files / "swing.trc")
    given = [model, trial, "--up", "z", "--marker", "a=A", "--weight", "b=2"]
    assert main(["track", *given, "-o", str(files / "ik.csv")]) == 0
    assert_names(capsys.readouterr().out, "60 frames", "3 markers", "ik.csv")
    found = pg.read_trial(files / "ik.csv").coordinates["arm"]
    assert np.abs(found - 0.3 * np.sin(np.arange(60) / 10)).max() < 1e-6
    plate = ["--forces", str(files / "plate.mot"), "--plate", "ground_force=arm", "--band"]
    assert main(["moments", *given, *plate, "-o", str(files / "id.csv"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["bears"]["ground_force"][0][0] == "arm"
    head = (files / "id.csv").read_text().splitlines()[0]
    assert head == "t [s],arm [N m],arm.low [N m],arm.high [N m]"
    assert main(["moments", model, str(files / "known.mot"), "--cutoff", "5"]) == 0


def test_refusals_name_the_file_and_a_remedy(files, capsys):
    model, known = str(files / "arm.json"), str(files / "known.mot")
    for words, *facts in (
        (["track", model, known], "known.mot", "no markers", "pgraph moments"),
        (["track", model, str(files / "swing.trc"), "-o", "ik.txt"], "ik.txt", ".csv"),
        (["check", str(files / "swing.trc")], "swing.trc", "pgraph track"),
    ):
        assert main(words) == 1
        assert_names(capsys.readouterr().err, *facts)
