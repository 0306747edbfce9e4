"""The list of parts and proposed joints of a CAD assembly."""

from __future__ import annotations

from pgraph_core.formats.step_joints import KINDS

from ..core.views import Payload, Place, of_page
from . import Assembly


def listed(found: Assembly) -> Payload:
    """Return the parts and the joints of an assembly, for the list beside the 3D view."""
    return {
        "file": found.file,
        "kinds": KINDS,
        "parts": [
            {
                "name": part.name,
                "volume": f"{part.volume * 1e6:.4g} cm³",
                "density": f"{part.density:.6g}" if part.density else "",
            }
            for part in found.parts.parts
        ],
        "joints": [
            {
                "kind": joint.kind,
                "bodies": joint.bodies,
                "evidence": joint.evidence,
                "gap": f"{joint.gap * 1000:.3g} mm apart"
                if joint.gap > found.parts.tolerance
                else "",
                "selected": joint.selected,
            }
            for joint in found.joints
        ],
    }


VIEWS = (Place(of_page("assembly", lambda found: found and listed(found)), 101),)
