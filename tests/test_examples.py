"""The examples run as they are, and print what they promise."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

PROMISED = {
    "01_table_to_pgraph": "Pgraph of fig. 1   [1 2 3 5 2 4 2 6 7]",
    "02_describe_and_edit": "read back equal: True",
    "03_dynamics": "M is symmetric: True",
    "04_stance": "in all            323.73 N at first",
    "05_frame_update": "equal to the absolute form: True",
    "06_batch": "as alone to 1e-12: True",
    "07_columns": "row 2, mass: must be a finite number >= 0 [kg]; given -1.0",
    "08_forces": "the ledger closes to 1e-6: True",
    "09_loops": "constraint 'loop': cannot be met: it misses by 1 m",
    "10_contacts": "box on 17 degrees: 0.054 m/s after a second",
    "11_switches": "the ledger closes to 1e-8: True",
    "12_stability": "radau5 is OK everywhere: True",
    "13_verify": "my own case is met: True",
    "14_walk": "on its feet: True",
    "15_work_precision": "its error is below 1e-6: True",
    "16_sweep_a_mass": "4.0 kg: at most ",
    "17_four_processes": "as in one process: True",
    "18_edit_and_rerun": "the first model is unchanged: True",
    "19_spring_and_contact": "at rest: True",
    "20_to_pandas": "the index is the time: True",
    "21_stepper": "and back at 0.386 rad, t = 1.000 s",
    "22_design": "cheaper: True",
    "23_living_figure": "open it in a browser and move the sliders",
}


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_example(file: Path):
    done = subprocess.run(
        [sys.executable, str(file)],
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert PROMISED[file.stem] in done.stdout


def test_examples_are_numbered_without_a_gap():
    assert [int(file.name[:2]) for file in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


TYPED = """
import numpy as np
import pgraph_core as pg

body = pg.Body(name="a", axes=(0, 1, 0), inertia=np.eye(3), shape={"kind": "sphere", "radius": 0.1})
print(body.mass, pg.simulate(pg.Model(bodies=[body]), t_end=1.0).q[-1])
"""


def test_strict_pyright_passes_on_the_readme_and_on_every_example(tmp_path: Path):
    (tour,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    (tmp_path / "readme.py").write_text(tour)
    (tmp_path / "typed.py").write_text(TYPED)
    config = {
        "include": [".", str(ROOT / "examples")],
        "extraPaths": [str(ROOT), str(ROOT / "typings")],
        "typeCheckingMode": "strict",
    }
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(config))
    pyright = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "-p", str(tmp_path)]
    done = subprocess.run(pyright, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout
