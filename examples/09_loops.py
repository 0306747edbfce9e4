"""Closed loops: mobility, redundant rows, a singular position, a loop that cannot close."""

import math

import numpy as np

import pgraph_core as pg

mech = pg.Mechanism(pg.load("slider_crank"))
print(mech.mobility(), "\n")

# Flat, a parallelogram can go on as a parallelogram or fold: the velocity decides.
bars = pg.Mechanism(pg.load("four_bar"))
flat, along = math.pi / 2 * np.array((-1, 1, -1)), np.array((-1.0, 1.0, -1.0))
print(bars.mobility(flat, along), "\n")

# A state that does not meet its constraints is assembled; the report says what moved.
q, v, report = bars.assemble(np.array((0.0, 0.0, 0.3)), along)
print(report, "\n")

# Too far apart to be tied.
torn = pg.Mechanism(bars.model.edit("right crank", link=(4, 0, 0)))
try:
    torn.assemble()
except pg.PgraphError as refused:
    print(refused)
