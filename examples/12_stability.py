"""The stability map: which methods hold on a pendulum whose spring is made stiffer and stiffer.

Run it with `python examples/12_stability.py`; docs/accuracy.md has more maps and what they show.
"""

import pgraph_core as pg

model = pg.load("stiff_pendulum")
found = pg.stability_map(
    model,
    axis="stiffness",
    values=(1e2, 1e4, 1e6, 1e8),
    methods=("rk4", "dop853", "radau5"),
    steps=(1e-1, 1e-2, 1e-3),
    t_end=1.0,
)
print(found)  # a letter a cell: one verdict on each value, method and step

# Each cell says why, and what would do.
cell = next(c for c in found.cells if (c.value, c.method, c.step) == (1e6, "rk4", 1e-2))
print()
print(cell.status, "in body", cell.body)
print(f"the predicted limit is a step of {cell.step_limit:.2e} s")
print(
    "radau5 is OK everywhere:", all(c.status == "OK" for c in found.cells if c.method == "radau5")
)

# found.save("map.html") writes the heat map as a page.
