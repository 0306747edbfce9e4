"""Addresses of the kernels that a step calls."""

from __future__ import annotations

from ..kernels import motion
from ..kernels.handle import address_of


def links_of(step: object) -> tuple[int, ...]:
    return tuple(
        address_of(kernel)
        for kernel in (motion.acceleration, motion.projection, motion.record, step)
    )
