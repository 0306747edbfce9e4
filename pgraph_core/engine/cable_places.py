"""The spans of a cable in given frames, for packing, analysis and pictures."""

from ..forces.base import VIA
from .cables import cable_length, over_spans
from .compiler.jit import kernel, part
from .compiler.kinds import F1, F2, array_of, f8, read
from .vec import store


@part
def note_span(to, vias, work, n, p, q, along):
    """Write (first point, last point, unit vector) of a span into its row."""
    out, first = to
    store(out, n - 1 - first, 0, p)
    store(out, n - 1 - first, 3, q)
    store(out, n - 1 - first, 6, along)
    return 0.0


note_spans = over_spans(note_span)


@kernel(f8(read(array_of(VIA)), read(F2), read(F1), F2))
def spans_of_segment(vias, work, q, out):
    """Write the spans between stations (n,) into `out` (n - 1, 9), and return the length."""
    last = vias.shape[0] - 1
    note_spans((out, 0), vias, work, 0, last)
    return cable_length(vias, work, q, 0, last)
