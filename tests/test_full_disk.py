"""A disk that gets full: a sentence with the file, and nothing half written."""

import subprocess
import sys

import pytest

WRITERS = {
    "model.json": "model.save(path)",
    "run.npz": "run.save(path)",
    "run.csv": "run.save(path)",
    "run.mcap": "run.save(path)",
    "run.rrd": "run.save(path)",
    "run.html": "run.to_html(path)",
    "view.png": "model.to_image(path)",
    "digraph.svg": "model.to_image(path, what='digraph')",
    "robot.urdf": "pg.write_urdf(model, path)",
    "robot.xml": "pg.write_mjcf(model, path)",
}
FULL = """
import pathlib, resource, sys, warnings
import pgraph_core as pg
warnings.simplefilter("ignore")
bar = pg.Shape(kind="box", size=(1, 0.1, 0.1))
model = pg.Model.serial(3).edit("1", shape=bar)
run = pg.simulate(model, t_end=0.2, frames=200)
folder = pathlib.Path(sys.argv[1])
sizes = (1000, resource.RLIM_INFINITY)
resource.setrlimit(resource.RLIMIT_FSIZE, sizes)  # writes of more fail as on a full disk
def told(name, write):
    path = folder / name
    try:
        write(path)
    except pg.FileError as error:
        print(name, name in str(error), path.exists())
"""
EACH = "".join(f"told({name!r}, lambda path: {call})\n" for name, call in WRITERS.items())
SWEEP = """
many = [-9.0 - k / 100 for k in range(40)]
def sweep(resume):
    given = {"t_end": 0.01, "out": folder / "table.csv", "workers": 1, "resume": resume}
    return pg.sweep(model, {"gravity.2": many}, "final 1", **given)
told("table.csv", lambda path: sweep(False))
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
print(len(sweep(True)))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sizes of files have no limit there")
def test_what_cannot_be_written_is_named_and_nothing_is_left(tmp_path):
    """A sweep keeps the points that fit, and goes on from there once there is room."""
    code = f"{FULL}{EACH}{SWEEP}"
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True
    )
    *lines, points = done.stdout.splitlines()
    assert lines == [f"{name} True False" for name in (*WRITERS, "table.csv")]
    assert points == "40"
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]
