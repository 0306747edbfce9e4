"""Compiled code only: it knows arrays, no models. `layout` names their columns."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

MODULES = (
    "packing",
    "tree.dynamics",
    "tree.bodies",
    "tree.sensors",
    "motion",
    "stepping.run",
    "stepping.stiffness",
)
# What a first run needs late and takes long: a second process compiles these first.
LATE = ("advance_run", "record", "motion_and_forces", "constrained_dynamics")
SECOND = ("-m", "pgraph_core.engine", "--with-parent", "--second")


def warm_up(second: bool = False) -> Iterator[tuple[int, int, str]]:
    """Compile every kernel, or load it from the disk cache; yields (i, n, name) after each.

    The `second` of two processes begins with `LATE` and goes on from the other end.
    """
    from .compiler.jit import KERNELS, compile_kernel

    for module in MODULES:
        import_module(f"{__name__}.{module}")
    names = list(KERNELS)
    if second:
        names = [*LATE, *(name for name in reversed(names) if name not in LATE)]
    for i, name in enumerate(names, start=1):
        compile_kernel(name)
        yield i, len(names), name


@contextmanager
def second_process() -> Iterator[None]:
    """Within it a second process compiles kernels into the disk cache, unless they are there.

    It ends with the context, and with this process, whatever ends that.
    """
    if not _cold() or (os.cpu_count() or 1) < 2:
        yield
        return
    try:
        process = subprocess.Popen(
            [sys.executable, *SECOND],
            stdin=subprocess.PIPE,  # closed by our death, of whatever kind
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:  # one process does it too
        yield
        return
    with process:
        try:
            yield
        finally:
            process.kill()


def _cold() -> bool:
    """Whether the cache on the disk lacks the kernel that every run calls, and can be written."""
    from .compiler.jit import JIT, cache_folder, in_cache
    from .stepping.run import advance_run

    return JIT and not in_cache(advance_run) and os.access(cache_folder(), os.W_OK)
