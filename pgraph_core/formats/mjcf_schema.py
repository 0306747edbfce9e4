"""The MJCF attributes that the reader supports, as of MuJoCo 4.0.

Each of them is read, is compiled away by MuJoCo, or is reported as left out. An attribute that a
later version of MuJoCo adds is in no row of `mjcf_schema.txt`, so that a file which uses it is
reported as well. `mujoco.mj_printSchema` lists the attributes of the installed version.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper",
    "cylinder", "muscle", "adhesion", "dcmotor",
)  # fmt: skip


def _rows(file: Path) -> dict[str, frozenset[str]]:
    """Return the attributes by element, from a file with lines "element: attribute attribute"."""
    rows = (row.split(": ") for row in file.read_text(encoding="utf-8").splitlines())
    known = {tag: frozenset[str](names.split()) for tag, names in rows}
    actuator = known.pop("actuator")
    return known | dict.fromkeys(ACTUATORS, actuator)


# attributes by element, without elements that have no effect on motion
KNOWN = _rows(Path(__file__).with_suffix(".txt"))


def newer(tag: str, attributes: Iterable[str]) -> list[str]:
    """Return the attributes of an element that do not exist in MuJoCo 4.0."""
    known = KNOWN.get(tag)
    return [] if known is None or known.issuperset(attributes) else sorted(set(attributes) - known)
