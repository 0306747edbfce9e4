"""A double pendulum as a pandas table.

Run it with `python examples/20_to_pandas.py`; it needs `pip install 'pgraph-dynamics[pandas]'`.
"""

import pgraph_core as pg

model = pg.load("double_pendulum")
run = pg.simulate(model, t_end=10.0, rtol=1e-10)
table = run.to_pandas()
print(table.filter(like="energy").describe())
print("rows, columns:", table.shape)
late = table.loc[table["t"] > 8.0, ["lower", "v.lower"]]
print(late.abs().max())
print("the index is the time:", table.index.name == "t" and table.index[-1] == run.t[-1])
