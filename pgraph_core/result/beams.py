"""Columns of a run for its beams: loads in their springs, and the places of their tips."""

from __future__ import annotations

from typing import Any

from ..model.segments import segment, strains_of

AXES = "xyz"
STRETCH, FORCE, MOMENT = "stretch", "axial_force", "moment"


def columns_of_beams(run: Any) -> dict[str, tuple[str, Any]]:
    """Return (unit, values (n,)) of the tips of beams and of the springs between segments, by name.

    `moment.rod[3]` is EI times the curvature and its damping at the third joint, in the axes of its
    section: bend_y, bend_z and twist, or one number if it only bends one way.
    """
    mech, found = run.mechanism, dict[str, tuple[str, Any]]()
    beams = {beam.name: beam for beam in mech.model.described.beams}
    for name, counts in mech.model.segments.items():
        place, beam = run.position[name], beams[name]
        found |= {f"{name}.tip.{axis}": ("m", x) for axis, x in zip(AXES, place.T)}
        turns = [x for x in beam.deforms if x != STRETCH]
        for k in range(1, sum(counts) + 1):
            body = mech.model.body(segment(name, k))
            joint = mech.joints[body.name]
            loads = run.q[:, joint.q] * body.stiffness + run.v[:, joint.v] * body.damping
            for strain, load in zip(strains_of(beam, k), loads.T):
                if strain == STRETCH:
                    found[f"{FORCE}.{body.name}"] = "N", load
                else:
                    own = f".{strain}" if len(turns) > 1 else ""
                    found[f"{MOMENT}.{body.name}{own}"] = "N m", load
    return found
