"""Build optimised modules from numba's code, and the archive of all kernels.

Kernels of the archive are merged into one module before they are optimised, so that what several
of them call is there once. The optimised module is taken apart again: the functions that the same
kernels reach make up a piece. To load a kernel is to load its pieces.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock

from .. import every_kernel
from . import archive, loading, sources
from .jit import Kernel
from .lowering.dispatch import Library, lowered

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


# -- optimised modules of numba's code -------------------------------------------------------------


def module_of(kernel: Kernel, variant: int, symbol: str, target: Any) -> Any:
    """Return one kernel as an optimised module."""
    text, around = lowered(kernel, variant, symbol)
    whole = parsed(text)
    whole.link_in(parsed(str(around)))
    optimise(whole, (f"k_{symbol}", f"w_{symbol}"), target)
    return whole


def parsed(text: str) -> Any:
    """Parse a numba module for any processor."""
    text = re.sub(r'"(target-cpu|target-features|tune-cpu)"="[^"]*"', "", text)
    # numba's environments, which nothing reads
    return llvm.parse_assembly(text.replace("= common ", "= linkonce_odr "))


def optimise(whole: Any, exports: Iterable[str], target: Any) -> None:
    """Inline and optimise a module as numba does, exporting only these functions."""
    whole.triple, whole.data_layout = target.triple, str(target.target_data)
    export(whole, exports)
    cheap = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=0))
    passes = cheap.getModulePassManager()
    passes.add_loop_rotate_pass()
    passes.add_instruction_combine_pass()
    passes.add_jump_threading_pass()
    passes.run(whole, cheap)
    optimise_fully(whole, target)


def export(whole: Any, exports: Iterable[str]) -> None:
    """Make all functions and data of a module internal but these."""
    outside = set(exports)
    for one in (*whole.functions, *whole.global_variables):
        if not one.is_declaration:
            one.linkage = "external" if one.name in outside else "internal"
    whole.verify()


def optimise_fully(whole: Any, target: Any) -> None:
    """Inline and vectorise at the highest level."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = True
    full = llvm.create_pass_builder(target, options)
    full.getModulePassManager().run(whole, full)


# -- WebAssembly -----------------------------------------------------------------------------------
# Numba's unoptimised LLVM code names members of structs and not their places: given the data layout
# of wasm32 before anything is optimised, it takes pointers of 4 bytes.


WASM = "wasm32-unknown-unknown"
LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
FEATURES = "+simd128,+bulk-memory,+mutable-globals,+sign-ext,+nontrapping-fptoint"
TABLE = "table_of_kernels"  # their numbers in the table of functions, in the order given
BYTE = ir.IntType(8).as_pointer()


def object_of(kernels: Sequence[Kernel]) -> tuple[bytes, list[str]]:
    """Return (object file, exported names) for kernels.

    The process is of no other use afterwards: its kernels are compiled for WebAssembly.
    """
    with global_compiler_lock:
        whole, exports = compiled(kernels)
        return optimised(whole, exports), exports


def compiled(kernels: Sequence[Kernel]) -> tuple[Any, list[str]]:
    """Return one unoptimised module of all kernels, and the names that it exports."""
    libraries: tuple[Any, ...] = (CPUCodeLibrary, Library)
    for library in libraries:
        library._optimize_functions = library._optimize_final_module = _as_it_is
    whole = llvm.parse_assembly(f'target triple = "{WASM}"\ntarget datalayout = "{LAYOUT}"')
    table = ir.Module()
    table.triple, table.data_layout = WASM, LAYOUT
    names = [kernel.__name__ for kernel in kernels]
    exports = [f"k_{name}" for name in names]
    for kernel, name in zip(kernels, names):
        text, around = lowered(kernel, 0, name)
        around.triple, around.data_layout = WASM, LAYOUT
        whole.link_in(portable(text))
        whole.link_in(llvm.parse_assembly(str(around)))
        print(name, flush=True)
    kinds = ir.ArrayType(BYTE, len(names))
    functions = [ir.Function(table, ir.FunctionType(ir.VoidType(), ()), one) for one in exports]
    numbers: Any = ir.GlobalVariable(table, kinds, TABLE)
    numbers.global_constant = True
    numbers.initializer = ir.Constant(kinds, [function.bitcast(BYTE) for function in functions])
    whole.link_in(llvm.parse_assembly(str(table)))
    return whole, [*exports, TABLE]


def _as_it_is(library: Any, *_: Any) -> None:
    """Replace numba's own passes, which insert offsets for this machine into the code."""


def portable(text: str) -> Any:
    """Convert a numba module to a module for wasm32."""
    text = re.sub(r'target triple = ".*"', f'target triple = "{WASM}"', text)
    text = re.sub(r'target datalayout = ".*"', f'target datalayout = "{LAYOUT}"', text)
    return parsed(text)


def optimised(whole: Any, exports: list[str]) -> bytes:
    """Return the optimised module as an object file."""
    export(whole, exports)
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(WASM).create_target_machine(
        cpu="generic", features=FEATURES, opt=3, reloc="static"
    )
    optimise_fully(whole, machine)
    return machine.emit_object(whole)
