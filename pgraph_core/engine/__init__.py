"""Compiled code only, which operates on arrays without models. `layout` names their columns."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

from .compiler import jit, tools

jit.tools = tools
MODULES = (
    "packing",
    "tree.dynamics",
    "tree.bodies",
    "tree.sensors",
    "motion",
    "stepping.run",
    "stepping.stiffness",
)


def every_kernel() -> list[Any]:
    """Return all kernels of the package."""
    for module in walk_packages([str(Path(__file__).parent)], f"{__name__}."):
        if not module.name.endswith("__main__") and ".compiler" not in module.name:
            import_module(module.name)
    import_module(f"{__name__.rpartition('.')[0]}.show.raster")
    return [*jit.KERNELS.values(), *jit.LATER.values()]


def warm_up(every: bool = False) -> Iterator[tuple[int, int, str]]:
    """Load or compile the kernels that most runs need, yielding (i, n, name) after each one."""
    for module in MODULES:
        import_module(f"{__name__}.{module}")
    kernels = every_kernel() if every else list(jit.KERNELS.values())
    for i, kernel in enumerate(kernels, start=1):
        for variant in range(len(kernel.signatures)):
            kernel.code(variant)
        yield i, len(kernels), kernel.__name__
