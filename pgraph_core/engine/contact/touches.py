"""Contact points within a step: which have touched before it, and where the next ones touch."""

from ...tolerances import ROUNDING
from ..arrays import opened
from ..compiler.address import caller
from ..compiler.jit import part, sweep
from ..compiler.kinds import f8, i8
from ..constraints.blocks import point_velocity
from ..records import CYLINDER, HULL, RIGID
from ..vec import add, scale, set_xyz, sub, xyz

FIND = i8(i8, f8, i8)
_call_find = caller(FIND)

HOLDING = 3  # a state of a tally: steps end at touches, so that no penalty force begins within one
AT_ONCE = ROUNDING  # gap within which shapes touch, relative to the length of the mechanism
NEARBY = 128  # entries that are looked at for what a contact point kept


@part
def touching(scene, margin, placed):
    """Call `find` by address, so that the shape code is compiled only once."""
    return _call_find(opened(scene).links.find, (scene, margin, placed))


@part
def endpoints(contacts, n):
    """Return (row A, row B, body A, body B, contact pair) of contact point n, 0: the ground."""
    point, shapes = contacts.found[n], contacts.geometry.shapes
    b = point.shape_b
    row_b = shapes[b].row if b >= 0 else 0
    body_b = shapes[b].body if b >= 0 else 0
    a = shapes[point.shape_a]
    return a.row, row_b, a.body, body_b, point.pair


@part
def middle(point):
    """Return the point of action of a contact, midway between the two surfaces."""
    return scale(0.5, add(xyz(point.point_a), xyz(point.point_b)))


@part
def relative_velocity(contacts, work, linear, n):
    """Return the velocity of body A relative to body B at contact point n."""
    a, b, _, _, _ = endpoints(contacts, n)
    p = middle(contacts.found[n])
    return sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, p))


@part
def kept_place(point, kept, count, start):
    """Return a contact point's index in the last step, searching around `start`, or -1 if not
    found.

    The order of points changes little between steps, so the search is short.
    """
    for m in range(min(count, NEARBY)):
        k = (start + (m + 1) // 2 * (1 - 2 * (m % 2))) % count
        if (
            kept[k].shape_a == point.shape_a
            and kept[k].shape_b == point.shape_b
            and kept[k].feature == point.feature
        ):
            return k
    return -1


@part
def keep_point(kept, point, value):
    """Store a vector for a contact point until the next step."""
    set_xyz(kept.value, value)
    kept.shape_a = point.shape_a
    kept.shape_b = point.shape_b
    kept.feature = point.feature
    set_xyz(kept.turn, (0.0, 0.0, 0.0))
    kept.slides = 0
    kept.settled = 0


@part
def nearness(contacts):
    """Return the gap [m] within which points touch, if steps end where shapes touch."""
    tally = contacts.tally[0]
    return AT_ONCE * tally.length if tally.frozen == HOLDING else 0.0


@sweep
def has_touched(contacts, n):
    """Check whether contact point n touched at the end of the last step.

    Vertices over the ground keep their identity. Other points may give way to other points of the
    same shapes while these touch.
    """
    point, anchors, count = contacts.found[n], contacts.anchors, contacts.tally[0].anchored
    kind = contacts.geometry.shapes[point.shape_a].kind
    if point.shape_b < 0 and kind != HULL and kind != CYLINDER:
        return kept_place(point, anchors, count, n) >= 0
    for k in range(count):
        if anchors[k].shape_a == point.shape_a and anchors[k].shape_b == point.shape_b:
            return True
    return False


@sweep
def next_touch(contacts, count, far):
    """Find the least gap of compliant contact points that have not touched, or `far` [m]."""
    least = far
    for n in range(count):
        point = contacts.found[n]
        yields = contacts.laws[point.pair].law != RIGID
        if yields and point.gap < least and not has_touched(contacts, n):
            least = point.gap
    return least


@sweep
def keep_touches(contacts):
    """Keep the contact points that were found last and touch, at the end of a step."""
    tally, near, none = contacts.tally[0], nearness(contacts), (0.0, 0.0, 0.0)
    count = 0
    for n in range(tally.found):
        if contacts.found[n].gap <= near:
            keep_point(contacts.anchors[count], contacts.found[n], none)
            count += 1
    tally.anchored = count
