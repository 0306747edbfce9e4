"""Edit and rerun, cell by cell: open this file as a notebook (VS Code, Spyder, jupytext).

Or run it with `python examples/18_edit_and_rerun.py`.
"""

# %% A model; as the last line of a notebook's cell, `model` shows its table and its digraph.
import pgraph_core as pg

model = pg.load("four_bar")
print(model)

# %% A run keeps its model; an edit makes a new model and leaves the old one as it was.
first = pg.simulate(model, t_end=1.0)
heavier = model.edit("coupler", mass=2.0 * model.body("coupler").mass)
second = pg.simulate(heavier, t_end=1.0)

# %% Compare both.
for run in (first, second):
    print(run.mechanism.model.body("coupler").mass, "kg:", run.message, run.q[-1].round(4))
print("the first model is unchanged:", first.mechanism.model == model)
