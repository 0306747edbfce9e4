"""The examples and those of docstrings run as printed and give what they promise."""

import doctest
import runpy
import warnings
from pathlib import Path

import pytest

import pgraph_core as pg

from .nights import at_night

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
AT_NIGHT = (
    "12_stability", "15_work_precision", "22_design", "26_path_of_a_four_bar", "27_swing_up",
)  # fmt: skip
LONG = [file for file in EXAMPLES if file.stem in AT_NIGHT]
PROMISED = {  # where it is not that all checks of the example hold
    "01_table_to_pgraph": "[1 2 3 5 2 4 2 6 7]",
    "04_stance": "323.73 N",
    "07_columns": "body '2', mass: ",
    "09_loops": "constraint 'loop': ",
    "10_contacts": "0.054 m/s",
    "16_sweep_a_mass": "4.0 kg: ",
    "21_stepper": "0.386 rad, t = 1.000 s",
    "23_living_figure": "open it in a browser",
    "39_beam": "moment 1.771 N m, errors: space 1.6e-04 m",
}


@pytest.mark.parametrize(
    "file", [*(x for x in EXAMPLES if x not in LONG), *at_night(*LONG)], ids=lambda file: file.stem
)
def test_an_example_prints_what_it_promises(file: Path, capsys, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr("sys.argv", [str(file)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runpy.run_path(str(file), run_name="__main__")
    out = capsys.readouterr().out
    assert PROMISED.get(file.stem, ": True") in out
    assert ": False" not in out


@pytest.mark.parametrize("name", pg.__all__)
def test_an_example_in_a_docstring_gives_what_it_prints(name: str):
    for example in doctest.DocTestFinder().find(getattr(pg, name), name, globs={"pg": pg}):
        runner = doctest.DocTestRunner(optionflags=doctest.FAIL_FAST)
        assert runner.run(example).failed == 0
