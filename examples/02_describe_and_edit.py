"""A model of your own: bodies, a constraint, edits that are checked, a file.

Run it with `python examples/02_describe_and_edit.py`.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pgraph_core as pg

rod: dict[str, Any] = {"axes": (0, 1, 0), "com": (0.25, 0, 0), "tip": (0.5, 0, 0), "mass": 0.8}
model = pg.Model(
    name="two rods",
    bodies=(
        pg.Body(name="crank", inertia=((1e-4, 0, 0), (0, 0.017, 0), (0, 0, 0.017)), **rod),
        pg.Body(name="rod", parent="crank", link=(0.5, 0, 0), **rod),
    ),
)

# Every edit is a new, validated model; the old one stays as it was, so undo is for free.
heavier = model.edit("rod", mass=1.6)
print("masses", model.body("rod").mass, "->", heavier.body("rod").mass)

# A refused edit is a sentence that says what would do.
for change in ({"mass": -1}, {"parent": "crnk"}, {"masss": 2}):
    try:
        model.edit("rod", **change)
    except pg.PgraphError as refused:
        print("refused:", refused)

# The end of the rod held where it is makes the chain a loop; other_point is left to the state.
loop = model.replace(constraints=(pg.Constraint(name="pin", body="rod", point=(0.5, 0, 0)),))
loop = loop.edit("rod", name="coupler")  # references follow
print("pin now holds", loop.constraints[0].body)

with TemporaryDirectory() as folder:
    file = Path(folder) / "two_rods.json"
    loop.save(file)
    print("read back equal:", pg.Model.load(file) == loop)
