"""The tree of the paper's Fig. 1, of rods, in Pgraph."""

import pgraph_core as pg


def build():
    chain = pg.Model.serial(7)
    tree = chain.edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    return pg.Mechanism(tree)
