"""Damaged files for every reader: `python -m benchmarks.hostile_files --inputs 1000`.

A reader must answer whatever it is given with a model, a mesh, a run, or a sentence (PgraphError),
within `SLOW` seconds of processor time and `MEMORY` bytes. Good files are damaged by their bytes,
by their words and numbers, and by pieces of one another. Each reader works in a process of its
own, so that a death or a hang is counted and the next input goes on.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import re
import resource
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import trimesh

import pgraph_core as pg
import pgraph_models
from benchmarks.machine import machine
from pgraph_app.core import cells
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.model import archive
from pgraph_app.session.update import Connected
from pgraph_app.table.update import Paste
from pgraph_core.formats import read_model, write_model
from pgraph_core.mesh_files import load_mesh

SLOW = 1.0  # [s] of processor time for one input
HANGS = 30.0  # [s] after which a reader is killed
MEMORY = 1 << 30  # [bytes] beyond what the process has at its start
REFUSED = (pg.PgraphError, cells.Refusal)
NUMBERS = (
    "nan", "inf", "-inf", "1e999", "-1", "0", "1e308", "1e-320", "9" * 400, "0x10", "1_0", "",
    "true", "null", '""', "[]", "{}", "\u0661", "1e", "-", "2147483648", "18446744073709551616",
)  # fmt: skip
WORDS = re.compile(rb"[A-Za-z_]\w*")
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
PIECE = re.compile(rb"<[^>]*>|\{|\}|\[|\]|,|\n|\"[^\"]*\"")
JOINED = b"""<mujoco><default><default class="x"><geom density="500"/></default></default>
<worldbody><geom type="plane" size="1 1 1"/><body name="a" pos="0 0 1"><freejoint/>
<geom class="x" size="0.1"/>
<body name="b" pos="0 0 1"><joint name="h" axis="0 1 0" range="-1 1"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.05"/><site name="s"/></body></body></worldbody>
<equality><joint joint1="h" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="h" gear="3" ctrlrange="-1 1"/></actuator></mujoco>"""


@dataclass(frozen=True)
class Reader:
    """What reads files of one kind, and good files of it."""

    name: str
    suffix: str
    good: tuple[bytes, ...]
    read: Callable[[Path], object]


@dataclass
class Tally:
    """What one reader did with its inputs."""

    inputs: int = 0
    taken: int = 0
    raw: Counter[str] = None  # type: ignore[assignment]
    slow: int = 0
    deaths: int = 0
    worst: float = 0.0  # [s] of processor time

    def __post_init__(self) -> None:
        self.raw = Counter()


def readers(folder: Path) -> Iterator[Reader]:
    """Every reader of files and pasted text."""
    quadruped = pg.Model.load(pgraph_models.path("quadruped"))
    loop = pg.Model.load(pgraph_models.path("four_bar"))
    texts = tuple(m.to_json().encode() for m in (quadruped, loop))
    yield Reader("model", ".json", texts, _model)
    for suffix in ("urdf", "xml"):
        good = []
        for k, model in enumerate((quadruped, loop)):
            write_model(model, folder / f"{k}.{suffix}")
            good.append((folder / f"{k}.{suffix}").read_bytes())
        yield Reader(suffix, f".{suffix}", (*good, *((JOINED,) if suffix == "xml" else ())), _model)
    box = trimesh.creation.box((1, 1, 1))
    for suffix in ("stl", "obj", "off", "ply", "glb"):
        box.export(folder / f"box.{suffix}")
        good = (folder / f"box.{suffix}").read_bytes()
        yield Reader(suffix, f".{suffix}", (good,), load_mesh)
    yield Reader("dae", ".dae", (_collada(),), load_mesh)
    (folder / "a").mkdir()
    box.export(folder / "a" / "box.stl")
    cup = {"name": "cup", "shape": {"kind": "mesh", "file": "box.stl"}}
    (folder / "a" / "model.json").write_text(json.dumps({"bodies": [cup]}), "utf-8")
    yield Reader("zip", ".zip", (archive.zipped(folder / "a"),), _archive)
    pg.simulate(pg.Model.serial(2), t_end=0.01).save(folder / "run.npz")
    yield Reader("run", ".npz", ((folder / "run.npz").read_bytes(),), pg.Result.load)
    pasted = b"Body\tParent\tDoF\tMass\tlink x\na\tground\t1 hinge\t1.5\t0.2\nb\ta\t3\t2\t0.1\n"
    yield Reader("pasted text", ".txt", (pasted,), _paste)


def _model(path: Path) -> object:
    """Whatever reads it: the model must also be one that can be used and saved."""
    model, _ = read_model(path)
    pg.Mechanism(model)
    return pg.Model.from_json(model.to_json())


def _archive(path: Path) -> object:
    with tempfile.TemporaryDirectory() as keep:
        return archive.unpacked(path.read_bytes(), Path(keep))


def _paste(path: Path) -> object:
    text = path.read_bytes().decode("utf-8", "replace")
    state = update(initial(pg.Model.serial(2)), Connected(1))
    return update(state, Paste(1, serial=1, text=text, rows=(), column=0))


def _collada() -> bytes:
    return (
        b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
        b'<unit meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g">'
        b'<mesh><source id="p"><float_array id="f" count="12">0 0 0 1 0 0 0 1 0 0 0 1'
        b'</float_array><technique_common><accessor source="#f" count="4" stride="3"/>'
        b'</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>'
        b'</vertices><triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
        b"<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>"
        b'<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>'
        b"</visual_scene></library_visual_scenes></COLLADA>"
    )


def damaged(good: tuple[bytes, ...], seed: int) -> bytes:
    """One of the good files with one to four faults."""
    rng = random.Random(seed)
    content = rng.choice(good)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        content = rng.choice(FAULTS)(content, rng, good)
    return content


def _flip(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + bytes([rng.randrange(256)]) + content[at + 1 :]


def _cut(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    a, b = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    return content[:a] if rng.random() < 0.3 else content[:a] + content[b:]


def _repeat(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    a = rng.randrange(len(content) + 1)
    b = min(len(content), a + rng.choice((1, 8, 64, 512)))
    return content[:b] + content[a:b] * rng.choice((1, 2, 50)) + content[b:]


def _number(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    return _swapped(content, NUMBER, rng.choice(NUMBERS).encode(), rng)


def _word(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    words = WORDS.findall(rng.choice(good)) or [b"x"]
    return _swapped(content, WORDS, rng.choice((*words[:400], b"", b"ground", b"\xc3\xa9")), rng)


def _piece(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    pieces = PIECE.findall(rng.choice(good)) or [b""]
    return _swapped(content, PIECE, rng.choice((*pieces[:400], b"")), rng)


def _spliced(content: bytes, rng: random.Random, good: tuple[bytes, ...]) -> bytes:
    other = rng.choice(good)
    return content[: rng.randrange(len(content) + 1)] + other[rng.randrange(len(other) + 1) :]


def _swapped(content: bytes, pattern: re.Pattern[bytes], by: bytes, rng: random.Random) -> bytes:
    found = [m.span() for m in pattern.finditer(content)]
    if not found:
        return content
    a, b = rng.choice(found)
    return content[:a] + by + content[b:]


FAULTS = (_flip, _cut, _repeat, _number, _number, _number, _word, _word, _piece, _piece, _spliced)


def read_one(reader: Reader, content: bytes, folder: Path) -> tuple[str, float]:
    """("taken" or "refused" or the raw error, processor seconds)"""
    path = folder / f"input{reader.suffix}"
    path.write_bytes(content)
    began = time.process_time()
    try:
        reader.read(path)
        answer = "taken"
    except REFUSED as error:
        answer = "refused" if str(error) else "a refusal that says nothing"
    except MemoryError:
        answer = f"MemoryError: more than {MEMORY / 1e9:.1f} GB"
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        answer = f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}: {error}"
    return answer[:200], time.process_time() - began


def _work(name: str, seeds: range, pipe: Connection) -> None:
    """A process: every answer goes to the pipe as it comes."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (reader,) = (r for r in readers(folder) if r.name == name)
        (folder / "inputs").mkdir()
        for content in reader.good:  # its libraries load now
            answer, _ = read_one(reader, content, folder / "inputs")
            assert answer == "taken", f"{name}: a good file gives {answer}"
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        for seed in seeds:
            pipe.send((seed, *read_one(reader, damaged(reader.good, seed), folder / "inputs")))
    pipe.send(None)


def attack(name: str, seeds: range) -> Tally:
    """What the reader of this name does with the damaged files of these seeds."""
    tally, context = Tally(), multiprocessing.get_context("fork")
    while len(seeds):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(name, seeds, theirs))
        process.start()
        theirs.close()
        done = seeds.start
        try:
            while ours.poll(HANGS) and (got := ours.recv()) is not None:
                seed, answer, spent = got
                done = seed + 1
                tally.inputs += 1
                tally.worst = max(tally.worst, spent)
                tally.taken += answer == "taken"
                tally.slow += spent > SLOW
                if spent > SLOW:
                    tally.raw[f"{spent:.1f} s for seed {seed}"] += 1
                if answer not in ("taken", "refused"):
                    tally.raw[f"{answer} (seed {seed})" if not tally.raw[answer] else answer] += 1
            else:
                if done == seeds.stop:
                    return tally
                raise EOFError  # it hangs
        except EOFError:
            tally.deaths += 1
            tally.inputs += 1
            tally.raw[f"death or hang at seed {done}"] += 1
            process.kill()
        finally:
            process.join(1.0)
            process.kill()
        seeds = range(done + 1, seeds.stop)
    return tally


NAMES = (
    "model", "urdf", "xml", "stl", "obj", "off", "ply", "glb", "dae", "zip", "run", "pasted text",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1000, help="of each reader")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--reader", choices=NAMES)
    parser.add_argument("--add", type=Path, help="a JSON file of counts that are added up")
    args = parser.parse_args()
    told = machine()
    print(f"Measured on {told['cpu']}, {told['cores']} cores, Python {told['python']}.\n")
    print("| reader | inputs | taken | raw errors | over 1 s | deaths, hangs | slowest [ms] |")
    print("|---|---|---|---|---|---|---|")
    known: dict[str, Any] = {}
    if args.add and args.add.exists():
        known = json.loads(args.add.read_text("utf-8"))
    for name in [args.reader] if args.reader else NAMES:
        t = attack(name, range(args.seed, args.seed + args.inputs))
        raw = sum(n for text, n in t.raw.items() if "seed" not in text or "Error" in text)
        row = [t.inputs, t.taken, raw, t.slow, t.deaths]
        row = [a + b for a, b in zip(row, known.get(name, [0] * 5))]
        known[name] = row
        print(f"| {name} | {' | '.join(map(str, row))} | {1e3 * t.worst:.0f} |", flush=True)
        for text, n in t.raw.most_common(20):
            print(f"    {n} x {text}")
    if args.add:
        args.add.write_text(json.dumps(known), "utf-8")


if __name__ == "__main__":
    main()
