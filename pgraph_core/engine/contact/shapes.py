"""Shapes in the world: poses, bounding boxes, and how a contact point is written."""

from .. import layout as at
from ..compiler.jit import part, sweep
from ..vec import add, add_scaled, dot, load, load9, mat_mul, mul, store, store9, sub


@sweep
def place(shapes_i, shapes_f, work, poses):
    """Poses of all shapes from the rows that carry them, after `outboard` and `positions`."""
    for i in range(shapes_i.shape[0]):
        k = shapes_i[i, at.SH_ROW]
        r = load9(work, k, at.R)
        store(poses, i, at.PO_POS, add(load(work, k, at.X), mul(r, load(shapes_f, i, at.SH_POS))))
        store9(poses, i, at.PO_ROT, mat_mul(r, load9(shapes_f, i, at.SH_ROT)))


@part
def vertex(geometry, poses, i, k):
    """Vertex k of shape i in the world."""
    local = load(geometry.vertices, geometry.shapes_i[i, at.SH_VERTEX] + k, 0)
    return add(load(poses, i, at.PO_POS), mul(load9(poses, i, at.PO_ROT), local))


@part
def half_extent(r, half, n):
    """Half the width of a turned box along world axis n."""
    return abs(r[3 * n]) * half[0] + abs(r[3 * n + 1]) * half[1] + abs(r[3 * n + 2]) * half[2]


@sweep
def bound(geometry, poses, i, slack, bounds):
    """The box of shape i in world axes, wider by `slack` on every side."""
    shapes_f = geometry.shapes_f
    r = load9(poses, i, at.PO_ROT)
    middle = add(load(poses, i, at.PO_POS), mul(r, load(shapes_f, i, at.SH_MID)))
    radius = shapes_f[i, at.SH_RADIUS]
    half = load(shapes_f, i, at.SH_BOX)
    kind = geometry.shapes_i[i, at.SH_KIND]
    if kind == at.SPHERE:
        half = (0.0, 0.0, 0.0)
    elif kind == at.CAPSULE:
        half = (0.0, 0.0, shapes_f[i, at.SH_HALF])
    else:
        radius = 0.0
    for n in range(3):
        wide = half_extent(r, half, n) + radius + slack
        bounds[i, n] = middle[n] - wide
        bounds[i, 3 + n] = middle[n] + wide


@part
def far_apart(shapes_f, poses, i, j, margin):
    """Whether the balls that hold two shapes are farther apart than `margin`, or nowhere."""
    x = sub(load(poses, i, at.PO_POS), load(poses, j, at.PO_POS))
    near = shapes_f[i, at.SH_REACH] + shapes_f[j, at.SH_REACH] + margin
    return not dot(x, x) <= near * near


@sweep
def put(out, n, on_b, normal, gap, feature):
    """Write contact point n; n + 1. What does not fit is counted, not written."""
    contacts, contacts_i = out
    if n < contacts.shape[0]:
        store(contacts, n, at.CT_A, add_scaled(on_b, gap, normal))
        store(contacts, n, at.CT_B, on_b)
        store(contacts, n, at.CT_NORMAL, normal)
        contacts[n, at.CT_GAP] = gap
        contacts_i[n, at.CT_FEATURE] = feature
    return n + 1


@sweep
def label(out, first, n, i, j, contact):
    """Whose the points from `first` to n are."""
    contacts_i = out.labels
    for k in range(first, min(n, contacts_i.shape[0])):
        contacts_i[k, at.CT_SHAPE_A] = i
        contacts_i[k, at.CT_SHAPE_B] = j
        contacts_i[k, at.CT_CONTACT] = contact
