"""Addresses of the kernels that a step calls."""

from __future__ import annotations

from ..engine import motion
from ..engine.compiler.address import address_of


def links_of(step: object) -> tuple[int, ...]:
    return tuple(
        address_of(kernel)
        for kernel in (motion.acceleration, motion.projection, motion.record, step)
    )
