"""Numbers of tolerances.py have a reason and an interval. No verdict depends on their values."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pgraph_core import tolerances

from .verdicts import SOURCE, differences

CORE = SOURCE.parent
TABLES = {"layout.py", "records.py", "arrays.py", "block.py"}  # indices of columns
NUMBERS = [
    name for name, value in vars(tolerances).items() if isinstance(value, float) and name != "EPS"
]
MOST_NUMBERS, MOST_CONSTANTS = 40, 90


def test_numbers_have_a_reason_and_an_interval():
    text = SOURCE.read_text(encoding="utf-8")
    assert len(NUMBERS) <= MOST_NUMBERS
    for name in NUMBERS:
        found = re.search(rf"((?:^#.*\n)+){name} = ", text, re.MULTILINE)
        assert found, name
        low, high = re.search(r"From (\S+)\s(?:# )?to (\S+)\.$", found[1].strip()).groups()
        assert float(low) <= getattr(tolerances, name) / 2, name
        assert getattr(tolerances, name) * 2 <= float(high), name


def is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    return isinstance(node, ast.BinOp) and is_number(node.left) and is_number(node.right)


def constants(path: Path) -> list[str]:
    """Names of floating-point constants of a module: capitals bound to plain numbers."""
    found: list[str] = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        name = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        value = getattr(node, "value", None)
        if isinstance(name, ast.Name) and name.id.isupper() and value and is_number(value):
            text = ast.unparse(value)
            if any(sign in text for sign in ".e/") or "**" in text:
                found.append(name.id)
    return found


def test_no_more_constants_than_there_are():
    """A bound that only falls: a threshold belongs into tolerances.py, or is derived from it."""
    files = [path for path in sorted(CORE.rglob("*.py")) if path.name not in TABLES]
    count = sum(len(constants(path)) for path in files)
    assert count <= MOST_CONSTANTS


def verdicts(*factors: str, sources: Path = CORE.parent, **environment: str) -> dict[str, Any]:
    """The verdicts of a process of its own, with numbers multiplied by factors."""
    command = [sys.executable, "-m", "tests.verdicts", *factors]
    given = os.environ | environment
    done = subprocess.run(
        command, cwd=sources, env=given, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def usual():
    return verdicts()


@pytest.mark.nightly
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", NUMBERS)
def test_no_verdict_hangs_on_a_number(name, factor, usual):
    """The numbers change in Python. Kernels keep those of their compilation."""
    assert differences(usual, verdicts(f"{name}={factor}")) == []


def altered(folder: Path, factor: float) -> Path:
    """A copy of the sources with all numbers multiplied: no archive has kernels of these."""
    for name in ("pgraph_core", "static_models", "tests", "typings"):
        skipped = shutil.ignore_patterns("__pycache__", "app", "golden")
        shutil.copytree(CORE.parent / name, folder / name, symlinks=True, ignore=skipped)
    lines = "".join(f"{name} *= {factor}\n" for name in NUMBERS)
    with (folder / "pgraph_core" / SOURCE.name).open("a", encoding="utf-8") as file:
        file.write(lines)
    return folder


@pytest.mark.nightly
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_no_verdict_hangs_on_the_numbers_in_kernels(factor, usual, tmp_path):
    """All at once, since it compiles all kernels: in a cache of its own."""
    folder, cache = altered(tmp_path / "sources", factor), tmp_path / "cache"
    where = {"PYTHONPATH": str(folder / "typings"), "PGRAPH_CACHE": str(cache)}
    assert differences(usual, verdicts(sources=folder, **where)) == []
    assert list(cache.rglob("*"))  # kernels were compiled
