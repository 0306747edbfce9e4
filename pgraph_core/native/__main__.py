"""Command line for `python -m pgraph_core.native [PLATFORM ...]`, which makes the libraries.

This script is only required for releases. It takes about a minute per platform, and requires a
linker, which is installed by `pip install -e .[release]`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from ..engine.compiler.archive import current
from ..engine.compiler.loading import name_of
from . import library
from .library import CALLED, LINKED, PLATFORMS, Platform

FLAGS = ("-std=c23", "-O2", "-Wall", "-Wextra", "-Werror", "-fvisibility=hidden", "-DPGRAPH_BUILDS",
         "-ffp-contract=off", "-fno-sanitize=undefined", "-s", "-shared")  # fmt: skip


def main(names: list[str]) -> None:
    """Make, compress and write the libraries together with their build record."""
    linker = version("ziglang")  # before a minute of compiling
    stale = current().stale()
    if stale:
        raise SystemExit(f"the archive is older than {stale[0]}; python -m pgraph_core.engine")
    library.LIBRARIES.mkdir(exist_ok=True)
    whole = bitcode()
    for name in names or PLATFORMS:
        path = library.packed_file(name)
        made = {**library.unpacked(path)} | {name: linked(object_of(whole, PLATFORMS[name]), name)}
        path.write_bytes(library.packed({x: made[x] for x in PLATFORMS if x in made}))
        library.unpacked.cache_clear()
        _note(name, linker)
        print(f"{name}: {len(made[name])} bytes; {path.name}: {path.stat().st_size}", flush=True)


def _note(name: str, linker: str) -> None:
    """Add a library to the build record."""
    known = json.loads(library.ABOUT.read_text("utf-8")) if library.ABOUT.is_file() else {}
    about = {
        "sources": {**known.get("sources", {}), name: library.digest()},
        "kernels": library.kernels_digest(),
        "made_by": {"llvmlite": version("llvmlite"), "ziglang": linker},
    }
    library.ABOUT.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def bitcode() -> bytes:
    """Return one module of all kernels from the archive, which exports them by their names."""
    archive, named = current(), library.kernels()
    symbols = {name: archive.symbol(name_of(one, 0)) for name, one in named.items()}
    pieces = dict.fromkeys(
        piece for one in named.values() for piece in archive.pieces(name_of(one, 0)) or ()
    )
    whole, *others = (llvm.parse_bitcode(archive.bitcode(piece)) for piece in pieces)
    for one in others:
        whole.link_in(one)
    exported = {f"k_{symbols[x]}": f"k_{x}" for x in LINKED}
    exported |= {f"w_{symbols[x]}": f"w_{x}" for x in CALLED}
    for one in (*whole.functions, *whole.global_variables):
        if one.is_declaration:
            continue
        if one.name in exported:
            one.visibility = "hidden"
            one.name = exported[one.name]
        else:
            one.linkage = "internal"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    passes.run(whole, llvm.create_pass_builder(_machine(PLATFORMS["x86_64-linux"]), options))
    return whole.as_bitcode()


def _machine(platform: Platform) -> Any:
    """Return the code generator of a platform, for all of its processors."""
    cpu = "x86-64" if platform.triple.startswith("x86") else ""
    return llvm.Target.from_triple(platform.triple).create_target_machine(
        cpu=cpu, opt=3, reloc="pic", codemodel="default"
    )


def object_of(whole: bytes, platform: Platform) -> bytes:
    """Return the machine code of the kernels as an object file."""
    module, target = llvm.parse_bitcode(whole), _machine(platform)
    module.triple, module.data_layout = target.triple, str(target.target_data)
    return target.emit_object(module)


def linked(code: bytes, name: str) -> bytes:
    """Compile the C files for a platform and link them with the kernels into a library."""
    platform = PLATFORMS[name]
    with tempfile.TemporaryDirectory() as folder:
        object_file, out = Path(folder, "kernels.o"), Path(folder, platform.file)
        object_file.write_bytes(code)
        generated = Path(folder, "digest.c")
        generated.write_text(
            f"extern const char kernels_digest[];\n"
            f'const char kernels_digest[] = "{library.kernels_digest()}";\n'
        )
        sources = sorted(map(str, library.SOURCES.glob("*.c")))
        command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.zig, *FLAGS]
        command += [*sources, str(generated), str(object_file), "-o", str(out)]
        if "linux" in platform.zig:
            command.append("-lm")
        subprocess.run(command, check=True)
        return out.read_bytes()


if __name__ == "__main__":
    main(sys.argv[1:])
