"""Three wrenches at once, whose numbers are triples: those of a constraint block."""

from ..compiler.jit import part
from ..compiler.lane import numbers, triple
from ..compiler.masks import any_of


@part
def any_number(x):
    """Check whether a number of a triple is nonzero in any lane."""
    a, b, c = numbers(x)
    return any_of(a) or any_of(b) or any_of(c)


@part
def no_triples():
    """Return a vector of triples, which is zero."""
    return (triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0))
