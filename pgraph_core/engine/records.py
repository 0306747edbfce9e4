"""Tables used by the kernels: every record type, field by field, with units.

Kernels receive a table as an array of records and read `point.force`. In Python, the same array is
created by `table(POINT, n)` and read by `points["force"]`. Records are aligned, so that compiled
code loads a field as fast as an entry of a plain array. Arrays that are also used in SIMD lanes
(`rows`, `const`, `work`) are not records. Their columns are defined in `layout`.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from ..tolerances import NAMED, VISIBLE
from .compiler.jit import JIT

REAL, INTEGER = np.float64, np.int64


class Uncompiled(np.record):  # pyright: ignore[reportIncompatibleVariableOverride]
    """A record for kernels run as Python, in which fields take precedence over NumPy attributes."""

    def __getattribute__(self, name: str) -> Any:
        if not name.startswith("_") and name in np.record.__getattribute__(self, "dtype").names:
            return self[name]
        return np.record.__getattribute__(self, name)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


def record(**fields: Any) -> np.dtype[Any]:
    """Return an aligned record type. Fields are types, or types with shapes."""
    split = {name: kind if isinstance(kind, tuple) else (kind,) for name, kind in fields.items()}
    kind = np.dtype([(name, *kind) for name, kind in split.items()], align=True)
    return kind if JIT else np.dtype((Uncompiled, kind))


def columns(*names: str, **widths: int) -> Any:
    """Return the first column of each name, and `total`, the number of columns.

    A name without a width has one column. Columns follow each other, so none has two names.
    """
    widths = dict.fromkeys(names, 1) | widths
    places = accumulate(widths.values(), initial=0)
    return namedtuple("Columns", [*widths, "total"])(*places)


# rows of `watched`: at a step's start, the bracket, now, then the least distance of a user's event
# from zero, its time [s], 1 where it has come near zero at the end of a part, the time in the step
# since which its sign is known, the rate of its margin at the event located last, the size that it
# has to exceed before its sign is known again, and the size up to which it is zero in this part
WATCHED = columns(
    "start", "low", "high", "now", "nearest", "when", "nears", "since", "rate", "zero", "rest"
)


def table(kind: np.dtype[Any], *shape: int) -> Any:
    """Return an array of records, initialised to zero."""
    return np.zeros(shape, kind)


def offsets(kind: np.dtype[Any]) -> dict[str, int]:
    """Return the place of each field [bytes], also of those of records within the record."""
    found: dict[str, int] = {}
    for name, (inside, start, *_) in (kind.fields or {}).items():
        inner = offsets(inside) if inside.names else {name: 0}
        found |= {one: start + place for one, place in inner.items()}
    return found


def rows_of(kind: np.dtype[Any], rows: Any) -> Any:
    """Return an array of records built from rows of numbers."""
    found = table(kind, len(rows))
    for one, row in zip(found, rows):
        for name, value in zip(kind.names or (), row):
            one[name] = value
    return found


def joined(kind: np.dtype[Any], parts: Sequence[Any]) -> Any:
    """Return one array of the records of all parts. NumPy would not keep a type of its own."""
    found, end = table(kind, sum(map(len, parts))), 0
    for own in parts:
        found[end : end + len(own)] = own
        end += len(own)
    return found


def by_name(one: Any) -> dict[str, Any]:
    """Return a record as Python numbers by field name."""
    return dict(zip(one.dtype.names, one.item()))


# -- constraints ----------------------------------------------------------------------------------

WATCH = record(
    time=REAL,  # time of the last evaluation [s]
    apart=REAL,  # since the one before [s]
    count=INTEGER,  # dips of pivots so far
    rows=INTEGER,  # watched rows of constraints
    inside=INTEGER,  # 1: a dip is under way
)

DIP = record(
    depth=REAL,  # largest pivot over it
    time=REAL,  # time of its deepest place [s]
    apart=REAL,  # time since the evaluation before [s]
)

# -- runs -----------------------------------------------------------------------------------------

CHOSEN, GIVEN = 0, 1  # widths of steps: by their error, as listed
ONCE, ALWAYS = 1, 2  # when events are due: after this step, after every step
ASLEEP = 2  # direction of an event that is not watched, where -1, 0 and 1 are falling, both, rising
REACHED, CONTACT_AHEAD = (
    1,
    2,
)  # reason of an interruption: an event, a possible contact in the next step

METHOD = record(
    order=INTEGER,
    starts=INTEGER,  # 1: a step starts from v' at Y
    ends=INTEGER,  # 1: its last stage is the slope at its end
    safety=REAL,  # used share of the width that the error permits
    by_error=REAL,  # exponent of the error in the next width
    by_last=REAL,  # exponent of the error before that
    least=REAL,  # smallest and largest change of the width
    most=REAL,
)

CLOCK_STATE = record(  # time and progress of a run
    time=REAL,  # time of the state [s]
    width=REAL,  # the step to try next [s]
    old_time=REAL,  # time of the state before the last step [s]
    old_width=REAL,  # width of the step from there [s]
    clip=REAL,  # stages are not taken later: left of a corner or edge [s]
    span=REAL,  # length of the run [s]
    frame=INTEGER,  # the next frame
    last=INTEGER,  # frames until which the run goes on
    most=INTEGER,  # steps allowed
    fresh=INTEGER,  # 1: SLOPE belongs to Y
    filled=INTEGER,  # 1: the further stages of dense output are known
    repeated=INTEGER,  # 1: the stages are those of a part of the last step
    failed=REAL,  # time of the failure of the run [s]
    fastest=INTEGER,  # row that moved fastest there
)

ERROR_CONTROL = record(  # tolerances and errors that choose the width of steps
    last_error=REAL,  # error of the last accepted step over the tolerance
    rtol=REAL,  # relative to the scales below
    atol=REAL,  # absolute, for every coordinate
    widest=REAL,  # the largest step [s]
    length=REAL,  # length of the mechanism, or its displacement [m]
    spin=REAL,  # the fastest rotation so far [rad/s]
    speed=REAL,  # the fastest translation so far [m/s]
    widths=INTEGER,  # CHOSEN or GIVEN
    project=INTEGER,  # 1: steps end on the constraints
    rejected=INTEGER,  # 1: the last step was rejected
    broken=INTEGER,  # why: 1 not finite, 2 not solved
    steepest=REAL,  # largest acceleration of a step so far, if corners end steps [rad/s², m/s²]
)

ENDS_OF_STEPS = record(  # the times at which steps end, and results held until then
    corner=INTEGER,  # the next corner of a table
    edges=INTEGER,  # comparisons of times in expressions, at whose changes steps end
    edge=REAL,  # time of the last corner or edge at which a step ended [s]
    change=REAL,  # time of the last event, or change of a comparison of the motion [s]
    sided=INTEGER,  # 1: comparisons of the motion are held with their results at Y
    clear=REAL,  # results are valid until this time, within the ranges of the state [s]
    slid=INTEGER,  # row of the comparison along whose margin the motion slides, 0 for none
    share=REAL,  # weight of the true branch in the last step
    pieces=INTEGER,  # parts left of the way to such a change, in a finer run
    shut=REAL,  # least width of a step that ends at such a change [s]
    samples=INTEGER,  # states of controls that change at samples, at which steps end
    parts=INTEGER,  # divisions of intervals shorter than a step, more than 1 in a finer run
    lag=REAL,  # the shortest lag of an input [s], inf for none
    origin=REAL,  # from which given steps are counted [s]
    taken=INTEGER,  # given steps since then
    left=INTEGER,  # given steps to the next frame
    done=REAL,  # finished part of the current given step [s]
)

GUARD_STATE = record(  # events and contacts to find in a step
    fired=INTEGER,  # REACHED or CONTACT_AHEAD: waits to be reported
    turning=REAL,  # time in which friction may turn slow slip around [s]
    bound=REAL,  # the next step may not be wider, or things could pass through each other [s]
    address=INTEGER,  # address of a GUARD, 0 for none
    due=INTEGER,  # ALWAYS or ONCE: events are looked for in the last step
    next_check=REAL,  # time of the next check of the guard while nothing is faster than `slow` [s]
    slow=REAL,  # [rad/s, m/s]
    approach=INTEGER,  # address of the kernel that finds `bound`, 0 for none
    carried=INTEGER,  # address of what repeats parts of a step with derivatives, 0 for none
)

NEWTON_STATE = record(  # matrices of implicit methods
    jacobian_rate=REAL,  # convergence rate of Newton's method, large without a Jacobian
    jacobian_time=REAL,  # time of the Jacobian [s]
    factored=REAL,  # width for which the matrices are factored [s]
)

STEP_CONTROL = record(
    nq=INTEGER,
    nv=INTEGER,
    clock=CLOCK_STATE,
    error=ERROR_CONTROL,
    ends=ENDS_OF_STEPS,
    guard=GUARD_STATE,
    newton=NEWTON_STATE,
)

COUNTERS = record(
    steps=INTEGER,
    evaluations=INTEGER,
    projections=INTEGER,
    solver_iterations=INTEGER,
    rejected_steps=INTEGER,
    jacobians=INTEGER,
    factorisations=INTEGER,
    newton_iterations=INTEGER,
)

# -- forces ----------------------------------------------------------------------------------------

# torque = clamp(stiffness (target(t) - q) - damping v + torque(t)) - friction sign(v); springs,
# dampers and friction of joints and tendons come first, then motors and servos. Where a force has
# terms, q and v are the sums of coefficient × coordinate, and each of these gets its coefficient
# of the torque.
JOINT_FORCE = record(
    velocity=INTEGER,  # index into v, of the first term if there are terms
    coordinate=INTEGER,  # index into q, -1: the force does not depend on q
    stiffness=REAL,  # [N m/rad, N/m]
    damping=REAL,  # [N m s/rad, N s/m]
    low=REAL,  # least torque of a motor or servo [N m, N]
    high=REAL,  # largest
    friction=REAL,  # [N m, N]
    creep=REAL,  # speed below which friction is regularised [rad/s, m/s]
    first_target=INTEGER,  # knot of the target
    targets=INTEGER,  # number of knots of the target
    first_torque=INTEGER,
    torques=INTEGER,
    first_term=INTEGER,
    terms=INTEGER,  # 0: one coordinate, with the coefficient 1
    # of the input, which is the target, or without one the torque
    lag=REAL,  # time constant with which it acts [s]
    integrates=INTEGER,  # 1: its integral acts
    least=REAL,  # bounds of the integral
    most=REAL,
)
# rad/s, m/s: friction is regularised as v / √(v² + creep²); of a soft contact, in units of √(g L)
CREEP = 1e-3

# -- shapes ----------------------------------------------------------------------------------------

SPHERE, CAPSULE, BOX, CYLINDER, HULL, POINTS = 0, 1, 2, 3, 4, 5  # kinds of shape
ELLIPSOID, HEIGHTFIELD = 6, 7

# A ball of `radius` about one vertex is a sphere, about two a capsule. Cylinders and ellipsoids
# have no vertices: their box says all. A heightfield has a vertex a height, row by row, and the
# faces and edges of one prism, of which each of its triangles is the top.
SHAPE = record(  # its frame in the home axes of its row
    kind=INTEGER,
    row=INTEGER,  # row that carries it, 0 for the ground
    body=INTEGER,  # number of its body
    first_vertex=INTEGER,
    vertices=INTEGER,
    first_face=INTEGER,
    faces=INTEGER,
    first_edge=INTEGER,
    edges=INTEGER,
    columns=INTEGER,  # heights in a row of a heightfield
    first_neighbour=INTEGER,
    neighbours=INTEGER,  # shapes of the same row that touch it
    position=(REAL, 3),  # from the row's origin [m]
    rotation=(REAL, 9),  # row-major
    radius=REAL,  # radius of a sphere, capsule or cylinder, 0 for others [m]
    half_length=REAL,  # half length along z of a capsule without caps, or of a cylinder [m]
    half_extents=(REAL, 3),  # half extents of the bounding box in the shape's frame [m]
    middle=(REAL, 3),  # centre of that box [m]
    reach=REAL,  # from the frame's origin to the farthest point [m]
    moves=INTEGER,  # 1 if the surface moves past the body
    surface_velocity=(REAL, 3),  # surface velocity at the frame origin, in the frame [m/s]
    surface_spin=(REAL, 3),  # [rad/s]
)

FACE = record(first=INTEGER, corners=INTEGER)  # vertices in `rings`

EDGE = record(  # end - start lies along n_right × n_left, -1 for no face (of a capsule)
    start=INTEGER,
    end=INTEGER,
    left=INTEGER,  # face
    right=INTEGER,
)

POSE = record(position=(REAL, 3), rotation=(REAL, 9))  # pose of a shape in the world [m]

PLANE = record(  # plane of the ground through the world's origin
    normal=(REAL, 3),
    x=(REAL, 3),  # two unit directions in the plane
    y=(REAL, 3),
)

PATCH = record(  # patch of the ground at another height [m], of which the last one counts
    x_low=REAL,
    x_high=REAL,
    y_low=REAL,
    y_high=REAL,
    height=REAL,
    box=INTEGER,  # 1: what touches there is a box, not the plane
)

# -- search for contact points ---------------------------------------------------------------------

GROUND_PAIR = record(shape=INTEGER, pair=INTEGER)  # a shape over the ground
SHAPE_PAIR = record(shape_a=INTEGER, shape_b=INTEGER, pair=INTEGER)
MEMBER = record(shape=INTEGER, pair=INTEGER)  # every two members of one contact may touch
APART = record(low=INTEGER, high=INTEGER)  # bodies that may not touch as members, sorted

CONTACT = record(  # a contact point in world axes, where B is the ground or the second shape
    point_a=(REAL, 3),  # [m]
    point_b=(REAL, 3),
    normal=(REAL, 3),  # unit, from B to A
    gap=REAL,  # (point_a - point_b) · normal [m], negative where they penetrate
    shape_a=INTEGER,
    shape_b=INTEGER,  # -1: the ground
    feature=INTEGER,  # vertex, edge or face that touches: the same number as long as it does
    pair=INTEGER,  # contact pair
    held=(REAL, 3),  # impulse of the last step, as KEPT has it [N s]
)

CANDIDATE = record(  # scratch of one pair: a vertex, a normal or a candidate point
    place=(REAL, 3),
    height=REAL,  # the gap there [m]
    tag=INTEGER,
)

BOUNDS = record(low=(REAL, 3), high=(REAL, 3))  # bounding box of a shape in the world [m]

CELL = record(  # cell of a member
    next=INTEGER,  # member in the bucket, -1: none
    place=(INTEGER, 3),  # the cell's three numbers
    large=INTEGER,  # 1: compared with all others
)

# -- contacts of a scene ---------------------------------------------------------------------------
# A contact pair is a shape over the ground, a pair of shapes, or all members of one contact.

RIGID, SOFT, PENALTY = 0, 1, 2  # contact laws
SWING, ACCEPTANCE, SLIP, STANCE = 0, 1, 2, 3  # phases: open, sliding since touchdown, sliding, held

PAIR_LAW = record(
    law=INTEGER,
    friction=REAL,
    restitution=REAL,
    stiffness=REAL,  # [N/m, N/m^1.5]
    damping=REAL,  # [N s/m, s/m]
    static_friction=REAL,
    rolling=REAL,  # torque against rolling over normal force [m]
    spinning=REAL,  # torque about the normal over normal force [m]
    mass=REAL,  # mass of the lightest touching tree [kg]
    loss=REAL,  # χ of a soft contact, 2 ζ of a penalty contact, without a given damping
    creep=REAL,  # speed at which a soft contact regularises friction [m/s]
)

PAIR = record(  # forces of a contact pair in world axes
    force=(REAL, 3),  # force on A [N], or the torque of a limit
    torque=(REAL, 3),  # about the origin of A's body [N m]
    mean_force=(REAL, 3),  # with time stepping the means since the last frame
    mean_torque=(REAL, 3),
    gap=REAL,  # the smallest [m]
    slip=REAL,  # the fastest [m/s]
    phase=INTEGER,  # -1 before the first step
    # if it is rigid: the first located impact of the step [s], and the end of its last push
    struck=REAL,
    ended=REAL,
)

KEPT = record(  # memory of a contact point until the next step
    # Impulse, as of a whole step [N s], and about normal and two tangents [N m s]; of penalty
    # friction the points of A and B that stick to each other, in the axes of their shapes [m].
    value=(REAL, 3),
    turn=(REAL, 3),
    slides=INTEGER,  # 1: it slid in the last step
    settled=INTEGER,  # 1: the impulse is of least norm
    shape_a=INTEGER,
    shape_b=INTEGER,
    feature=INTEGER,
)

MEETING = record(  # two shapes that may meet within a step, -1 for a limit or the ground
    shape_a=INTEGER,
    shape_b=INTEGER,
    vertex=INTEGER,  # part of A that may touch the ground, or the limit's block
    pair=INTEGER,  # contact pair
)

CLEARANCE = record(
    free=REAL,  # remaining motion before anything can touch [m]
    free_turn=REAL,  # remaining motion of coordinates before a limit can be reached [rad, m]
    ahead=REAL,  # distance of the next search [m]
    since=REAL,  # the time for which these hold [s]
    rate=REAL,  # speed of things when no coordinate is faster than the clock allows [m/s]
    margin=REAL,  # gap from which on things are near [m]
)

LIMIT = record(  # sign q - value >= 0, or the condition of an event, which is true where it is < 0
    coordinate=INTEGER,  # index into q
    velocity=INTEGER,  # index into v
    sign=REAL,
    value=REAL,  # [rad, m]
    event=INTEGER,  # its number, -1: a limit
)

BODY_WRENCH = record(torque=(REAL, 3), force=(REAL, 3))  # about the origin of the body's row

PHASE_CHANGE = record(
    time=REAL,  # the end of the step that has the forces of the phase [s]
    when=REAL,  # the change [s], as exact as it is known
    pair=INTEGER,
    phase=INTEGER,
)

FROZEN, ADDING = 1, 2  # states of a tally
DEEP = NAMED / VISIBLE  # depth of soft and penalty contacts with a notice, over that of rigid ones

CONTACT_TALLY = record(
    found=INTEGER,  # contact points
    kept=INTEGER,  # impulses
    started=INTEGER,  # impulses at the start of the step
    anchored=INTEGER,  # anchors of penalty friction
    frictions=INTEGER,  # blocks of joints' friction, which stand before those of limits
    first_limit=INTEGER,  # blocks
    limits=INTEGER,
    first_contact=INTEGER,
    first_turn=INTEGER,  # first block of torsional friction, one per contact point, -1 for none
    frozen=INTEGER,  # FROZEN: the forces of the last step act, ADDING: those of parts are summed
    width=REAL,  # width of the last time step [s]
    elapsed=REAL,  # time since the last frame, over which forces are averaged [s]
    fallbacks=INTEGER,  # steps whose last impulses were no good start
    calmed=INTEGER,  # steps whose bounce was suppressed
    overflows=INTEGER,  # steps with more contact points than there is room for
    logged=INTEGER,  # changes of phases that wait in `changes`
    residual=REAL,  # largest law missed, relative to the velocities
    strayed=REAL,  # sum of velocities by which laws are missed, times the time they last [rad, m]
    depth=REAL,  # deepest penetration [m]
    complementarity=REAL,  # largest violation since the last frame [N, N m]
    cone=REAL,  # largest violation of the friction cone since the last frame [N]
    penetration=REAL,  # the deepest since the last frame [m]
    force=REAL,  # the largest of a contact in the run [N, N m]
    worst=REAL,  # largest violation in the run [N, N m]
    worst_pair=INTEGER,
    worst_time=REAL,  # [s]
    # largest penetration over the thickness of what touches, or DEEP times it for soft and penalty
    # contacts
    deepest=REAL,
    deepest_pair=INTEGER,
    deepest_time=REAL,  # [s]
    deepest_depth=REAL,  # [m]
    cuts=INTEGER,  # steps that were cut short where things meet
    crowded=INTEGER,  # steps with more impacts than are located
    crowded_time=REAL,  # time of the first of them [s]
    chains=INTEGER,  # impacts in which a body that rebounds touches several others
    chain_time=REAL,  # time of the first of them [s]
    barred=INTEGER,  # 1: no velocities satisfy what touches in the last step
    barred_time=REAL,  # [s]
    loose=INTEGER,  # impacts found with impulses that are not unique: sought until the first one
    loose_pair=INTEGER,
    loose_time=REAL,  # [s]
    passed=INTEGER,  # steps in which one shape passed through another
    passed_pair=INTEGER,  # pair of the first of them
    passed_time=REAL,  # [s]
    length=REAL,  # length of the mechanism [m], the size of shapes without one
    pull=REAL,  # magnitude of gravity [m/s²]
    share=REAL,  # share of a step of the sub-step, while forces are summed
    fine=REAL,  # factor on tolerances of impulses, below 1 in the finer run of an estimate
    margin=REAL,  # gap within which points were sought last for the blocks of a sub-step [m]
)

# -- contact points and joint limits of event-driven runs ------------------------------------------

POINT = record(  # world axes, but about or along the axis of a limit
    phase=INTEGER,  # a limit is in SWING or STANCE
    held_block=INTEGER,
    slide_block=INTEGER,  # normal and two tangents
    gap_block=INTEGER,  # normal alone
    limit=INTEGER,  # 1: a joint's limit
    turns=INTEGER,  # 1: a turn of its body moves it
    rim=INTEGER,  # 1: it is the lowest point of a disc, and jumps where the disc lies flat
    fresh=INTEGER,  # 1: its phase began now and the monitor starts at zero, 2: it bounced
    friction=REAL,
    normal=(REAL, 3),
    slip_direction=(REAL, 3),  # also where it is only about to slip
    force=(REAL, 3),  # on the body [N]
    normal_force=REAL,  # [N]
    friction_force=REAL,  # [N]
    gap=REAL,  # [m, rad]
    gap_rate=REAL,  # [m/s, rad/s]
    slip_velocity=(REAL, 3),  # tangential velocity of the point [m/s]
    position=(REAL, 3),  # [m]
    arm=(REAL, 3),  # from the centre of an ellipsoid or disc [m]
    start_arm=(REAL, 3),  # `arm` at the start of the step
    pivot=REAL,  # normal acceleration that a newton gives a sliding point, over that without slip
    rounding=REAL,  # rounding of the gap [m, rad]
    slip_tolerance=REAL,  # speed that counts as none: its direction means nothing [m/s]
    normal_acceleration=REAL,
    tangential_acceleration=(REAL, 3),
    start=REAL,  # gap at the start of the step, or speed along `slip_direction` of a sliding point
    start_rate=REAL,  # `gap_rate` at the start of the step
    compliance=REAL,  # tangential acceleration that a newton gives a sliding point [1/kg]
    blend_speed=REAL,  # below it a step cannot follow how friction turns slip [m/s]
)

POINT_FRAME = record(  # recorded values of a point
    phase=INTEGER,
    force=(REAL, 3),
    position=(REAL, 3),
    slip_velocity=(REAL, 3),
    normal_force=REAL,
    gap=REAL,
)
