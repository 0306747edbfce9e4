"""Comparisons of names in sources: code asks a method or kind for facts instead of its name."""

import ast
import re
from collections.abc import Collection, Container, Iterator
from pathlib import Path

import pgraph_app
import pgraph_core
import pgraph_peers

PACKAGES = pgraph_core, pgraph_app, pgraph_peers


def sources(names: Collection[str]) -> Iterator[tuple[str, ast.Module]]:
    """Yield (path from the name of its package, parsed source) of each module of the packages that
    has one of these strings.
    """
    quoted = re.compile("|".join(f'"{re.escape(x)}"' for x in names))
    for package in PACKAGES:
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            name = f"{package.__name__}/{path.relative_to(folder).as_posix()}"
            text = path.read_text(encoding="utf-8")
            if quoted.search(text):
                yield name, ast.parse(text)


def strings(tree: ast.AST) -> list[str]:
    """Return the strings in a part of a source."""
    found = (x.value for x in ast.walk(tree) if isinstance(x, ast.Constant))
    return [x for x in found if isinstance(x, str)]


def compared(tree: ast.Module, names: Container[str]) -> Iterator[tuple[int, str]]:
    """Yield (line, name) of each name that a comparison or `match` asks for, also by a tuple of
    such names that the module defines.
    """
    tuples = {
        target.id: found
        for node in ast.walk(tree) if isinstance(node, ast.Assign)
        for target in node.targets if isinstance(target, ast.Name)
        if isinstance(node.value, (ast.Tuple, ast.List, ast.Set))
        if (found := strings(node.value)) and all(x in names for x in found)
    }  # fmt: skip
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            given = [x for side in sides for x in literal(side, tuples)]
        elif isinstance(node, ast.Match):
            given = [x for case in node.cases for x in strings(case.pattern)]
        else:
            continue
        yield from ((node.lineno, x) for x in given if x in names)


def literal(side: ast.AST, tuples: dict[str, list[str]]) -> list[str]:
    """Return the strings that a side of a comparison is, or holds."""
    if isinstance(side, ast.Name):
        return tuples.get(side.id, [])
    held = side.elts if isinstance(side, (ast.Tuple, ast.List, ast.Set)) else [side]
    return [x.value for x in held if isinstance(x, ast.Constant) and isinstance(x.value, str)]
