"""The archive of kernels: it belongs to its sources, and a run needs no compiler where it fits."""

import hashlib
import io
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from pgraph_core.engine.compiler import archive, loading, sources
from pgraph_core.engine.compiler.jit import JIT

from ..nights import at_night

pytestmark = pytest.mark.skipif(not JIT, reason="nothing is compiled")
STALE = archive.current().stale() or archive.current().problem
fits = pytest.mark.skipif(bool(STALE), reason=f"make the archive again: {archive.COMMAND}")

RUN = """
import hashlib, sys
import pgraph_core as pg
run = pg.simulate(pg.Model.serial(3), t_end=0.1)
print(hashlib.sha256(run.q.tobytes() + run.v.tobytes()).hexdigest(), "numba" in sys.modules)
"""


def told(*lines: str, **environment: str) -> tuple[str, str]:
    """Return what a new process prints, and what it says besides."""
    code = "\n".join((*lines, RUN))
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **environment}, check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    return done.stdout, done.stderr


def with_archive(path: Path) -> str:
    """Return the line that lets a process take another archive."""
    return (
        "import pathlib; from pgraph_core.engine.compiler import archive; "
        f"archive.FILE = pathlib.Path({str(path)!r}); "
        "archive.current = lambda one=archive.Archive(archive.FILE): one"
    )


@pytest.mark.nightly
def test_no_kernel_of_the_archive_is_older_than_its_sources():
    assert not archive.current().problem
    assert archive.current().stale() == []


@fits
def test_every_kernel_of_the_package_is_in_the_archive():
    code = (
        "from pgraph_core.engine import every_kernel\n"
        "from pgraph_core.engine.compiler import archive, loading\n"
        "known = set(archive.current().names())\n"
        "for one in every_kernel():\n"
        "    for i in range(len(one.signatures)):\n"
        "        if (name := loading.name_of(one, i)) not in known: print(name)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


@fits
def test_a_first_run_needs_no_compiler_and_says_nothing(tmp_path):
    found, said = told(PGRAPH_CACHE=str(tmp_path))
    assert found.split()[1] == "False"
    assert said == ""
    assert told(PGRAPH_CACHE=str(tmp_path)) == (found, "")


FOUR_BAR, WAYS = "pg.Model.load(pgraph_models.path('four_bar'))", ["rk4", "dopri5", "auto"]


@fits
@pytest.mark.parametrize(
    ("model", "methods"),
    at_night((FOUR_BAR, ["rk4"]), (FOUR_BAR, ["dopri5", "auto"]), ("pg.Model.serial(2)", WAYS)),
)
def test_first_derivatives_need_no_compiler(tmp_path, model, methods):
    code = (
        f"import sys, pgraph_core as pg, pgraph_models; model = {model}\n"
        "path = f'bodies.{model.bodies[-1].name}.mass'\n"
        f"for method in {methods}:\n"
        "    run = pg.simulate(model, t_end=0.01, method=method, wrt=[path])\n"
        "    assert run.sensitivity(path).shape[0] == len(run.t)\n"
        "print('numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True,
        env={**os.environ, "PGRAPH_CACHE": str(tmp_path)},
    )  # fmt: skip
    assert done.stdout.split() == ["False"]


def test_the_archive_stays_small():
    assert archive.FILE.stat().st_size <= 3_000_000


def test_a_terminal_says_what_a_long_generation_is_for(monkeypatch):
    clock = iter([0.0, 0.6, 1.0, 1.6, 2.0, 2.6])
    monkeypatch.setattr(loading, "_spent", 0.0)
    monkeypatch.setattr(loading, "_SAID", set())
    monkeypatch.setattr(loading.time, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(loading.sys, "stderr", said := io.StringIO())
    said.isatty = lambda: True
    monkeypatch.setattr(loading, "object_of", lambda module: b"code")
    monkeypatch.setattr(loading, "keep", lambda piece, code: None)
    monkeypatch.setattr(loading.llvm, "parse_bitcode", lambda bits: None)
    monkeypatch.setattr(archive, "current", lambda: SimpleNamespace(bitcode=lambda piece: b""))
    texts = []
    for _ in range(3):
        loading._generated("piece")
        texts.append(said.getvalue())
    assert texts[0] == ""
    assert "once" in texts[1]
    assert texts[2] == texts[1]


@fits
@pytest.mark.nightly
def test_two_processes_at_once_and_folders_that_cannot_be_written_give_the_same_bits(tmp_path):
    (tmp_path / "file").write_text("")
    closed = {"PGRAPH_CACHE": str(tmp_path / "file"), "XDG_CACHE_HOME": str(tmp_path / "file")}
    with ThreadPoolExecutor(2) as both:
        again = both.map(lambda _: told(PGRAPH_CACHE=str(tmp_path)), range(2))
        assert {*again, told(**closed), told(PGRAPH_PROCESSOR="generic")} == {told()}


def problem(path: Path) -> str:
    return archive.Archive(path).problem


def test_a_file_that_is_no_archive_says_why_and_has_no_kernels(tmp_path, monkeypatch):
    path = tmp_path / "kernels.archive"
    assert "missing" in problem(path)
    index = {"llvm": (1, 0, 0), "kernels": {}, "pieces": {}, "groups": [], "files": {}}
    path.write_bytes(whole := archive.written(index, {"plain": b"123"}))
    assert problem(path) == ""
    for content in (
        b"", whole[:20], whole[:-1], whole + b"0", bytes(1) + whole[1:],
        whole[:40] + bytes([whole[40] ^ 1]) + whole[41:],
    ):  # fmt: skip
        path.write_bytes(content)
        assert "damaged" in problem(path)
        assert archive.Archive(path).pieces("engine.motion.acceleration:0") is None
    path.write_bytes(archive.written({**index, "llvm": (10**6, 0, 0)}, {}))
    assert "LLVM 1000000.0.0" in problem(path)
    monkeypatch.setattr(archive, "FORM", -1)
    path.write_bytes(whole := archive.written(index, {}))
    monkeypatch.undo()
    assert "version" in problem(path)
    path.unlink()
    path.mkdir()
    assert "cannot be read" in problem(path)


def test_a_kernel_is_stale_where_a_file_of_its_own_has_other_code(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "ENGINE", tmp_path)
    texts = {"a.py": "x = 1\n", "b.py": "y = 2\n"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    index = {
        "llvm": (1, 0, 0),
        "kernels": {
            "one": {"symbol": "s", "pieces": ["p"], "files": 0},
            "both": {"symbol": "t", "pieces": ["p", "q"], "files": 1},
        },
        "pieces": {"p": ("plain", 0, 1), "q": ("plain", 1, 1)},
        "groups": [["a.py"], ["a.py", "b.py"]],
        "files": {
            name: (
                hashlib.sha256(text.encode()).hexdigest()[:16],
                sources.code_hash(tmp_path / name),
            )
            for name, text in texts.items()
        },
    }
    path = tmp_path / "kernels.archive"
    path.write_bytes(archive.written(index, {"plain": b"pq"}))

    def stale(**edits: str) -> list[str]:
        for name, text in edits.items():
            (tmp_path / f"{name}.py").write_text(text)
        for kept in (sources.digest_of, sources.code_hash):
            kept.cache_clear()
        return archive.Archive(path).stale()

    assert stale() == []
    assert stale(b='"""Said."""\n\ny = 2  # again\n') == []
    assert stale(b="y = 3\n") == ["both"]
    assert stale(b="y = 2\n", a="x = 2\n") == ["one", "both"]
    (tmp_path / "a.py").unlink()
    assert stale() == ["one", "both"]
    found = archive.Archive(path)
    assert "older" in found.why("one")
    assert "lacks" in found.why("three")
    assert found.bitcode("q") == b"q"


def test_a_function_that_makes_kernels_is_part_of_the_source_of_a_force(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "FORCES", tmp_path)
    path = tmp_path / "pull.py"
    hashes = set()
    for factor in (2, 3):
        path.write_text(
            f"def onto(push):\n    @part\n    def exert(x):\n        return {factor} * x\n"
        )
        for kept in (sources.digest_of, sources.code_hash):
            kept.cache_clear()
        hashes.add(sources.code_hash(path))
    path.write_text("def packed(f):\n    return 1\n")
    for kept in (sources.digest_of, sources.code_hash):
        kept.cache_clear()
    alone = sources.code_hash(path)
    path.write_text("def packed(f):\n    return 2\n")
    for kept in (sources.digest_of, sources.code_hash):
        kept.cache_clear()
    assert len(hashes) == 2
    assert sources.code_hash(path) == alone


@fits
@pytest.mark.nightly
def test_without_a_usable_archive_a_run_has_the_same_bits_and_one_sentence_why(tmp_path):
    whole = archive.FILE.read_bytes()
    wanted, _ = told()
    for k, content in enumerate((None, whole[: len(whole) // 2])):
        path = tmp_path / f"{k}.archive"
        if content is not None:
            path.write_bytes(content)
        found, said = told(with_archive(path), PGRAPH_CACHE=str(tmp_path / "cache"))
        assert found.split()[0] == wanted.split()[0]
        if k == 0:
            assert said.count("\n") == 1
            assert "archive of kernels is missing" in said
        else:
            assert said == ""  # the cache has what was compiled before


@pytest.mark.parametrize(
    ("triple", "features", "lanes", "wanted"),
    [
        ("x86_64-unknown-linux-gnu", loading.V4, 8, "x86-64-v4"),
        ("x86_64-alpine-linux-musl", loading.V4, 8, "x86-64-v4"),
        ("x86_64-unknown-linux-gnu", loading.V3, 4, "x86-64-v3"),
        ("x86_64-unknown-linux-gnu", loading.V3.replace("fma", ""), 4, None),
        ("x86_64-unknown-linux-gnu", loading.V4, 4, "x86-64-v3"),
        ("x86_64-unknown-linux-gnu", loading.V3, 8, None),
        ("aarch64-unknown-linux-gnu", "neon", 4, "aarch64"),
        ("aarch64-apple-darwin", "neon", 4, None),
        ("x86_64-pc-windows-msvc", loading.V4, 8, None),
        ("riscv64-unknown-linux-gnu", "", 4, None),
    ],
)
def test_machine_code_is_chosen_by_what_it_needs(monkeypatch, triple, features, lanes, wanted):
    binding = SimpleNamespace(
        get_process_triple=lambda: triple,
        get_host_cpu_features=lambda: dict.fromkeys(features.split(), True),
    )
    monkeypatch.setattr(loading, "llvm", binding)
    monkeypatch.setattr(loading, "LANE_WIDTH", lanes)
    found = [name for name, level in loading.LEVELS.items() if level.runs_here()]
    assert found[:1] == ([wanted] if wanted else [])


@fits
@pytest.mark.nightly
def test_machine_code_of_the_package_is_used_and_its_faults_are_told(tmp_path):
    from pgraph_core.engine.compiler import building

    path = tmp_path / "kernels.archive"
    path.write_bytes(archive.FILE.read_bytes())
    name, level = next((n, one) for n, one in loading.LEVELS.items() if one.runs_here())
    code = path.with_suffix(f".{name}")
    code.write_bytes(building.machine_code_of(level))

    def run(case: str, **environment: str) -> tuple[str, str, int]:
        cache = tmp_path / case
        found, said = told(with_archive(path), PGRAPH_CACHE=str(cache), **environment)
        return found, said, len(list((cache / "kernels").iterdir()))

    found, said, made = run("brought")
    assert said == ""
    assert made == 1  # the entrance of kernels, which is no piece of the archive
    whole = code.read_bytes()
    again, said, more = run("generic", PGRAPH_PROCESSOR="generic")
    assert again == found
    assert said == ""
    assert more > made
    for case, content in {"cut": whole[:-1], "empty": b"", "changed": whole[:-1] + b"0"}.items():
        code.write_bytes(content)
        again, said, more = run(case)
        assert again == found
        assert "damaged" in said
        assert said.count("\n") == 1
        assert more > made
    code.write_bytes(archive.written({}, {}))  # of an archive before
    assert run("foreign")[:2] == (found, "")


def test_a_force_is_stale_where_its_law_changes_and_not_its_description(tmp_path, monkeypatch):
    engine, forces = tmp_path / "engine", tmp_path / "forces"
    engine.mkdir()
    forces.mkdir()
    monkeypatch.setattr(archive, "ENGINE", engine)
    monkeypatch.setattr(sources, "FORCES", forces)
    text = "class Pull:\n    x = 1\n\n\n@part\ndef law():\n    return 3\n"
    (file := forces / "pull.py").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    index = {
        "llvm": (1, 0, 0),
        "kernels": {"law": {"symbol": "s", "pieces": ["p"], "files": 0}},
        "pieces": {"p": ("plain", 0, 1)},
        "groups": [["../forces/pull.py"]],
        "files": {"../forces/pull.py": (digest, sources.code_hash(file))},
    }
    path = engine / "kernels.archive"
    path.write_bytes(archive.written(index, {"plain": b"p"}))
    for changed, stale in (("x = 2", []), ("return 4", ["law"])):
        file.write_text(text.replace("x = 1" if "x" in changed else "return 3", changed))
        for kept in (sources.digest_of, sources.code_hash):
            kept.cache_clear()
        assert archive.Archive(path).stale() == stale
