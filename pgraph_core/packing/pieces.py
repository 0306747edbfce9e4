"""Functions of one number in pieces as rows for kernels."""

import numpy as np

from ..engine import layout as at
from ..functions import Pieces


def pieces(function: Pieces) -> tuple[tuple[float, ...], ...]:
    """Return the rows for `curves` of a function in pieces."""
    places, powers, end, repeats = function
    found = np.zeros((len(places), at.KNOT))
    found[:, at.PIECE_AT] = places
    found[:-1, at.PIECE_POWERS : at.PIECE_POWERS + len(powers)] = powers.T
    found[-1, at.PIECE_POWERS] = end
    if repeats:
        found[0, at.PIECE_RATE] = 1.0 / (places[-1] - places[0])
    return tuple(map(tuple, found.tolist()))
