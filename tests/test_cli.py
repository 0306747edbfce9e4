"""The command line: its answers, its exit codes, and what it does not load."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import pytest

import pgraph_app.cli.terminal
import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_app.cli.terminal import aligned, to_json
from pgraph_core.live import module

from .app.conftest import until


def said(capsys, *words: str, code: int = 0) -> tuple[str, str]:
    assert main(words) == code
    captured = capsys.readouterr()
    return captured.out, captured.err


def told(capsys, *words: str) -> dict:
    out, err = said(capsys, *words, "--json")
    assert err == ""
    return json.loads(out)


def refused_as_usage(capsys, *words: str) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


# -- info ----------------------------------------------------------------------------------------


def test_info_of_the_quadruped(capsys):
    info = told(capsys, "info", "quadruped")
    fig9 = [1, 2, 3, 4, 5, 6, 7, 4, 8, 9, 10, 1, 11, 12, 13, 1, 14, 15, 16]
    assert info["pgraph"] == fig9
    assert info["jdof"] == [6, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1]
    assert (info["nb"], info["nq"], info["nv"]) == (16, 22, 21)
    assert info["tips"] == [7, 10, 13, 16]
    assert info["separation_bodies"] == [1, 4]
    assert info["parent"] == [0, 1, 2, 3, 4, 5, 6, 4, 8, 9, 1, 11, 12, 1, 14, 15]
    assert info["dof"] == [6] + 15 * [1]
    assert info["names"][:2] == ["pelvis", "lumbar"]
    assert info["mass"] == pytest.approx(33.0)
    assert info["scenarios"] == ["stance", "stand", "bound"]
    assert len(info["constraints"]) == 4


def test_info_for_people(capsys):
    out, err = said(capsys, "info", "fig1_tree")
    assert err == ""
    assert "fig. 1 tree: 7 bodies, nv = 7, nq = 7, 7 kg, z up" in out
    assert "Pgraph             [1 2 3 4 2 5 2 6 7]" in out
    assert "jdof               [1 1 1 1 0 1 0 1 1]" in out
    assert "\n1  1     ground  revolute    1          1\n" in out


def test_info_of_a_forest_and_of_nothing(capsys, tmp_path: Path):
    forest = pg.Model(bodies=(pg.Body(name="a"), pg.Body(name="b")))
    forest.save(tmp_path / "forest.json")
    assert told(capsys, "info", str(tmp_path / "forest.json"))["pgraph"] == [0, 1, 0, 2]
    pg.Model().save(tmp_path / "empty.json")
    assert told(capsys, "info", str(tmp_path / "empty.json"))["nb"] == 0
    said(capsys, "info", str(tmp_path / "empty.json"))


def test_a_built_in_name_needs_no_file_and_a_path_is_a_file(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pg.Model.serial(2).save("pendulum")
    assert told(capsys, "info", "pendulum")["nb"] == 1
    assert told(capsys, "info", "./pendulum")["nb"] == 2


# -- stability -----------------------------------------------------------------------------------

STIFF = ("stability", "stiff_pendulum", "--t-end", "0.2")


def test_stability_for_people_and_programs(capsys, tmp_path: Path):
    words = (*STIFF, "--values", "1e4,1e8", "--methods", "rk4,radau5", "--steps", "1e-2")
    out, _ = said(capsys, *words)
    assert out.startswith("stiff pendulum: stiffness of the stiffest spring")
    assert "rk4 UNSTABLE, as at stiffness 1e+08, step 0.01 s" in out
    page = tmp_path / "map.html"
    data = told(capsys, *words, "-o", str(page))
    assert [c["status"] for c in data["cells"]] == ["OK", "OK", "UNSTABLE", "OK"]
    assert data["output"] == str(page)
    assert "<svg" in page.read_text(encoding="utf-8")


def test_stability_of_every_axis_names_those_that_the_model_lacks(capsys):
    words = ("--all", "--values", "1", "--methods", "rk4", "--steps", "1e-2")
    out, _ = said(capsys, *STIFF, *words)
    assert "friction varies contacts; the model has none" in out
    assert "factor on every length, gravity too" in out


def test_stability_refuses_before_it_works(capsys, tmp_path: Path):
    assert "invalid choice: 'mood'" in refused_as_usage(capsys, *STIFF, "--axis", "mood")
    assert "must be numbers" in refused_as_usage(capsys, *STIFF, "--steps", "1,x")
    _, err = said(capsys, *STIFF, "-o", str(tmp_path / "map.txt"), code=1)
    assert "must end in .html, .svg, .json" in err
    _, err = said(capsys, *STIFF, "--methods", "rk5", code=1)
    assert "no method is called 'rk5'" in err


# -- new, models, check --------------------------------------------------------------------------


def test_new_prints_the_default_table(capsys):
    out, _ = said(capsys, "new", "3")
    assert pg.Model.from_json(out) == pg.Model.serial(3)
    assert told(capsys, "new", "3") == json.loads(out)


def test_new_writes_a_file_but_never_over_one(capsys, tmp_path: Path):
    file = tmp_path / "m.json"
    out, _ = said(capsys, "new", "4", "-o", str(file))
    assert out == f"Wrote {file}: 4 bodies in a row.\n"
    assert pg.Model.load(file) == pg.Model.serial(4)
    _, err = said(capsys, "new", "5", "-o", str(file), code=1)
    assert err == f"{file}: exists already; choose another name\n"
    assert pg.Model.load(file) == pg.Model.serial(4)


@pytest.mark.parametrize("n", ["0", "-3", "x", "1.5", "1e3", "", "100001", "9" * 5000])
def test_new_takes_a_whole_number(capsys, n: str):
    words = ("new", "--", n) if n.startswith("-") else ("new", n)
    said = f"argument N: must be a whole number from 1 to 100000; given '{n}'"
    assert refused_as_usage(capsys, *words) == f"pgraph new: error: {said}"


def test_models_lists_all(capsys):
    models = told(capsys, "models")["models"]
    assert tuple(m["name"] for m in models) == pgraph_models.names()
    assert all(Path(m["path"]).is_file() for m in models)
    out, _ = said(capsys, "models")
    assert [line.split()[0] for line in out.splitlines()] == ["model", *pgraph_models.names()]


@pytest.mark.parametrize("name", pgraph_models.names())
def test_check_of_a_good_model(capsys, name: str):
    assert told(capsys, "check", name) == {"problems": []}
    assert said(capsys, "check", name)[0].endswith(": no problem found\n")


def test_a_model_that_is_not_there(capsys):
    known = ", ".join(pgraph_models.names())
    sentence = f"is neither a file nor a built-in model; the built-in models are {known}"
    for command in ("info", "check", "run"):
        out, err = said(capsys, command, "horse", "--json", code=1)
        assert err == f"model 'horse': {sentence}\n"
        assert json.loads(out) == {
            "problems": [{"where": "model 'horse'", "field": "", "text": sentence}]
        }
    _, err = said(capsys, "horse", code=1)
    assert err == f"model 'horse': {sentence}\n"


def test_check_lists_every_problem(capsys, tmp_path: Path):
    file = tmp_path / "m.json"
    file.write_text('{"bodies": [{"name": "a", "mass": -1}, {"name": "a", "dof": 9}], "up": 1}')
    _, err = said(capsys, "check", str(file), code=1)
    assert len(err.splitlines()) == 4


# -- run -----------------------------------------------------------------------------------------


def test_run_of_the_stance(capsys, tmp_path: Path):
    file = tmp_path / "run.npz"
    answer = told(capsys, "run", "quadruped", "-o", str(file))
    assert (answer["scenario"], answer["status"], answer["method"]) == ("stance", "DONE", "rk4")
    assert answer["t"] == pytest.approx(0.25)
    assert answer["counters"]["steps"] == 250
    assert answer["constraint_drift"][0] < 1e-6
    assert answer["constraint_drift"][1] < 1e-9
    assert answer["output"] == str(file)
    assert pg.Result.load(file).t[-1] == pytest.approx(0.25)


def test_run_to_a_tolerance(capsys):
    answer = told(capsys, "run", "pendulum", "--t-end", "0.5", "--rtol", "1e-10")
    assert (answer["method"], answer["step"], answer["header"]["rtol"]) == ("dop853", None, 1e-10)
    assert answer["error_estimate"] < 1e-8
    out, _ = said(capsys, "run", "pendulum", "--t-end", "0.5", "--rtol", "1e-10")
    assert "dop853, steps to a tolerance of 1e-10" in out


def test_run_for_people(capsys):
    out, err = said(capsys, "run", "pendulum", "--t-end", "0.5", "--step", "0.01")
    assert err == ""
    assert out.startswith("pendulum, scenario swing: the run reached its end\n")
    assert "50 steps" in out
    assert "left out" in out


def test_run_of_a_model_without_scenario(capsys, tmp_path: Path):
    pg.Model.serial(2).save(tmp_path / "m.json")
    answer = told(capsys, "run", str(tmp_path / "m.json"), "--method", "semi_implicit_euler")
    assert (answer["scenario"], answer["t"]) == (None, 1.0)
    assert answer["method"] == "semi_implicit_euler"


def test_a_run_that_fails_says_why_and_exits_with_1(capsys):
    out, err = said(capsys, "run", "chain_10", "--step", "0.1", "--json", code=1)
    answer = json.loads(out)
    assert answer["status"] == "NOT_FINITE"
    assert answer["error_estimate"] is None
    assert err == answer["message"] + "\n"
    assert "t = " in err
    assert "body '" in err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--scenario", "trot"), "scenario 'trot': is not there; choose one of stance, stand"),
        (("--method", "magic"), "simulate, method: no method is called 'magic'; choose one of "),
    ],
)
def test_options_that_the_model_has_not(capsys, words: tuple[str, ...], sentence: str):
    _, err = said(capsys, "run", "quadruped", *words, code=1)
    assert err.startswith(sentence)


@pytest.mark.parametrize("option", ["--t-end", "--step"])
@pytest.mark.parametrize("value", ["0", "nan", "inf", "1s", "-1"])
def test_times_are_positive(capsys, option: str, value: str):
    last = refused_as_usage(capsys, "run", "pendulum", f"{option}={value}")
    sentence = f"argument {option}: must be a finite number > 0; given '{value}'"
    assert last == f"pgraph run: error: {sentence}"


def test_progress_is_shown_on_a_terminal_only(capsys, monkeypatch):
    assert "\r" not in said(capsys, "run", "pendulum", "--t-end", "0.1")[1]
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    bar = said(capsys, "run", "pendulum", "--t-end", "0.1")[1]
    assert "\rcompiling [" in bar
    assert f"\rrunning   [{'#' * pgraph_app.cli.terminal.WIDTH}] 100%" in bar
    assert bar.endswith(" \r")  # wiped off


# -- the page ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "name", "expected"),
    [
        ((), "quadruped", ("127.0.0.1", 8080, True, "auto")),
        (("pendulum", "--port", "0", "--no-browser"), "pendulum", ("127.0.0.1", 0, False, "auto")),
        (("--host", "0.0.0.0", "--token", "off"), "quadruped", ("0.0.0.0", 8080, True, "off")),
    ],
)
def test_the_page_is_served_as_asked(capsys, monkeypatch, words, name, expected):
    import pgraph_app.server

    served = []

    class Fake:
        store = SimpleNamespace(state=SimpleNamespace(undo=()))  # nothing was recovered

        def send(self, event) -> None:
            served.append(type(event).__name__)

        def wait(self, until) -> None:
            assert not until.is_set()
            served.append("waited")

    def serve(model, *, host, port, open_browser, given, keep, token):
        assert given in ("quadruped", "pendulum")
        assert keep.name == "pgraph"
        served.append((model.name, (host, port, open_browser, token)))
        return Fake()

    monkeypatch.setattr(pgraph_app.server, "serve", serve)
    said(capsys, *words)
    assert served == [(name, expected), "Simulate", "waited"]


@pytest.mark.parametrize("host", ["300.1.1.1", "192.0.2.1", "no such host", "x" * 300])
def test_hosts_that_this_machine_has_not(capsys, host: str):
    _, err = said(capsys, "--host", host, "--no-browser", code=1)
    assert err.startswith(f"host {host!r}: cannot be served on: ")
    assert err.endswith("; use 127.0.0.1, or 0.0.0.0 for all networks\n")


def test_a_log_that_cannot_be_written(capsys, tmp_path):
    _, err = said(capsys, "--log", str(tmp_path / "none" / "page.log"), "--no-browser", code=1)
    assert str(tmp_path / "none") in err


def test_the_page_answers_and_ctrl_c_ends_it(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    log = tmp_path / "page.log"
    words = [sys.executable, "-m", "app", "pendulum", "--port", "0", "--no-browser"]
    words += ["--log", str(log), "--token", "on"]
    page = subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert page.stdout is not None
    assert page.stderr is not None
    try:
        url = page.stdout.readline().split()[-1]
        with urllib.request.urlopen(url, timeout=30) as answer:
            assert answer.status == 200
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(url.partition("?")[0], timeout=30)
        until(lambda: " INFO Compiling of server: " in log.read_text(), "a line of the log")
        page.send_signal(signal.SIGINT)
        assert page.wait(timeout=30) == 0
        assert "Traceback" not in page.stderr.read()
    finally:
        page.kill()
        page.wait()
        page.stdout.close()
        page.stderr.close()


# -- usage ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("port", ["-1", "65536", "http", "8o8o"])
def test_ports(capsys, port: str):
    sentence = f"must be a whole number from 0 (any free port) to 65535; given '{port}'"
    assert (
        refused_as_usage(capsys, f"--port={port}") == f"pgraph: error: argument --port: {sentence}"
    )


def test_words_too_many(capsys):
    last = refused_as_usage(capsys, "chekc", "quadruped")
    assert last.startswith(
        "pgraph: error: 'chekc' is neither a command nor a model; did you mean check?"
    )
    assert "did you mean run?" in refused_as_usage(capsys, "simulate", "pendulum")


@pytest.mark.parametrize("words", [("--help",), ("--version",), ("run", "--help")])
def test_help(capsys, words: tuple[str, ...]):
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 0
    assert capsys.readouterr().out


def test_json_has_no_nan_and_no_arrays():
    import numpy as np

    data = {"a": np.arange(2), "b": float("nan"), "c": (np.float64(1.5), np.bool_(True)), "d": ""}
    assert json.loads(to_json(data)) == {"a": [0, 1], "b": None, "c": [1.5, True], "d": ""}


def test_tables_line_up():
    table = aligned([("a", 1, 0.5), ("long", 20, 10.0)], header=("name", "n", "x"))
    assert table == "name   n    x\na      1  0.5\nlong  20   10"


# -- processes -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("commands", "heavy"),
    [
        ("main(['info', 'fig1_tree']); main(['models'])", "'numba', 'viser', 'trimesh'"),
        ("main(['info', 'quadruped'])", "'viser', 'trimesh', 'websockets'"),  # mobility: kernels
    ],
)
def test_info_loads_no_compiler_for_a_tree_and_never_the_page(commands: str, heavy: str):
    program = (
        f"import sys; from pgraph_app.cli import main\n{commands}\n"
        f"found = {{{heavy}}} & set(sys.modules)\n"
        "sys.exit(str(found) if found else 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_run_needs_no_page():
    program = (
        "import sys; from pgraph_app.cli import main; main(['run', 'pendulum', '--t-end', '0.1'])\n"
        "heavy = {'viser', 'trimesh', 'websockets'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_python_m_app_and_a_reader_that_has_seen_enough():
    writer = subprocess.Popen(
        [sys.executable, "-m", "app", "new", "5000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert writer.stdout is not None
    assert writer.stderr is not None
    assert writer.stdout.readline() == b"{\n"
    writer.stdout.close()
    assert writer.stderr.read() == b""
    writer.stderr.close()
    assert writer.wait(timeout=60) == 0


# -- verify --------------------------------------------------------------------------------------


def test_verify_tells_how_near_it_comes(capsys):
    rows = told(capsys, "verify", "heavy_top", "mass_ratio_light_tip_1em6")["cases"]
    assert [row["case"] for row in rows] == ["heavy_top", "mass_ratio_light_tip_1em6"]
    assert all(row["ok"] and row["error"] <= row["target"] for row in rows)
    assert all(row["steps"] > 0 and row["seconds"] > 0 for row in rows)
    out, err = said(capsys, "verify", "heavy_top")
    assert out.splitlines()[0].split()[:4] == ["case", "compared", "error", "target"]
    assert out.endswith("\n1 of 1 cases reach their targets\n")
    assert err == ""  # nobody watches


def test_verify_of_a_file_that_misses(capsys, tmp_path):
    data = json.loads((pgraph_models.CASES / "double_pendulum.json").read_text())
    data["cases"][0]["run"] = {"method": "rk4", "step": 0.05}
    file = tmp_path / "coarse.json"
    file.write_text(json.dumps(data))
    out, err = said(capsys, "verify", str(file), code=1)
    assert "MISSED" in out
    assert err == "missed: double_pendulum\n"


def test_verify_of_what_is_not_there(capsys):
    _, err = said(capsys, "verify", "horse", code=1)
    assert err.startswith("case 'horse': no case has this name; choose one of a01_simple_pendulum")
    _, err = said(capsys, "verify", "horse.json", code=1)
    assert err.startswith("horse.json: cannot be read: No such file")


def test_check_names_the_bodies_whose_mesh_cannot_be_read(capsys, tmp_path: Path):
    model = pg.Model.serial(2).edit("2", shape={"kind": "mesh", "file": "part.stl"})
    (tmp_path / "m.json").write_text(model.to_json())
    _, err = said(capsys, "check", str(tmp_path / "m.json"), code=1)
    assert "body '2', shape: mesh" in err
    assert "part.stl: there is no such file" in err


def test_check_says_that_a_scenario_asks_for_an_unknown_method(capsys, tmp_path: Path):
    text = '{"bodies": [{"name": "a"}], "scenarios": [{"name": "s", "method": "rk5"}]}'
    (tmp_path / "m.json").write_text(text)
    _, err = said(capsys, "check", str(tmp_path / "m.json"), code=1)
    assert "scenario 's', method: no method is called 'rk5'; choose one of auto, " in err


# -- export ----------------------------------------------------------------------------------------


def test_export_writes_a_figure(capsys, tmp_path):
    file = tmp_path / "page.html"
    asked = ("--live", "--open", "bodies.rod.mass=0.5:2", "--t-end", "1", "-o", str(file))
    given = told(capsys, "export", "pendulum", *asked)
    assert given["bytes"] == file.stat().st_size
    assert given["scenario"] == "swing"
    assert "pgraph_live" in file.read_text(encoding="utf-8")
    _, err = said(capsys, "export", "pendulum", "--open", "bodies.arm.mass", "-o", "x.html", code=1)
    assert "bodies.arm.mass" in err
    out, _ = said(capsys, "export", "pendulum", "--live", "--t-end", "1", "-o", str(file))
    assert module.stale() or "--open bodies.rod.mass" in out


@pytest.mark.parametrize(
    ("name", "words", "begins"),
    [
        ("a.png", ["--size", "64x48"], b"\x89PNG"),
        ("a.svg", ["--at", "0.2", "--t-end", "0.3", "--dark"], b"<svg"),
        ("d.svg", ["--what", "digraph"], b"<svg"),
    ],
)
def test_export_draws_pictures(capsys, tmp_path, name, words, begins):
    file = tmp_path / name
    given = told(capsys, "export", "pendulum", *words, "-o", str(file))
    assert given["bytes"] == file.stat().st_size
    assert file.read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("words", "fact"),
    [
        (["-o", "a.png", "--live"], "is no page"),
        (["-o", "a.mp4", "--what", "digraph"], "--what does nothing to a film"),
        (["-o", "a.mp4", "--at", "1"], "--at does nothing to a film"),
        (["-o", "a.html", "--size", "64x64"], "--size does nothing to a page"),
        (["-o", "a.png", "--columns", "arm"], "--columns does nothing"),
        (["-o", "a.png", "--scenario", "nothing"], "nothing"),
        (["-o", "a.png", "--at", "99", "--t-end", "0.1"], "0 to 0.1 s"),
    ],
)
def test_a_picture_that_cannot_be_drawn_is_a_sentence(capsys, words, fact):
    _, err = said(capsys, "export", "pendulum", *words, code=1)
    assert fact in err


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        (["runn", "quadruped"], ["did you mean run", "sweep"]),
        (["map"], ["stability", "run"]),
        (["help"], ["run", "sweep"]),
    ],
)
def test_a_word_that_is_no_command(capsys, words, facts):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    for fact in facts:
        assert fact in told


def test_a_run_for_a_file_of_no_known_kind(capsys):
    _, err = said(capsys, "run", "pendulum", "-o", "run.foo", code=1)
    assert ".npz" in err
    assert ".html" in err


def test_a_model_file_does_not_steer_the_terminal(tmp_path, capsys):
    """Escapes, marks that turn the direction of text, names without end."""
    names = ["a\x1b]0;t\x07\x1b[2J", "b\u202egnp", "c\r", "d\nd: fine", "x" * 100_000]
    for name in names:
        bad = {"bodies": [{"name": name}, {"name": "q", "parent": "zz"}, {"name": name}]}
        (tmp_path / "bad.json").write_text(json.dumps(bad))
        out, err = said(capsys, "check", str(tmp_path / "bad.json"), code=1)
        assert out == ""
        assert err.replace("\n", "").isprintable()
        assert not any(line.startswith("d: fine") for line in err.split("\n"))
        assert len(err) < 3000
    good = pg.Model.serial(2).replace(name="a\x1b[2J\u202e")
    good.save(tmp_path / "good.json")
    for word in ("check", "info"):
        out, _ = said(capsys, word, str(tmp_path / "good.json"))
        assert out.startswith(r"a\x1b[2J\u202e: ")


def test_convert_keeps_its_input_and_asks_for_folders_that_are_there(tmp_path, capsys):
    file = tmp_path / "m.json"
    pg.Model.serial(2).save(file)
    (tmp_path / "link.json").symlink_to(file)
    before = file.read_bytes()
    for out in (file, tmp_path / "link.json"):
        _, err = said(capsys, "convert", str(file), str(out), code=1)
        assert "is the file that is read; choose another name" in err
    _, err = said(capsys, "convert", str(file), str(tmp_path / "o.json"), "--roots", "/no", code=1)
    assert err == "/no: there is no such folder\n"
    assert file.read_bytes() == before


@pytest.mark.parametrize("name", ["x", "x.urdf", "x.csv"])
def test_a_new_model_is_a_json_file(name, tmp_path, capsys):
    _, err = said(capsys, "new", "2", "-o", str(tmp_path / name), code=1)
    assert err == f"{tmp_path / name}: must end in .json\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["run", "sweep", "export"])
def test_a_run_that_would_not_end_is_refused(command, capsys):
    said = refused_as_usage(capsys, command, "pendulum", "--t-end", "1e300")
    assert said.endswith("argument --t-end: must be at most 1e+09 s; given '1e300'")
