"""Write the numbers of OpenSim for the .osim files of this folder, which are our own.

Run it in an environment with the package opensim, which the project does not need; it wrote the
present ones with version 4.6-2026-06-22-85aaf64:

    python tests/golden/osim/write_numbers.py
"""

from pathlib import Path

import numpy as np
import opensim as osim


def entries(x, *counts):
    """Return the entries of a vector or matrix of Simbody."""
    rows = [x.get(*k) for k in np.ndindex(*counts)]
    return np.array(rows).reshape(counts)


def follow(model, state, coordinates):
    """Set the coordinates that follow others; return (own, leader, slope) of each."""
    found, constraints = [], model.getConstraintSet()
    for i in range(constraints.getSize()):
        c = osim.CoordinateCouplerConstraint.safeDownCast(constraints.get(i))
        own, leader = c.getDependentCoordinateName(), c.getIndependentCoordinateNames().get(0)
        scale = float(c.getPropertyByName("scale_factor").toString())
        x, first = osim.Vector(1, coordinates.get(leader).getValue(state)), osim.StdVectorInt()
        first.push_back(0)
        coordinates.get(own).setValue(state, scale * c.getFunction().calcValue(x), False)
        found.append((own, leader, scale * c.getFunction().calcDerivative(first, x)))
    return found


def numbers(path, count=4):
    """Return coordinates (n, nq), frames of bodies (n, nb, 3, 4), markers (n, nm, 3), M (n, nu, nu)
    in the order of coordinates, the slope of each coordinate over each other one (n, nu, nu), and
    lengths (n, muscles) and moment arms (n, muscles, nq) of muscles.
    """
    model = osim.Model(str(path))
    state = model.initSystem()
    coordinates, bodies, markers = (
        model.getCoordinateSet(),
        model.getBodySet(),
        model.getMarkerSet(),
    )
    muscles = model.getMuscles()
    paths = [muscles.get(i).getGeometryPath() for i in range(muscles.getSize())]
    own = [coordinates.get(i) for i in range(coordinates.getSize())]
    names = [c.getName() for c in own]
    rng, found = (
        np.random.default_rng(1),
        {"q": [], "frames": [], "marks": [], "M": [], "slope": [], "lengths": [], "arms": []},
    )
    places = []
    for c in own:
        state.updU().setToZero()
        c.setSpeedValue(state, 1.0)
        places.append(entries(state.getU(), state.getNU()).argmax())
    for _ in range(count):
        for c in own:
            c.setValue(state, rng.uniform(c.getRangeMin(), c.getRangeMax()), False)
        slope = np.eye(len(own))
        for name, leader, one in follow(model, state, coordinates):
            slope[names.index(name)] = one * slope[names.index(leader)]
        found["slope"].append(slope)
        found["q"].append([c.getValue(state) for c in own])
        model.realizePosition(state)
        poses = [bodies.get(i).getTransformInGround(state) for i in range(bodies.getSize())]
        found["frames"].append([np.c_[entries(x.R(), 3, 3), entries(x.p(), 3)] for x in poses])
        at = [markers.get(i).getLocationInGround(state) for i in range(markers.getSize())]
        found["marks"].append([entries(x, 3) for x in at])
        found["lengths"].append([x.getLength(state) for x in paths])
        found["arms"].append([[x.computeMomentArm(state, c) for c in own] for x in paths])
        M = osim.Matrix()
        model.getMatterSubsystem().calcM(state, M)
        found["M"].append(entries(M, M.nrow(), M.nrow())[np.ix_(places, places)])
    return found | {
        "coordinates": names,
        "bodies": [bodies.get(i).getName() for i in range(bodies.getSize())],
        "markers": [markers.get(i).getName() for i in range(markers.getSize())],
        "muscles": [muscles.get(i).getName() for i in range(muscles.getSize())],
    }


if __name__ == "__main__":
    for path in Path(__file__).parent.glob("*.osim"):
        count = 30 if path.stem.startswith("points") else 4
        np.savez_compressed(path.with_suffix(".npz"), **numbers(path, count))
