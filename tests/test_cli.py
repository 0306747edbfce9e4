"""The command line: its answers, its exit codes, and the packages that it loads."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import urllib.error
import urllib.request
import zipfile
from pathlib import Path

import numpy as np
import pytest

import pgraph_app.cli.terminal
import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_app.cli.terminal import aligned, to_json

from .app.store import until


def printed(capsys, *words: str, code: int = 0) -> tuple[str, str]:
    """(stdout, stderr) of a command that ends with this code."""
    try:
        found = main([*map(str, words)])
    except SystemExit as stopped:
        found = stopped.code
    assert found == code
    return capsys.readouterr()


def answered(capsys, *words: str) -> dict:
    out, err = printed(capsys, *words, "--json")
    assert err == ""
    return json.loads(out)


def test_info_of_the_quadruped(capsys):
    info = answered(capsys, "info", "quadruped")
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


def test_info_lists_the_segments_of_belts_and_their_mobility(capsys, tmp_path):
    bodies = [pg.Body(name=x, link=(k, 0, 0), inertia=np.eye(3)) for k, x in enumerate("ab")]
    belt = pg.belt(["a", "b"], 0.1)
    pg.Model(bodies=bodies, constraints=[belt]).save(tmp_path / "belt.json")
    info = answered(capsys, "info", str(tmp_path / "belt.json"))
    assert info["segments"] == ["belt[1]", "belt[2]"]
    assert (info["mobility"]["rows"], info["mobility"]["dof"]) == (2, 1)


def test_info_of_a_forest_of_nothing_and_of_files(capsys, tmp_path, monkeypatch):
    """A built-in name is no file, and a path is none of the built-in names."""
    monkeypatch.chdir(tmp_path)
    pg.Model(bodies=(pg.Body(name="a"), pg.Body(name="b"))).save("forest.json")
    assert answered(capsys, "info", "forest.json")["pgraph"] == [0, 1, 0, 2]
    pg.Model().save("empty.json")
    assert answered(capsys, "info", "empty.json")["nb"] == 0
    pg.Model.serial(2).save("pendulum")
    assert answered(capsys, "info", "pendulum")["nb"] == 1
    assert answered(capsys, "info", "./pendulum")["nb"] == 2


STIFF = ("stability", "stiff_pendulum", "--t-end", "0.2")
MAP = (*STIFF, "--values", "1e4,1e8", "--methods", "rk4,radau5", "--steps", "1e-2")
REPORT = ("report", "double_pendulum", "--t-end", "0.2", "--methods", "rk4,dop853", "--steps",
          "0.01", "--tolerances", "1e-6", "--rounds", "1", "--no-peers")  # fmt: skip
TOLD = [  # the words, and what people read
    (("info", "fig1_tree"), ["[1 2 3 5 2 4 2 6 7]", "[1 1 1 1 0 1 0 1 1]", "revolute"]),
    (MAP, ["rk4 UNSTABLE"]),
    ((*REPORT, "--target", "1e-5"), ["rk4     step 0.01 s"]),
    (("run", "pendulum", "--t-end", "0.5", "--rtol", "1e-10"), ["1e-10"]),
    (("run", "pendulum", "--t-end", "0.5", "--step", "0.01"), ["scenario swing", "50 steps"]),
    (("models",), pgraph_models.names()),
    (("check", "quadruped"), ["quadruped"]),
    (("verify", "heavy_top"), ["case", "error", "target"]),
    *(((*words, "--help"), ["--"]) for words in ((), ("run",))),
]  # fmt: skip


@pytest.mark.parametrize(("words", "facts"), TOLD)
def test_a_command_tells_people(capsys, words, facts):
    out, err = printed(capsys, *words)
    assert err == ""
    assert [fact for fact in facts if fact not in out] == []


def test_maps_and_reports_for_programs(capsys, tmp_path):
    data = answered(capsys, *MAP, "-o", tmp_path / "map.html")
    assert [c["status"] for c in data["cells"]] == ["OK", "OK", "UNSTABLE", "OK"]
    assert data["output"] == str(tmp_path / "map.html")
    data = answered(capsys, *REPORT, "-o", tmp_path / "report.html")
    assert [row["method"] for row in data["rows"]] == ["rk4", "dop853"]
    assert all("<svg" in (tmp_path / f"{x}.html").read_text("utf-8") for x in ("map", "report"))
    assert "1e-15" in printed(capsys, *REPORT, "--target", "1e-15", code=1)[1]
    words = ["--case", "heavy_top", "--methods", "dop853", "--tolerances", "1e-6,1e-9"]
    data = answered(capsys, "report", *words, "--rounds", "1", "--no-peers")
    rough, fine = data["rows"]
    assert fine["error"] < 1e-6 < rough["error"] < 1e-2
    assert (data["t_end"], data["frames"]) == (2.0, 41)


def test_a_map_runs_the_first_scenario_as_a_run_does_unless_none_is_asked(capsys):
    """A crank at rest does not move without its scenario, and then every step is right."""
    few = ("--values", "1", "--methods", "rk4", "--steps", "0.1,0.05")
    turning = answered(capsys, "stability", "four_bar", *few)
    still = answered(capsys, "stability", "four_bar", *few, "--scenario", "none")
    assert (turning["scenario"], turning["t_end"]) == ("turn", 10.0)
    assert (still["scenario"], still["t_end"]) == (None, 1.0)
    moved, rested = ([c["error"] for c in each["cells"]] for each in (turning, still))
    assert min(moved) > 1e-6 > max(rested)
    assert "scenario turn" in printed(capsys, "stability", "four_bar", *few)[0]


def test_models_lists_all(capsys):
    models = answered(capsys, "models")["models"]
    assert tuple(m["name"] for m in models) == pgraph_models.names()
    assert all(Path(m["path"]).is_file() for m in models)


@pytest.mark.parametrize("name", pgraph_models.names())
def test_check_of_a_good_model(capsys, name: str):
    assert answered(capsys, "check", name) == {"problems": []}


def test_a_model_that_is_not_there(capsys):
    for command in ("info", "check", "run"):
        out, err = printed(capsys, command, "horse", "--json", code=1)
        assert "'horse'" in err
        (problem,) = json.loads(out)["problems"]
        assert (problem["where"], problem["field"]) == ("model 'horse'", "")
        assert all(name in problem["text"] for name in pgraph_models.names())
    assert "'horse'" in printed(capsys, "horse", code=1)[1]


def test_runs_for_programs(capsys, tmp_path):
    """With the scenario of the model, with a tolerance, without a scenario, and one that fails."""
    file = tmp_path / "run.npz"
    answer = answered(capsys, "run", "quadruped", "-o", file)
    assert (answer["scenario"], answer["status"], answer["method"]) == ("stance", "DONE", "rk4")
    assert (answer["counters"]["steps"], answer["output"]) == (250, str(file))
    assert answer["constraint_drift"][0] < 1e-6
    assert answer["constraint_drift"][1] < 1e-9
    assert pg.Result.load(file).t[-1] == answer["t"] == pytest.approx(0.25)
    answer = answered(capsys, "run", "pendulum", "--t-end", "0.5", "--rtol", "1e-10")
    assert (answer["method"], answer["step"], answer["header"]["rtol"]) == ("dop853", None, 1e-10)
    assert answer["error_estimate"] < 1e-8
    pg.Model.serial(2).save(tmp_path / "m.json")
    answer = answered(capsys, "run", tmp_path / "m.json", "--method", "radau5")
    assert (answer["scenario"], answer["t"], answer["method"]) == (None, 1.0, "radau5")
    out, err = printed(capsys, "run", "chain_10", "--step", "0.1", "--json", code=1)
    answer = json.loads(out)
    assert (answer["status"], answer["error_estimate"]) == ("NOT_FINITE", None)
    assert err == answer["message"] + "\n"


def test_progress_is_shown_on_a_terminal_only(capsys, monkeypatch):
    assert "\r" not in printed(capsys, "run", "pendulum", "--t-end", "0.1")[1]
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    bar = printed(capsys, "run", "pendulum", "--t-end", "0.1")[1]
    assert f"[{'#' * pgraph_app.cli.terminal.WIDTH}] 100%" in bar
    assert bar.endswith(" \r")  # wiped off


def test_long_work_says_how_far_it_is_where_output_is_piped(capsys, monkeypatch):
    for name in ("SILENCE", "SHORT"):
        monkeypatch.setattr(pgraph_app.cli.terminal, name, -1.0)
    small = ("--steps", "1e-2", "--methods", "rk4", "--values", "1e4,1e6", "--within", "500")
    out, err = printed(capsys, *STIFF, *small)
    lines = [line for line in err.splitlines() if line.startswith("map: ")]
    assert re.fullmatch(r"map: 100%, about 0 s left", lines[-1])
    assert "rk4" in out


def test_a_terminal_shows_the_cells_of_a_map_as_they_come(capsys, monkeypatch):
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    small = ("--steps", "1e-2", "--methods", "rk4", "--values", "1e4,1e6")
    err = printed(capsys, *STIFF, *small)[1]
    assert re.search(r"1e\+06 .*  U\n", err)


SWEEP = ("sweep", "pendulum", "--metric", "t_end", "--t-end", "0.1")
USAGE = [  # exit code 2: the words, and facts of the answer
    *((("report", "pendulum", f"--rounds={n}"), ["argument --rounds", f"'{n}'", "100000"])
      for n in ("0", "-3", "x", "1.5", "1e3", "", "100001", "9" * 5000)),
    *((("run", "pendulum", f"{option}={value}"), [f"argument {option}", f"'{value}'"])
      for option, values in {"--t-end": ("0", "nan", "-1"), "--step": ("inf", "1s")}.items()
      for value in values),
    *((("--port=" + port,), ["argument --port", "65535", f"'{port}'"])
      for port in ("-1", "65536", "http", "8o8o")),
    *(((command, "pendulum", "--t-end", "1e300"), ["argument --t-end", "'1e300'"])
      for command in ("run", "sweep", "export")),
    *(((*SWEEP, "--set", x), [x]) for x in (
        "bodies.a.mass", "bodies.a.mass=", "x=1:2:0", "x=1:2:3:4", "=1")),
    ((*STIFF, "--axis", "mood"), ["'mood'"]),
    ((*STIFF, "--steps", "1,x"), ["--steps", "numbers"]),
    (("run", "pendulum", "--dt", "0.01"), ["--dt", "did you mean --step?"]),
    (("run", "pendulum", "--t_end=2", "--duration", "3"), ["did you mean --t-end?"]),
    ((*SWEEP, "--set=x=1", "--solver", "rk4"), ["did you mean --method?"]),
    (("pendulum", "--no_browser"), ["did you mean --no-browser?"]),
    (("chekc", "quadruped"), ["'chekc'", "check"]),
    (("simulate", "pendulum"), ["run"]),
    (("runn", "quadruped"), ["run", "sweep"]),
    (("map",), ["stability", "run"]),
    (("help",), ["run", "sweep"]),
]  # fmt: skip
REFUSED = [  # exit code 1
    ((*SWEEP, "--set", "bodies.rod.mass=1:2"), ["first:last:points"]),
    ((*STIFF, "-o", "map.pdf"), [".html", ".svg", ".json"]),
    ((*STIFF, "--methods", "rk5"), ["'rk5'"]),
    (("run", "quadruped", "--scenario", "trot"), ["scenario 'trot'", "stance, stand"]),
    (("run", "quadruped", "--method", "magic"), ["method", "'magic'", "rk4"]),
    (("run", "pendulum", "-o", "run.foo"), [".npz", ".html"]),
    (("--log", "none/page.log", "--no-browser"), ["none"]),
    *((("--host", host, "--no-browser"), [repr(host), "127.0.0.1"])
      for host in ("300.1.1.1", "192.0.2.1", "no such host", "x" * 300)),
    (("verify", "horse"), ["'horse'", "a01_simple_pendulum"]),
    (("verify", "horse.json"), ["horse.json"]),
    *((("export", "pendulum", *words.split()), facts) for words, facts in {
        "--open bodies.arm.mass -o x.html": ["bodies.arm.mass"],
        "-o a.png --live": ["page"],
        "-o a.mp4 --what digraph": ["--what"],
        "-o a.mp4 --at 1": ["--at"],
        "-o a.html --size 64x64": ["--size"],
        "-o a.png --columns arm": ["--columns"],
        "-o a.png --scenario nothing": ["nothing"],
        "-o a.png --at 99 --t-end 0.1": ["0 to 0.1 s"],
    }.items()),
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "facts", "code"), [*((*x, 2) for x in USAGE), *((*x, 1) for x in REFUSED)]
)
def test_a_refused_command_names_the_fault(capsys, words, facts, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, err = printed(capsys, *words, code=code)
    err = err if code == 1 else err.splitlines()[-1]
    assert [fact for fact in facts if fact not in err] == []
    assert not [*tmp_path.iterdir()]


def test_the_page_answers_and_ctrl_c_ends_it(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    log = tmp_path / "page.log"
    words = [sys.executable, "-m", "app", "pendulum", "--port", "0", "--no-browser"]
    page = subprocess.Popen(
        [*words, "--log", str(log), "--token", "on"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        url = page.stdout.readline().split()[-1]
        with urllib.request.urlopen(url, timeout=120) as answer:
            assert answer.status == 200
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(url.partition("?")[0], timeout=120)
        until(log.read_text, "an event in the log")
        page.send_signal(signal.SIGINT)
        _, err = page.communicate(timeout=120)
        assert page.returncode == 0
        assert "Traceback" not in err
    finally:
        page.kill()
        page.communicate()


def test_json_has_no_nan_and_no_arrays_and_tables_line_up():
    data = {"a": np.arange(2), "b": float("nan"), "c": (np.float64(1.5), np.bool_(True)), "d": ""}
    assert json.loads(to_json(data)) == {"a": [0, 1], "b": None, "c": [1.5, True], "d": ""}
    table = aligned([("a", 1, 0.5), ("long", 20, 10.0)], header=("name", "n", "x"))
    assert table == "name   n    x\na      1  0.5\nlong  20   10"


def test_a_reader_that_has_seen_enough_ends_the_command(tmp_path):
    pg.Model.serial(2000).save(tmp_path / "long.json")
    words = [sys.executable, "-m", "app", "info", str(tmp_path / "long.json")]
    writer = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert b"2000 bodies" in writer.stdout.readline()
    writer.stdout.close()
    assert writer.stderr.read() == b""
    writer.stderr.close()
    assert writer.wait(timeout=120) == 0


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
@pytest.mark.parametrize(("to", "code", "said"), [("> /dev/full", 1, "No space"), (">&-", 0, "")])
def test_an_output_that_is_full_or_closed_is_no_traceback(to, code, said):
    words = f"{shlex.quote(sys.executable)} -m app info four_bar --json {to}"
    done = subprocess.run(words, shell=True, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (code, code)
    assert said in done.stderr


def test_verify_tells_how_near_it_comes(capsys, tmp_path):
    rows = answered(capsys, "verify", "heavy_top", "mass_ratio_light_tip_1em6")["cases"]
    assert [row["case"] for row in rows] == ["heavy_top", "mass_ratio_light_tip_1em6"]
    assert all(row["ok"] and row["error"] <= row["target"] for row in rows)
    assert all(row["steps"] > 0 and row["seconds"] > 0 for row in rows)
    data = json.loads((pgraph_models.CASES / "double_pendulum.json").read_text())
    data["cases"][0]["run"] = {"method": "rk4", "step": 0.05}
    (tmp_path / "coarse.json").write_text(json.dumps(data))
    _, err = printed(capsys, "verify", tmp_path / "coarse.json", code=1)
    assert "double_pendulum" in err


@pytest.mark.parametrize(
    ("name", "words", "begins"),
    [
        ("a.png", ["--size", "64x48"], b"\x89PNG"),
        ("b.png", ["--at", "0.2", "--t-end", "0.3", "--dark"], b"\x89PNG"),
        ("d.svg", ["--what", "digraph"], b"<svg"),
        ("page.html", ["--live", "--open", "bodies.rod.mass=0.5:2"], b"pgraph_live"),
    ],
)
def test_export_draws(capsys, tmp_path, name, words, begins):
    file = tmp_path / name
    given = answered(capsys, "export", "pendulum", *words, "-o", file)
    assert given["bytes"] == file.stat().st_size
    assert begins in file.read_bytes()


def test_a_model_file_does_not_steer_the_terminal(tmp_path, capsys):
    """Escapes, marks that turn the direction of text, names without end."""
    names = ["a\x1b]0;t\x07\x1b[2J", "b\u202egnp", "c\r", "d\nd: fine", "x" * 100_000]
    for name in names:
        bad = {"bodies": [{"name": name}, {"name": "q", "parent": "zz"}, {"name": name}]}
        (tmp_path / "bad.json").write_text(json.dumps(bad))
        out, err = printed(capsys, "check", tmp_path / "bad.json", code=1)
        assert out == ""
        assert err.replace("\n", "").isprintable()
        assert not any(line.startswith("d: fine") for line in err.split("\n"))
        assert len(err) < 3000
    pg.Model.serial(2).replace(name="a\x1b[2J\u202e").save(tmp_path / "good.json")
    for word in ("check", "info"):
        out, _ = printed(capsys, word, tmp_path / "good.json")
        assert out.startswith(r"a\x1b[2J\u202e: ")


@pytest.mark.parametrize("word", ["info", "check", "run", "convert"])
def test_every_command_takes_folders_that_a_file_may_name(tmp_path, capsys, word):
    part = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    for folder in ("meshes", "urdf"):
        (tmp_path / folder).mkdir()
    (tmp_path / "meshes" / "part.obj").write_text(part)
    shape = '<collision><geometry><mesh filename="../meshes/part.obj"/></geometry></collision>'
    path = tmp_path / "urdf" / "bot.urdf"
    path.write_text(f'<robot name="bot"><link name="base">{shape}</link></robot>')
    out = [tmp_path / "bot.json"] if word == "convert" else []
    more = ["--t-end", "0.01"] if word == "run" else []
    read = " ".join(printed(capsys, word, path, *out, *more))
    assert word in ("info", "run") or "--root" in read  # a run cuts long notices
    read = " ".join(printed(capsys, word, path, *out, *more, "--root", tmp_path / "meshes"))
    assert "outside" not in read


def test_of_an_archive_a_member_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    path = tmp_path / "bots.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("a/one.urdf", "b/two.urdf"):
            archive.writestr(name, f'<robot name="{name}"><link name="base"/></robot>')
    for words in (["info", path], ["check", path, "--member", "c.urdf"]):
        _, err = printed(capsys, *words, code=1)
        assert "a/one.urdf" in err
        assert "b/two.urdf" in err
        assert "--member" in err
    for name in ("a/one.urdf", "b/two.urdf"):
        assert name in printed(capsys, "info", path, "--member", name)[0]
        out = tmp_path / "out.json"
        printed(capsys, "convert", path, out, "--member", name)
        assert pg.Model.load(out).name == name
    (tmp_path / "no.zip").write_bytes(b"PK")
    for name in ("no.zip", "none.zip"):
        assert name in printed(capsys, "info", tmp_path / name, code=1)[1]


def test_convert_keeps_its_input_and_asks_for_folders_that_are_there(tmp_path, capsys):
    file = tmp_path / "m.json"
    pg.Model.serial(2).save(file)
    (tmp_path / "link.json").symlink_to(file)
    before = file.read_bytes()
    for out in (file, tmp_path / "link.json"):
        assert str(out) in printed(capsys, "convert", file, out, code=1)[1]
    _, err = printed(capsys, "convert", file, tmp_path / "o.json", "--root", "/no", code=1)
    assert "/no" in err
    assert file.read_bytes() == before


def test_a_table_of_moment_arms_counts_the_states_without_a_shortest_way(capsys, tmp_path):
    """A path leads below one post and above the other, until the first one moves into it."""
    cart = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], mass=1)
    posts = [
        {"body": body, "point": (x, 0, 0), "radius": 0.5, "axis": (0, 0, 1), "side": (0, y, 0)}
        for body, x, y in (("cart", 0, -9), ("ground", -1, 9))
    ]
    path = pg.Spring(name="s", body="cart", point=(3, 1, 0), other_point=(-3, -1, 0), via=posts)
    pg.Model(bodies=[cart], forces=[path]).save(file := tmp_path / "posts.json")
    given = "arms", str(file), "--over", "cart", "--range", "-0.495,0.505", "--points", "101"
    (text,) = answered(capsys, *given)["notices"]
    assert "'s'" in text
    assert "at 50 of 101 coordinates, first at -0.495" in text


def test_arms_are_minus_the_slopes_of_the_lengths_in_their_table(capsys, tmp_path):
    arm = [pg.Body(name=n, parent=p, mass=1, inertia=(1, 1, 1), link=(1, 0, 0), limits=((-1, 1),))
           for n, p in (("upper", "ground"), ("lower", "upper"))]  # fmt: skip
    springs = [pg.Spring(name=n, body="lower", point=(0.5, y, 0), stiffness=1) for n, y in
               (("one", 0.1), ("two", -0.2))]  # fmt: skip
    elbow = pg.Output(name="elbow", kind="joint_position", at="lower")
    pg.Model(bodies=arm, forces=springs, outputs=[elbow]).save(tmp_path / "arm.json")
    given = "arms", str(tmp_path / "arm.json"), "--over", "lower"
    found = answered(capsys, *given, "--points", "201")
    assert list(found) == ["lower", "length.one", "length.two", "arm.one", "arm.two"]
    q = np.array(found["lower"])
    assert (q[0], q[-1], len(q)) == (-1.0, 1.0, 201)
    for name in ("one", "two"):
        slope = np.gradient(found[f"length.{name}"], q)[1:-1]
        np.testing.assert_allclose(found[f"arm.{name}"][1:-1], -slope, atol=1e-4)
    of_output = answered(capsys, *given[:3], "elbow", "--points", "201")
    assert [*of_output.values()] == [*found.values()]
    for typed in ("-30,45deg", "-30deg,45", "-30deg,45deg"):
        q = answered(capsys, *given, "--range", typed, "--points", "2")["lower"]
        np.testing.assert_allclose(q, np.deg2rad((-30, 45)), rtol=1e-15)
    for typed, fact in (("0,5mm", "mm"), ("0,1,2", "0,1,2"), ("0", "0,130deg"), ("a,1", "'a'")):
        err = printed(capsys, *given, "--range", typed, code=1)[1]
        assert "--range" in err
        assert fact in err
    table = tmp_path / "arms.csv"
    answered(capsys, *given, "--range=0,0.5", "--points", "3", "-o", str(table))
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 0], (0.0, 0.25, 0.5))


def test_beams_are_listed_and_divided_on_the_command_line(tmp_path, capsys):
    rod = pg.Beam(name="rod", length=1.0, EI=2.0, rho_a=0.5, strains=["bend_y"], damping_ratio=0.1)
    file = tmp_path / "rod.json"
    pg.Model(beams=[rod]).save(file)
    assert main(["info", str(file)]) == 0
    assert "rod: 20 segments, 1 m, EI 2, 2 N m², lowest 1.119 Hz" in capsys.readouterr().out
    assert main(["run", str(file), "--nodes", "rod=4", "--t-end", "0.1", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert 0 < data["space_error"] < 0.01
    with pytest.raises(SystemExit):
        main(["run", str(file), "--nodes", "rod"])
    assert "BEAM=N" in capsys.readouterr().err
