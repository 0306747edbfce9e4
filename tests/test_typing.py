"""What a user writes passes a strict type checker, and what is wrong does not."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
RIGHT = """
import numpy as np
import pgraph_core as pg

body = pg.Body(
    name="a", axes=(0, 1, 0), inertia=np.eye(3), limits=[-1, 1], dof=1,
    shape={"kind": "sphere", "radius": 1},
)
rod = pg.Body(
    name="b", parent="a", joint="compound", motions=[("rotate", (0, 0, 1))], com=np.zeros(3),
    q=[0.1], damping=0.1, shapes=[{"kind": "box", "size": np.ones(3)}], derived=["com"],
)
model = pg.Model(
    bodies=[body, rod],
    forces=[
        pg.Spring(name="s", body="a", point=(0, 0, 1), stiffness=10),
        {"name": "m", "body": "a"},
    ],
    constraints=(pg.Gear(name="g", body="a", other="b", ratio=2),),
    contacts=[pg.Contact(name="c", body="a", points=[(0, 0, 0)])],
    scenarios=[
        pg.Scenario(
            name="s", q={"a": 0.1}, v={"b": [1]}, t_end=2,
            forces=[pg.Motor(name="m2", body="a", torque={"t": [0, 1], "value": [0, 1]})],
        )
    ],
    parameters={"k": 2}, gravity=(0, 0, -9.81), ground={"friction": 0.3},
)
m2 = model.add(pg.Wrench(name="w", body="a", force=(0, 0, 1)))
m2 = m2.edit("w", force=(0, 0, 2)).remove("w")
spring = model.part("s", "force")
if isinstance(spring, pg.Spring):
    k: float = spring.stiffness
    print(k, spring.rest)
print(pg.Table(t=[0, 1], value=np.zeros(2)), model.body("a").axes[0], m2)
"""
WRONG = """
import pgraph_core as pg

pg.Spring(name="s", body="a", stifness=1)
pg.Body(name="a", mass="heavy")
pg.Spring(name="s", body="a", kp=1)
"""


def errors(folder: Path, text: str) -> list[str]:
    """What strict pyright says about a program."""
    config = {"typeCheckingMode": "strict", "extraPaths": [str(ROOT)]}
    (folder / "pyrightconfig.json").write_text(json.dumps(config))
    (folder / "program.py").write_text(text)
    python = ["--pythonpath", sys.executable]
    done = subprocess.run(
        [sys.executable, "-m", "pyright", *python, "-p", str(folder), str(folder / "program.py")],
        capture_output=True,
        text=True,
    )
    return [line for line in done.stdout.splitlines() if " - error: " in line]


def test_a_program_with_lists_arrays_and_dictionaries_is_strictly_typed(tmp_path):
    assert errors(tmp_path, RIGHT) == []
    exec(compile(RIGHT, "program", "exec"), {})  # and runs


def test_a_field_that_a_part_does_not_have_is_found(tmp_path):
    found = errors(tmp_path, WRONG)
    assert len(found) == 3
    assert [name for name in ("stifness", "mass", "kp") if name in "".join(found)] == [
        "stifness", "mass", "kp",
    ]  # fmt: skip
