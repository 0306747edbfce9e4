"""Names of the engine's constants and of the rows and columns of its memory."""

import ast
import importlib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pgraph_core
from pgraph_core.engine import arrays, layout
from pgraph_core.engine.records import STEP_CONTROL, columns
from pgraph_core.engine.tree.spinning import SPIN

CORE = Path(pgraph_core.__file__).parent


def assigned(body: list[ast.stmt]) -> Iterator[str]:
    """The capitals that the statements of a module bind."""
    for one in body:
        targets = one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", one)]
        if isinstance(one, (ast.Assign, ast.AnnAssign)):
            names = (x.id for t in targets for x in ast.walk(t) if isinstance(x, ast.Name))
            yield from (name for name in names if name.isupper())


def test_no_constant_of_the_engine_has_two_values():
    """A name says its number in every file: an index into a table, a limit or a tolerance."""
    known: dict[str, dict[float, Path]] = defaultdict(dict)
    for path in sorted((CORE / "engine").rglob("*.py")):
        name = ".".join(path.relative_to(CORE.parent).with_suffix("").parts)
        if path.stem == "__main__":
            continue
        module = importlib.import_module(name.removesuffix(".__init__"))
        for constant in assigned(ast.parse(path.read_text(encoding="utf-8")).body):
            value = getattr(module, constant)
            if isinstance(value, (int, float)):
                known[constant][value] = path
    assert len(known) > 500
    assert {name: values for name, values in known.items() if len(values) > 1} == {}


def test_columns_follow_each_other():
    table = columns("a", "b", c=3, d=1)
    assert table == (0, 1, 2, 5, 6)
    assert (table.a, table.b, table.c, table.d, table.total) == table


def test_no_row_of_the_workspaces_has_two_names():
    """A row that two names share holds two quantities, of which one may overwrite the other."""
    names = [*assigned(ast.parse(Path(arrays.__file__).read_text(encoding="utf-8")).body)]
    rows = names[names.index("RHS") : names.index("VECTORS")]
    report = ["SWEEPS_DONE", "STEPS_DONE", "MISSED", "STRAYS", "GAINED", "HARD", "BARRED", "CALMED"]
    report.append("LOOSE")
    tables = [name for name in rows if not isinstance(getattr(arrays, name), int)]
    single = [name for name in rows if name not in report and name not in tables]
    assert [getattr(arrays, name) for name in single] == [*range(arrays.GYRE + 1)]
    assert arrays.GYRE + SPIN.total == arrays.VECTORS
    assert [getattr(arrays, name) for name in report] == [*range(len(report))]
    names = [*assigned(ast.parse(Path(layout.__file__).read_text(encoding="utf-8")).body)]
    states = names[names.index("Y") :]
    assert [getattr(layout, name) for name in states] == [*range(layout.STAGE + 1)]


PLACES = ("engine", "simulation", "batches", "live", "dynamics")


def record_written(target: Any) -> tuple[str, str]:
    """The record and the field to which an assignment writes: to `control.clock.time` in kernels,
    to `control["clock"]["time"]` or `steps.clock["time"]` in Python."""

    def last(node: Any) -> str:
        if isinstance(node, ast.Subscript):
            return str(getattr(node.slice, "value", ""))
        return str(getattr(node, "attr", getattr(node, "id", "")))

    while isinstance(target, ast.Subscript) and not isinstance(
        getattr(target.slice, "value", None), str
    ):
        target = target.value  # instances of a batch
    inside = getattr(target, "value", None)
    return last(inside), last(target)


def test_each_record_of_steps_has_one_writer():
    kinds: dict[str, Any] = {
        name: kind[0] for name, kind in (STEP_CONTROL.fields or {}).items() if kind[0].names
    }
    assert len(kinds) <= 5
    found: dict[str, set[str]] = {name: set() for name in kinds}
    for path in (path for name in PLACES for path in sorted((CORE / name).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(getattr(node, "ctx", None), ast.Store):
                name, field = record_written(node)
                if name in kinds and field in kinds[name].names:
                    found[name].add(path.relative_to(CORE).with_suffix("").as_posix())
    folder = "engine/stepping/control"
    assert found == {name: {f"{folder}/{name}"} for name in kinds}
