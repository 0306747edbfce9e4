"""The examples run as they are, without a warning, and print what they promise."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
PROMISED = {
    "01_table_to_pgraph": "[1 2 3 5 2 4 2 6 7]",
    "02_describe_and_edit": "read back equal: True",
    "03_dynamics": "M is symmetric: True",
    "04_stance": "323.73 N",
    "05_frame_update": "equal to the absolute form: True",
    "06_batch": "as alone to 1e-12: True",
    "07_columns": "row 2, mass: ",
    "08_forces": "closes to 1e-6: True",
    "09_loops": "constraint 'loop': ",
    "10_contacts": "0.054 m/s",
    "11_switches": "closes to 1e-8: True",
    "12_stability": "OK everywhere: True",
    "13_verify": "is met: True",
    "14_walk": "on its feet: True",
    "15_work_precision": "below 1e-6: True",
    "16_sweep_a_mass": "4.0 kg: ",
    "17_four_processes": "as in one process: True",
    "18_edit_and_rerun": "unchanged: True",
    "19_spring_and_contact": "at rest: True",
    "20_to_pandas": "True",
    "21_stepper": "0.386 rad, t = 1.000 s",
    "22_design": "cheaper: True",
    "23_living_figure": "open it in a browser",
}


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_prints_what_it_promises(file: Path, capsys, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr("sys.argv", [str(file)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runpy.run_path(str(file), run_name="__main__")
    assert PROMISED[file.stem] in capsys.readouterr().out
