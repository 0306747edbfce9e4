"""A double pendulum of the rods that a new table has, in Pgraph."""

import pgraph_core as pg


def build():
    return pg.Mechanism(pg.Model.serial(2))
