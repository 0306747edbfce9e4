"""A figure that computes in the reader's browser: one file, no network, the same numbers."""

from pathlib import Path

import pgraph_core as pg

model = pg.load("double_pendulum")
run = pg.simulate(model, t_end=5.0, step=1e-3, method="rk4")
page = Path("double_pendulum.html")
run.to_html(page, live=True, open=["bodies.lower.mass=0.2:5", "bodies.lower.link.2=-1.5:-0.5"])
print(f"{page}: {page.stat().st_size / 1e6:.1f} MB; open it in a browser and move the sliders")
page.unlink()
