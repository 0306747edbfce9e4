"""Random scenes, ordinary and extreme, whose motion is known without this package.

Each family draws a model over scales of mass, length, time and stiffness, with the closed form of
its motion, or none where a far finer run by another method is the judge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from . import bound_scenes, smooth_scenes, touching_scenes, tree_scenes
from .scene import Rng
from .scene import Scene as Scene

FAMILIES: dict[str, Callable[[Rng], Scene]] = {
    **smooth_scenes.FAMILIES,
    **tree_scenes.FAMILIES,
    **bound_scenes.FAMILIES,
    **touching_scenes.FAMILIES,
}
SMOOTH = frozenset({*smooth_scenes.FAMILIES, *tree_scenes.FAMILIES, *bound_scenes.FAMILIES})


def scenes(count: int, seed: int, first: int = 0) -> Iterator[Scene]:
    """`count` scenes from number `first` on, the families in turn.

    A scene depends on the seed and its number only.
    """
    families = list(FAMILIES.values())
    for k in range(first, first + count):
        yield families[k % len(families)](np.random.default_rng([seed, k]))
