"""Paths of the spatial tendons of MJCF, over sites and around geoms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..fields import GROUND
from ..forces import Via
from ..rotation import matrix
from .mjcf_compiled import Reading

ALONG_JOINT, PULLEY, SITE, SPHERE, CYLINDER = range(1, 6)  # mjtWrap


class TendonPaths:
    """The paths of the spatial tendons of a file."""

    m: Any
    reader: Reading

    def _path(self, t: int) -> dict[str, Any] | str:
        """Return the fields of the path of a tendon over sites and around geoms.

        It is {} if the path lies on one body, or a text about why there is none.
        """
        first = int(self.m.tendon_adr[t])
        parts = range(first, first + int(self.m.tendon_num[t]))
        if text := self._unlike_path(parts):
            return text
        places = list[Via]()
        for w in parts:
            one = self._site(w) if self.m.wrap_type[w] == SITE else self._obstacle(w)
            places += [one] if one not in places[-1:] else []
        if len({place.body for place in places}) == 1:
            return {}
        if places[0].body == GROUND:
            places.reverse()
        start, *via, end = places
        if start.body == GROUND:
            return "a tendon with both ends on the ground"
        return {
            "body": start.body, "other": end.body, "point": start.point,
            "other_point": end.point, "via": via,
        }  # fmt: skip

    def _unlike_path(self, parts: Sequence[int]) -> str:
        """Return a text about what a path cannot be of a tendon, or ""."""
        m = self.m
        if any(m.wrap_type[w] == PULLEY for w in parts):
            return "a tendon with pulleys"
        around = [w for w in parts if m.wrap_type[w] != SITE]
        sides = [int(m.wrap_prm[w]) for w in around]
        bodies = (m.geom_bodyid[m.wrap_objid[w]] for w in around)
        if any(s >= 0 and m.site_bodyid[s] != b for s, b in zip(sides, bodies)):
            return "a tendon around a geom whose sidesite is on another body"
        return ""

    def _site(self, w: int) -> Via:
        site = int(self.m.wrap_objid[w])
        return self._via(self.m.site_bodyid[site], self.m.site_pos[site])

    def _via(self, b: int, place: Any, **fields: Any) -> Via:
        point = tuple((place - self.reader.pivot[b]).tolist())
        return Via(body=self.reader.names[b], point=point, **fields)

    def _obstacle(self, w: int) -> Via:
        """Create an obstacle for the sphere or cylinder around which a tendon goes."""
        m, g, side = self.m, int(self.m.wrap_objid[w]), int(self.m.wrap_prm[w])
        b = int(m.geom_bodyid[g])
        given: dict[str, Any] = {"radius": float(m.geom_size[g, 0])}
        if m.wrap_type[w] == CYLINDER:
            given["axis"] = tuple(matrix(m.geom_quat[g])[:, 2].tolist())
        if self._inside(w):
            given["inner"] = True
        elif side >= 0:
            given["side"] = self._via(b, m.site_pos[side]).point
        return self._via(b, m.geom_pos[g], **given)

    def _inside(self, w: int) -> bool:
        """Check whether a sidesite lies within the radius of its geom, so that the tendon goes
        through it."""
        m, g, side = self.m, int(self.m.wrap_objid[w]), int(self.m.wrap_prm[w])
        if side < 0:
            return False
        apart = m.site_pos[side] - m.geom_pos[g]  # also if it is a cylinder
        return bool(np.linalg.norm(apart) < m.geom_size[g, 0])
