"""Command line for `python -m pgraph_core.live`, which compiles the kernels to WebAssembly into
this package.

This script is only required for releases. It takes several minutes and requires a linker, which is
installed by `pip install -e .[release]`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from ..engine.compiler.optimising import object_of
from .module import ABOUT, NAMES, WASM, dispatchers, source_hash

STACK = 1 << 20  # [bytes]


def main() -> None:
    """Compile, link and write the module together with its build record."""
    linker = version("ziglang")  # before minutes of compiling
    WASM.write_bytes(linked(*object_of(dispatchers())))
    about = {
        "sources": source_hash(),
        "kernels": NAMES,
        "made_by": {"numba": version("numba"), "llvmlite": version("llvmlite"), "ziglang": linker},
    }
    ABOUT.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    print(f"{WASM}: {WASM.stat().st_size} bytes, of sources {about['sources']}")


def linked(code: bytes, exports: list[str]) -> bytes:
    """Link the module into a self-contained binary."""
    with tempfile.TemporaryDirectory() as folder:
        object_file, wasm = Path(folder, "kernels.o"), Path(folder, "kernels.wasm")
        object_file.write_bytes(code)
        command = [sys.executable, "-m", "ziglang", "wasm-ld", "--no-entry", "--stack-first"]
        command += ["-z", f"stack-size={STACK}", "--export-table", "--gc-sections", "--strip-all"]
        command += [f"--export={name}" for name in (*exports, "__heap_base")]
        subprocess.run([*command, "-o", str(wasm), str(object_file)], check=True)
        return wasm.read_bytes()


if __name__ == "__main__":
    main()
