"""Build one optimised module from numba's code."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import llvmlite.binding as llvm

from .jit import Kernel
from .lowering.dispatch import lowered


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
