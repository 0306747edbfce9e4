"""Kernels as Python functions with the arithmetic of machine code, for NUMBA_DISABLE_JIT=1.

Machine code follows IEEE 754: 1 / 0 is infinite and the root of -1 is nan, where Python raises. It
also squares by one product. Each kernel is therefore compiled again by Python from its source, with
these operations replaced. Conversions of nan to integers are undefined in machine code, and stay.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def quotient(x: Any, y: Any) -> Any:
    """x / y. Complex numbers are divided as in Python and numba [Smith 1962]."""
    if isinstance(x, complex) or isinstance(y, complex):
        return complex(x) / complex(y) if y != 0.0 else np.complex128(x) / np.complex128(y)
    return np.true_divide(x, y)


def square(x: Any) -> Any:
    """x x."""
    return x * x


OPERATIONS: dict[str, Any] = {"_quotient": quotient, "_square": square, "_root": np.sqrt}


class _Replaced(ast.NodeTransformer):
    """Calls of OPERATIONS in place of operators, and functions without decorators."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Replace x / y and x**2."""
        self.generic_visit(node)
        if isinstance(node.op, ast.Div):
            return _call("_quotient", node, node.left, node.right)
        power = node.right.value if isinstance(node.right, ast.Constant) else None
        if isinstance(node.op, ast.Pow) and power == 2:
            return _call("_square", node, node.left)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """Replace x /= y."""
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        value = _call("_quotient", node, read, node.value)
        return ast.copy_location(ast.Assign([node.target], value), node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Replace math.sqrt(x)."""
        self.generic_visit(node)
        return _call("_root", node, *node.args) if ast.unparse(node.func) == "math.sqrt" else node


def _call(name: str, node: ast.expr | ast.stmt, *args: ast.expr) -> ast.expr:
    return ast.copy_location(ast.Call(ast.Name(name, ast.Load()), [*args], []), node)


@functools.cache
def _definitions(file: str) -> dict[int, ast.FunctionDef]:
    """Return a dictionary that maps first lines, including decorators, to the functions of a
    file."""
    tree = _Replaced().visit(ast.parse(Path(file).read_text(encoding="utf-8")))
    found: dict[int, ast.FunctionDef] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            found[min(one.lineno for one in (node, *node.decorator_list))] = node
    return found


def as_python(function: Callable[..., Any], *, entry: bool = False) -> Callable[..., Any]:
    """Return a helper, or a kernel called by other kernels, as a Python function with IEEE
    arithmetic."""
    code = function.__code__
    node = _definitions(code.co_filename).get(code.co_firstlineno)
    if node is None:  # a lambda
        return function
    free = dict(zip(code.co_freevars, (cell.cell_contents for cell in function.__closure__ or ())))
    given = {**OPERATIONS, **free}
    node.decorator_list = []
    outer = ast.parse(f"def outer({', '.join(given)}):\n    return {node.name}")
    outer.body[0].body.insert(0, node)  # type: ignore[attr-defined]
    found: dict[str, Any] = {}
    lines = compile(ast.fix_missing_locations(outer), code.co_filename, "exec")
    exec(lines, function.__globals__, found)
    made: Any = functools.update_wrapper(found["outer"](**given), function)
    made.__defaults__ = function.__defaults__
    return np.errstate(all="ignore")(made) if entry else made  # machine code has no warnings
