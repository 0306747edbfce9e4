"""From the table to the graph: the tree of the paper's fig. 1.

Run it with `python examples/01_table_to_pgraph.py`.
"""

import pgraph_core as pg

# Sec. 4.1: the first question is the number of bodies; the default table is a serial chain.
model = pg.Model.serial(7)
for body in model.bodies:
    print(f"{body.name:>4}  parent {body.parent:<7} DoF {body.dof}")

# Three changed cells of the parent column make it the tree of fig. 1.
model = model.edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")

# Pgraph and jdof follow. Bodies are numbered in the order of the table if parents precede children.
tree = pg.Topology.of(model)
print("names by number   ", *tree.names)
print("Pgraph            ", tree.pgraph)
print("jdof              ", tree.jdof)
print("tips              ", *(tree.names[i - 1] for i in tree.tips.tolist()))
print("separation bodies ", *(tree.names[i - 1] for i in tree.separation_bodies.tolist()))
print("adjacency matrix S, eq. (1):")
print(tree.adjacency().toarray().astype(int))

# On the numbers as the paper's figure gives them, and back from Pgraph alone.
parent = [0, 1, 2, 2, 3, 2, 6]
pgraph = pg.pgraph_of(parent)
print("Pgraph of fig. 1  ", pgraph)
print("parents from it   ", pg.parent_of(pgraph))
