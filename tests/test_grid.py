"""Every built-in model meets every command, scenario, kind of file and topic of the page.

No cell of this grid ends in a traceback, holds a number that is none in a sentence, or hangs. The
default part takes one short cell per model and command. The nightly part takes all of them, each in
a process of its own with a limit on its time.
"""

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_app.core.views import NOTHING
from pgraph_app.features import places
from pgraph_core.study.axes import applicable

from .app.store import begun, ran
from .nights import at_night

MODELS = pgraph_models.names()
LIMIT = 120  # [s] for a command, which takes less than a minute on two free cores
SHORT = ("--t-end", "0.02")
FAULTS = re.compile(  # stabilise=None in a remedy is an option
    r"Traceback|\b(nan|inf)\b|(?<!=)\bNone\b|undefined|<object|Error: |stopped by \w+Error"
)
KINDS = (".html", ".png", ".gif")
FORMATS = (".urdf", ".xml", ".json")
COMMANDS = ("info", "check", "convert", "run", "stability", "report", "sweep", "export")


def model_of(name: str) -> pg.Model:
    return pg.load(pgraph_models.path(name))


def runs_of(name: str) -> list[tuple[str, ...]]:
    """Return the options of a run for every scenario."""
    scenarios = [("--scenario", s.name) for s in model_of(name).scenarios]
    return scenarios or [()]


def exports_of(name: str, folder: Path) -> list[tuple[str, ...]]:
    files = [("export", name, *SHORT, "-o", str(folder / f"a{kind}")) for kind in KINDS]
    shown = [("digraph", ".svg"), ("plot", ".svg"), ("plot", ".png")]
    files += [("export", name, *SHORT, "--what", what, "-o", str(folder / f"b{kind}"))
              for what, kind in shown]  # fmt: skip
    return [*files, ("export", name, "--live", "-o", str(folder / "live.html"))]


def quick_words(name: str, folder: Path) -> list[tuple[str, ...]]:
    few = ("--methods", "rk4", "--steps", "1e-2,5e-3", "--t-end", "0.02", "--within", "20")
    return [
        ("info", name), ("check", name), ("convert", name, str(folder / "a.json")),
        ("run", name, *runs_of(name)[0], *SHORT),
        ("stability", name, *few, "--values", _value(name)),
    ]  # fmt: skip


def _value(name: str) -> str:
    """Return the extreme value of the first axis."""
    from pgraph_core.study.axes import AXES

    return f"{AXES[applicable(model_of(name))[0]].values[-1]:g}"


def all_words(name: str, folder: Path) -> list[tuple[str, ...]]:
    first = model_of(name).bodies[0].name
    swept = f"bodies.{first}.mass=1,2"
    return [
        *quick_words(name, folder),
        *(("convert", name, str(folder / f"c{suffix}")) for suffix in FORMATS),
        *(("run", name, *options, "-o", str(folder / f"r{kind}"))
          for options in runs_of(name) for kind in (".npz", ".csv", ".html")),
        *(("stability", name, "--axis", axis) for axis in applicable(model_of(name))),
        *(("report", name, *options) for options in runs_of(name)),
        ("sweep", name, "--set", swept, "--metric", "t_end", *SHORT),
        *exports_of(name, folder),
    ]  # fmt: skip


def faults(text: str) -> list[str]:
    """Return the places of a text at which a number is none, or an exception shows."""
    return [text[max(m.start() - 60, 0) : m.end() + 40] for m in FAULTS.finditer(text)]


@pytest.mark.parametrize("name", [*(x for x in MODELS if x != "andrews"), *at_night("andrews")])
def test_short_commands_end_in_sentences(name, capsys, tmp_path):
    for words in quick_words(name, tmp_path):
        code = main([*words])
        out, err = capsys.readouterr()
        assert code in (0, 1), words
        assert faults(out + err) == [], words


@pytest.mark.nightly
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", MODELS)
def test_every_command_ends_in_time_and_in_sentences(name, command, tmp_path):
    asked = [words for words in all_words(name, tmp_path) if words[0] == command]
    assert asked
    for words in asked:
        process = [sys.executable, "-m", "pgraph_app", *words]
        done = subprocess.run(process, capture_output=True, text=True, timeout=LIMIT, check=False)
        assert done.returncode in (0, 1), (words, done.stderr[-2000:])
        assert faults(done.stdout + done.stderr) == [], words


def topics(state: Any) -> list[tuple[str, Any]]:
    """Return the content of every topic of the page for its first client."""
    client = next(iter(state.clients.values()))
    made = [place.make for place in places() if isinstance(place.make, partial)]
    drawn: list[tuple[str, Any]] = []
    for topic in made:
        name, draw, _, page, _ = topic.args
        content = draw(state) if page is None else draw(state, client)
        drawn += [] if content is NOTHING else [(name, content)]
    return drawn


@pytest.mark.parametrize("name", MODELS)
def test_every_topic_of_the_page_is_drawn_before_and_after_a_run(name):
    model = model_of(name)
    options = {"t_end": 0.02, "frames": 5}
    scenario = model.scenarios[0].name if model.scenarios else None
    before = begun(model)
    after = ran(before, pg.simulate(pg.Mechanism(model), scenario=scenario, **options))
    for state in (before, after):
        for topic, content in topics(state):
            text = json.dumps(content, allow_nan=False, default=str)
            assert faults(text.replace("null", "")) == [], topic
