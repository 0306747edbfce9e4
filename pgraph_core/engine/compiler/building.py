"""Build optimised modules from numba's code, and the archive of all kernels.

The kernels of the archive are merged into one module before optimisation, so that shared functions
are only included once. The optimised module is then split into pieces. Each piece contains the
functions that are called by the same kernels. A kernel is loaded by loading its pieces.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from .. import every_kernel
from . import archive, loading, sources
from .jit import Kernel
from .lowering.dispatch import lowered
from .optimising import optimise, parsed

TRIPLE = "x86_64-unknown-linux-gnu"  # any of 64 bits: it is replaced where code is generated
# {lane width: the processors whose vectors code with such lanes suits best}
PROCESSORS = {4: "x86-64-v3", 8: "x86-64-v4"}
ALLOWED = {"memcpy", "memmove", "memset", "sqrt"}  # C functions that kernels may call


# -- the archive -----------------------------------------------------------------------------------


def build(path: Path = archive.FILE) -> Iterator[str]:
    """Build the archive, yielding a line per kernel. It takes a few minutes on two processors."""
    parts: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        running = []
        for width in PROCESSORS:
            out = Path(folder, str(width))
            command = [sys.executable, "-m", "pgraph_core.engine", "--pieces", str(out)]
            environment = {**os.environ, "PGRAPH_LANE_WIDTH": str(width)}
            if width != min(PROCESSORS):
                command.append("--lanes")
            process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
            running.append((process, out))
        for process, out in running:
            with process:
                assert process.stdout is not None
                yield from map(str.strip, process.stdout)
            if process.returncode:
                raise RuntimeError("a part of the archive was not made")
            parts.append(pickle.loads(out.read_bytes()))
    path.write_bytes(_joined(parts))
    yield f"{path.name}: {path.stat().st_size} bytes"


def _joined(parts: list[dict[str, Any]]) -> bytes:
    """Return the file that joins the results of several processes."""
    groups: list[list[str]] = []
    described: dict[str, Any] = {}
    pieces: dict[str, tuple[str, int, int]] = {}
    sections: dict[str, bytes] = {}
    if any(part["files"] != parts[0]["files"] for part in parts):
        raise RuntimeError("the sources have changed while the archive was made; make it again")
    for part in parts:
        for name, (symbol, own, files) in part["kernels"].items():
            if files not in groups:
                groups.append(files)
            described[name] = {"symbol": symbol, "pieces": own, "files": groups.index(files)}
        for section, held in part["pieces"].items():
            data = bytearray()
            for piece, code in held.items():
                pieces[piece] = (section, len(data), len(code))
                data += code
            sections[section] = bytes(data)
    index = {
        "llvm": llvm.llvm_version_info,
        "made_by": {"numba": version("numba"), "llvmlite": version("llvmlite")},
        "kernels": described,
        "pieces": pieces,
        "groups": groups,
        "files": parts[0]["files"],
    }
    return archive.written(index, sections)


def machine_code() -> Iterator[str]:
    """Write machine code from the archive for the usual processors, yielding a line for each."""
    for name, level in loading.LEVELS.items():
        path = archive.FILE.with_suffix(f".{name}")
        path.write_bytes(machine_code_of(level))
        yield f"{path.name}: {path.stat().st_size} bytes"


def machine_code_of(level: loading.Level) -> bytes:
    """Return a file of machine code from the archive, with one section per piece."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = loading.machine_for(f"{level.arch}-unknown-linux-gnu", level.cpu, "")
    found = archive.current()
    pieces = found.all_pieces("plain", f"lanes {level.lanes}")
    code = {p: loading.object_of(llvm.parse_bitcode(found.bitcode(p)), target) for p in pieces}
    return archive.written({}, code)


def make_pieces(out: Path, lanes_alone: bool) -> Iterator[str]:
    """Compile kernels and write their pieces. Those for lanes go into a separate module."""
    found: dict[str, Any] = {"kernels": {}, "pieces": {}}
    all_ = every_kernel()
    files = set().union(*(sources.sources(loading.file_of(one)) for one in all_))
    found["files"] = {  # hashed before the compilation
        sources.name_of(path): (sources.digest_of(path), sources.code_hash(path)) for path in files
    }
    for lanes in (True,) if lanes_alone else (False, True):
        section = f"lanes {loading.LANE_WIDTH}" if lanes else "plain"
        lowered = []
        for one in lowered_kernels([one for one in all_ if one.lanes is lanes], section):
            lowered.append(one)
            yield one.name
        take_apart(lowered, section, found)
    out.write_bytes(pickle.dumps(found))


class Lowered(NamedTuple):
    """A kernel in LLVM IR."""

    name: str
    symbol: str
    files: list[str]
    text: str
    around: str


def lowered_kernels(chosen: list[Kernel], section: str) -> Iterator[Lowered]:
    """Compile kernels to unoptimised LLVM IR, in one process so that helper names differ."""
    i = 0
    for one in chosen:
        files = sorted(map(sources.name_of, sources.sources(loading.file_of(one))))
        for variant in range(len(one.signatures)):
            symbol = f"{section.replace(' ', '')}_{i}"
            text, around = lowered(one, variant, symbol)
            yield Lowered(loading.name_of(one, variant), symbol, files, text, str(around))
            i += 1


def take_apart(lowered: list[Lowered], section: str, found: dict[str, Any]) -> None:
    """Merge and optimise kernels, and add their pieces to `found`."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    whole: Any = None
    names: dict[str, str] = {}  # numba's are thousands of letters long

    def short(found: re.Match[str]) -> str:
        name = found[1].strip('"')
        return f"@{names.setdefault(name, f'n{len(names)}')}" if "_ZN" in name else found[0]

    for one in lowered:
        module = parsed(NAME.sub(short, one.text))
        module.link_in(parsed(NAME.sub(short, one.around)))
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    roots = {one.name: (f"k_{one.symbol}", f"w_{one.symbol}") for one in lowered}
    exports = [symbol for pair in roots.values() for symbol in pair]
    cpu = PROCESSORS[8 if section == "lanes 8" else 4]
    optimise(whole, exports, loading.machine_for(TRIPLE, cpu, ""))
    found["pieces"][section], of = split(str(whole), roots, section.replace(" ", ""))
    for one in lowered:
        found["kernels"][one.name] = one.symbol, of[one.name], one.files


FUNCTION = re.compile(r"^define .*?^}\n", re.MULTILINE | re.DOTALL)
NAME = re.compile(r'@("[^"]*"|[\w.$-]+)')
LINKAGE = re.compile(r"^define (internal |private |external )?(dso_local )?")


def split(
    text: str, roots: dict[str, tuple[str, ...]], prefix: str
) -> tuple[dict[str, bytes], dict[str, list[str]]]:
    """Return ({piece: bitcode}, {kernel: its pieces}) for an optimised module."""
    bodies = {NAME.search(body)[1]: body for body in FUNCTION.findall(text)}  # type: ignore[index]
    calls = {
        name: {other for other in NAME.findall(body) if other in bodies and other != name}
        for name, body in bodies.items()
    }
    reached = {name: _reach(calls, own) for name, own in roots.items()}
    by: dict[frozenset[str], list[str]] = {}
    for function in bodies:
        users = frozenset(name for name, all_ in reached.items() if function in all_)
        if users:
            by.setdefault(users, []).append(function)
    short = {
        name: f"{prefix}_{i}" if name not in {s for own in roots.values() for s in own} else name
        for i, name in enumerate(bodies)
    }
    rest = FUNCTION.sub("", text)
    modules, of = dict[str, bytes](), {name: list[str]() for name in roots}
    for users, functions in by.items():
        inside = set(functions)
        needed = set().union(*(calls[name] for name in functions)) - inside
        parts = [_definition(bodies[name]) for name in functions]
        parts += [_declaration(bodies[name]) for name in sorted(needed)]
        code = _bitcode(_renamed(rest + "\n".join(parts), short), inside, short)
        piece = hashlib.sha256(code).hexdigest()[:24]
        modules[piece] = code
        for name in users:
            of[name].append(piece)
    return modules, of


def _reach(calls: dict[str, set[str]], start: Iterable[str]) -> set[str]:
    found, new = set(start), list(start)
    while new:
        more = calls[new.pop()] - found
        found |= more
        new += more
    return found


def _definition(body: str) -> str:
    return LINKAGE.sub("define ", body)


def _declaration(body: str) -> str:
    head = LINKAGE.sub("declare ", body.split("\n", 1)[0].rstrip("{ "))
    return re.sub(r" (personality .*|comdat.*|align \d+)$", "", head)


def _renamed(text: str, short: dict[str, str]) -> str:
    return NAME.sub(lambda m: f"@{short.get(m[1], m[1])}", text)


def _bitcode(text: str, inside: set[str], short: dict[str, str]) -> bytes:
    module = llvm.parse_assembly(text)
    for one in module.global_variables:
        if not one.is_declaration:
            one.linkage = "internal"
    builder = llvm.create_pass_builder(
        loading.machine_for(TRIPLE, "x86-64", ""),
        llvm.create_pipeline_tuning_options(speed_level=0),
    )
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    passes.add_strip_symbols_pass()
    passes.run(module, builder)
    module.verify()
    own = {short[name] for name in inside}
    outside = {
        one.name
        for one in (*module.functions, *module.global_variables)
        if one.is_declaration and not one.name.startswith("llvm.")
    } - {*short.values()}
    if not outside <= ALLOWED or not own:
        raise RuntimeError(f"kernels need {', '.join(sorted(outside - ALLOWED))} from outside")
    return module.as_bitcode()
