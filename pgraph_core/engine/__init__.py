"""Compiled code only: it knows arrays, no models. `layout` names their columns."""

from collections.abc import Iterator
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


def warm_up() -> Iterator[tuple[int, int, str]]:
    """Compile every kernel, or load it from the disk cache; yields (i, n, name) after each."""
    from .compiler.jit import KERNELS, compile_kernel

    for module in MODULES:
        import_module(f"{__name__}.{module}")
    for i, name in enumerate(KERNELS, start=1):
        compile_kernel(name)
        yield i, len(KERNELS), name
