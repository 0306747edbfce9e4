"""Draw mutants from the sources, and write sources that contain all of them.

A site is identified by its file, line, column and kind of fault. The draw depends only on the
sources and the seed, so changes of the tests do not change the mutants.
"""

from __future__ import annotations

import ast
import builtins
import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ENGINE = "pgraph_core/engine/"
AREAS = {  # number of mutants out of 200, and files
    "tree": (35, "engine/tree/*.py", "engine/motion.py", "engine/inverse.py"),
    "constraints": (25, "engine/constraints/*.py", "packing/constraints.py"),
    "contact": (35, "engine/contact/*.py"),
    "integration": (30, "engine/stepping/*.py", *(f"simulation/{name}.py" for name in (
        "estimate", "contact_events", "event_record", "loop", "switches", "walk"))),
    "formats": (25, "formats/*.py", "model/files.py"),
    "model": (25, "model/*.py"),
    "page": (25, "../app/*/update.py", "../app/core/edit.py"),
}  # fmt: skip
ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
BOUNDARIES = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
OPPOSITES = {ast.Eq: ast.NotEq, ast.Is: ast.IsNot, ast.In: ast.NotIn}
OPPOSITES |= {b: a for a, b in OPPOSITES.items()}
PAIRS = "add sub, min max, mul mul_t, more most, larger smaller, both either, any all, sin cos"
FUNCTIONS = {a: b for pair in PAIRS.split(", ") for a, b in (pair.split(), pair.split()[::-1])}
ORDERED = {"cross", "sub", "atan2"}  # kernel helpers with two arguments of one type
TYPED = {"isinstance", "getattr", "setattr", "cast", "array_equal", "allclose"}  # arguments stay
LEFT_OUT = {"couple"}  # kernel on the type `Three`, which has no division
CHOSEN = "_mutant"


@dataclass(frozen=True)
class Site:
    """One mutant: source text at a place and its replacement, None for a dropped statement."""

    area: str
    file: str
    line: int
    column: int  # in bytes, as in `ast`
    end: tuple[int, int]
    kind: str
    old: str
    new: str | None
    function: str

    @property
    def key(self) -> str:
        """Identifier of the mutant while its file does not change."""
        return f"{self.file}:{self.line}:{self.column}:{self.kind}"

    @property
    def description(self) -> str:
        """The change on one line, for reports."""
        new = "(dropped)" if self.new is None else self.new
        return " ".join(f"{self.old} -> {new}".split())

    def in_any(self, others: list[Site]) -> bool:
        """Return whether the site shares source text with others."""
        here = [s for s in others if s.file == self.file and (self.line, self.column) < s.end]
        return any((s.line, s.column) < self.end for s in here)


def draw(tree: Path, seed: int, count: int) -> list[Site]:
    """Draw sites: a quota per area, kinds of faults in turn, sites of one kind at random."""
    chosen: list[Site] = []
    for area, (quota, *patterns) in AREAS.items():
        kinds: dict[str, list[Site]] = defaultdict(list)
        files = {f for pattern in patterns for f in (tree / "pgraph_core").glob(pattern)}
        taken = {s.file for s in chosen}
        for name in sorted(f.resolve().relative_to(tree.resolve()).as_posix() for f in files):
            if name not in taken:
                for site in sites_of(area, name, (tree / name).read_text(encoding="utf-8")):
                    kinds[site.kind].append(site)
        for kind in sorted(kinds):
            random.Random(f"{seed} {area} {kind}").shuffle(kinds[kind])
        left = [[s for s in kinds[kind] if s.function not in LEFT_OUT] for kind in sorted(kinds)]
        wanted = round(quota * count / 200)
        while wanted > 0 and (left := [sites for sites in left if sites]):
            for sites in left:
                site = sites.pop()
                if wanted > 0 and not site.in_any(chosen):
                    chosen.append(site)
                    wanted -= 1
    return sorted(chosen, key=lambda s: (list(AREAS).index(s.area), s.file, s.line, s.column))


def found_again(tree: Path, known: list[dict]) -> list[tuple[dict, Site]]:
    """Pair earlier results with their mutants in a changed tree, by text and nearest line.

    A mutant whose text is gone is named and dropped.
    """
    found: list[tuple[dict, Site]] = []
    for old in known:
        path, taken = tree / old["file"], [site for _, site in found]
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        same = (old["kind"], old["description"])
        all_sites = sites_of(old["area"], old["file"], text)
        alike = [s for s in all_sites if (s.kind, s.description) == same and not s.in_any(taken)]
        if not alike:
            print(f"mutant {old['k']} ({old['result']}) is gone: {old['file']} {same[1]}")
            continue
        line, column = old["line"], old["column"]
        best = min(alike, key=lambda s: (abs(s.line - line), abs(s.column - column)))
        found.append((old, best))
    return found


def sites_of(area: str, file: str, text: str) -> Iterator[Site]:
    """Yield all sites within the functions of a file."""
    compiled, module = file.startswith(ENGINE), ast.parse(text)
    known = {a.name for n in module.body if isinstance(n, ast.ImportFrom) for a in n.names}
    known |= {n.name for n in module.body if isinstance(n, ast.FunctionDef)} | set(dir(builtins))
    for function in _functions(module):
        indices = _indices(function) if compiled else set()
        for node in _inside(function, compiled, indices):
            for kind, new in (*_faults(node, compiled, known), *_drops(node)):
                where = node.lineno, node.col_offset, (node.end_lineno, node.end_col_offset)
                new = new if new is None else ast.unparse(new)
                yield Site(area, file, *where, kind, ast.unparse(node), new, function.name)


def _functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Yield functions and methods that are not inside another function."""
    for child in ast.iter_child_nodes(node):
        yield from (child,) if isinstance(child, ast.FunctionDef) else _functions(child)


def _indices(function: ast.FunctionDef) -> set[str]:
    """Return names used in indices and loop bounds: mutants there would corrupt memory."""
    places = [n.slice for n in ast.walk(function) if isinstance(n, ast.Subscript)]
    places += [n for n in ast.walk(function) if _is_range(n)]
    places += [n.test for n in ast.walk(function) if isinstance(n, ast.While)]
    return {n.id for place in places for n in ast.walk(place) if isinstance(n, ast.Name)}


def _is_range(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and getattr(node.func, "id", "") == "range"


def _inside(function: ast.FunctionDef, compiled: bool, indices: set[str]) -> Iterator[ast.AST]:
    """Yield executed nodes, except error messages and, in kernels, indices and loop bounds."""
    left: list[ast.AST] = [*reversed(function.body)]
    while left:
        node = left.pop()
        if isinstance(node, (ast.FunctionDef, ast.Lambda, ast.While if compiled else ast.Lambda)):
            left += reversed(node.body) if isinstance(node.body, list) else [node.body]
            continue
        if isinstance(node, (ast.JoinedStr, ast.Raise, ast.Assert, ast.ClassDef, ast.pattern)):
            continue
        if isinstance(node, ast.AnnAssign) or (compiled and isinstance(node, ast.Subscript)):
            left += [node.value] if node.value else []
            continue
        if compiled:
            set_here = getattr(node, "targets", [getattr(node, "target", None)])
            names = {n.id for t in set_here if t for n in ast.walk(t) if isinstance(n, ast.Name)}
            sets = isinstance(node, (ast.Assign, ast.AugAssign)) and names & indices
            if sets or _is_range(node):
                continue
        yield node
        left += reversed([*ast.iter_child_nodes(node)])


def _faults(node: ast.AST, compiled: bool, known: set[str]) -> Iterator[tuple[str, ast.expr]]:
    """Yield (kind, replacement) of an expression. In kernels the replacement keeps the type."""
    match node:
        case ast.BinOp(op=op) if type(op) in ARITHMETIC:
            values = [getattr(n, "value", None) for n in (node.left, node.right)]
            values += [str(n) for n in (node.left, node.right) if isinstance(n, ast.JoinedStr)]
            if not any(isinstance(x, (int, str) if compiled else str) for x in values):
                yield "arithmetic", _with(node, op=ARITHMETIC[type(op)]())
        case ast.UnaryOp(op=ast.USub()) if not isinstance(node.operand, ast.Constant):
            yield "sign", node.operand
        case ast.UnaryOp(op=ast.Not()):
            yield "condition", node.operand
        case ast.Compare(ops=[op]) if type(op) in BOUNDARIES:
            yield "boundary", _with(node, ops=[BOUNDARIES[type(op)]()])
        case ast.Compare(ops=[op]) if type(op) in OPPOSITES:
            if not (compiled and isinstance(op, (ast.Is, ast.IsNot))):  # known to the compiler
                yield "condition", _with(node, ops=[OPPOSITES[type(op)]()])
        case ast.BoolOp(op=op):
            yield "logic", _with(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.Constant(value=float() as x) if x == x:
            yield "constant", ast.Constant(2.0 * x if x else 1.0)
        case ast.Constant(value=int() as n) if not isinstance(n, bool) and not compiled:
            yield "constant", ast.Constant(n + 1)
        case ast.Call(func=ast.Name(id=name)) if FUNCTIONS.get(name) in known:
            yield "function", _with(node, func=ast.Name(FUNCTIONS[name]))
        case ast.Call(func=func, args=[a, b, *rest]):
            name = getattr(func, "id", getattr(func, "attr", ""))
            alike = type(a) is type(b) and not isinstance(a, ast.Starred)
            if name in ORDERED if compiled else alike and name not in TYPED:
                yield "arguments", _with(node, args=[b, a, *rest])


def _drops(node: ast.AST) -> Iterator[tuple[str, None]]:
    """Yield a fault for a statement that can be left out without leaving a name undefined."""
    call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    store = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript)
    if call or store or isinstance(node, ast.AugAssign):
        yield "statement", None


def _with(node: ast.expr, **fields: object) -> ast.expr:
    return type(node)(**{**vars(node), **fields})


def rewritten(text: str, sites: list[tuple[int, Site]]) -> str:
    """Return the source with switches for the numbered sites, with the same line numbers."""
    lines = text.encode().splitlines(keepends=True)
    for k, site in sorted(sites, key=lambda item: (item[1].line, item[1].column), reverse=True):
        (row, column), (last, end) = (site.line - 1, site.column), (site.end[0] - 1, site.end[1])
        if site.new is None:
            old = lines[row]
            lines[row] = old[:column] + f"if not {CHOSEN}({k}): ".encode() + old[column:]
        else:
            lines[last] = lines[last][:end] + b"))" + lines[last][end:]
            start = f"(({site.new}) if {CHOSEN}({k}) else (".encode()
            lines[row] = lines[row][:column] + start + lines[row][column:]
    imports = (n for n in ast.parse(text).body if isinstance(n, (ast.Import, ast.ImportFrom)))
    first = next(n for n in imports if getattr(n, "module", "") != "__future__")
    row, end = first.end_lineno - 1, first.end_col_offset
    start = f"; from mutant_switch import mutant as {CHOSEN}".encode()
    lines[row] = lines[row][:end] + start + lines[row][end:]
    return b"".join(lines).decode()
