"""The scene in the form passed to kernels: named tuples of arrays, and their kinds.

A *scene* is a tuple with the constant data and the workspaces of a run, which is accessed by a
single address (`compiler.address`). All methods therefore have the same arguments, and each sweep
has one argument instead of all arrays. `opened` returns it with field names. Access by name has no
overhead compared with access by position. The columns of the arrays are named in `layout`.
"""

from collections import namedtuple
from typing import Any, NamedTuple

from ..forces import LOADS as KINDS_OF_LOADS
from ..forces import VIA
from ..forces.obstacles import follow_each_other
from .compiler.address import stored
from .compiler.kinds import (
    C2,
    F1,
    F2,
    F3,
    I1,
    I2,
    array_of,
    carrying,
    group,
    i8,
    named,
    of_duals,
    plain,
)
from .records import (
    APART,
    BODY_WRENCH,
    BOUNDS,
    CANDIDATE,
    CELL,
    CLEARANCE,
    CONTACT,
    CONTACT_TALLY,
    COUNTERS,
    DIP,
    EDGE,
    FACE,
    GROUND_PAIR,
    JOINT_FORCE,
    KEPT,
    LIMIT,
    MEETING,
    MEMBER,
    METHOD,
    PAIR,
    PAIR_LAW,
    PATCH,
    PHASE_CHANGE,
    PLANE,
    POINT,
    POINT_FRAME,
    POSE,
    SHAPE,
    SHAPE_PAIR,
    STEP_CONTROL,
    WATCH,
    columns,
)
from .riders import RIDER, SHIFT

# Rows of `Workspace.vectors`
RHS, LAMBDA, EFFECT = 0, 1, 2  # right side and solution of Ω λ = r, what λ does to the joints
DINV = 3  # 1/d of every freedom
ZERO, MOVED = 4, 5  # no joint forces, change of v that waits for that of q
TAU = 6  # joint forces
PLACED, FACTORED = 7, 8  # q of the last factors, and what FACTORS names:
FACTORS = columns("mu", "nulls", "known")  # their μ, number of null directions, 1 if they are valid
LEAST = 9  # the smallest inverse pivots so far
CORRECTION, CORRECTION_SIZES = 10, 11  # change of λ in its refinement, sizes of its derivatives
RESIDUAL, RESIDUAL_RATE = 12, 13  # g, g' or g'' of observed rows, and g' beside g
INTO_CONES = 14  # change of λ towards the cones of stances
BEFORE = 15  # velocities of rows before an impulse
FREE_SPEEDS, TARGET = 16, 17  # speeds of an island's joints and rows without impulses
JOINT_SPEEDS = 18  # those of the joints with impulses
SPEEDS = 19  # joint speeds without impulses, behind the articulated factors
LAST_RHS = 20  # RHS of the last solution
IMPULSES_BEFORE, BEST_IMPULSES = 21, 22  # λ to return to, and the best so far, in Newton's method
HELD_IMPULSES = 23  # λ with given friction bounds
REPORT = 24  # report on the impulse solver, by these:
# sweeps, Newton's steps, largest miss of a law, energy gained [J], hard islands, islands that no
# velocities satisfy, bounces left out, 1 + a block of impulses that are not unique
SWEEPS_DONE, STEPS_DONE, MISSED, STRAYS, GAINED, HARD, BARRED, CALMED, LOOSE = range(9)
DAMPING, STIFFNESS = 25, 26  # drives in a step as inertia, as torque
OWN_ARMATURE, OWN_GIVEN = 27, 28  # the same without drives
# mean velocity of a part of a step, change of v by its impulses, half of J' v times its width
MEAN, KICK, TURNED = 29, 30, 31
FREE_SPIN = 32  # scratch of `spinning.keep_spinning`
SPEEDS_AFTER = 33  # joint speeds after the impulses of a part
PUSH, UNPUSHED = 34, 35  # motion that removes penetration, q before it
WAY_SPEEDS = 36  # joint speeds at a time of the way to an impact
# of derivatives: speeds of rows a little sooner and later, gaps on the way to an impact, by how
# much laws are missed, what one impulse does to the joints
SOONER, LATER, PATH_GAPS, LAW_MISSES, UNIT_EFFECT = 37, 38, 39, 40, 41
DRIVEN = 42  # damping of servos of a coordinate, then their share of all damping
GYRE = 43  # the `spinning.SPIN` rows of the search for velocities at the middle of a step
VECTORS = GYRE + 25


class Drives(NamedTuple):
    """Springs, dampers and friction of joints, then motors and servos."""

    table: Any  # records of JOINT_FORCE
    knots: (
        Any  # (nk, 4) time [s], value, slope after it, what acts of an input with a lag or integral
    )
    passive: Any  # number of springs and dampers in the table
    terms: Any  # (nt, 3) index into v, into q, coefficient: of forces along several coordinates


class Loads(namedtuple("_Loads", [*(one.kind for one in KINDS_OF_LOADS), "riders", "signals"])):
    """Forces between two bodies or on one body, as (table, knots, via points) for each kind by
    name.

    The last members are (table, shifts, curves, gates) of the points that ride, as in `riders`, and
    (code, targets, states) of the expressions in them, in the drives and in the controls.
    """

    __slots__ = ()

    @property
    def number(self) -> int:
        """Return the number of loads and expressions."""
        return sum(len(table) for table, *_ in self.kinds) + len(self.signals[0])

    @property
    def kinds(self) -> tuple[Any, ...]:
        """Return (table, knots, via points) of each kind."""
        return self[: len(KINDS_OF_LOADS)]

    @property
    def rows(self) -> int:
        """Return the number of rows of a workspace with points that ride and those between
        obstacles in a row, 0 if there are none."""
        spans = (
            (one["room"], vias[one["first_via"] :][: one["vias"]])
            for table, _, vias in self.kinds
            for one in (table if len(vias) else ())
        )
        ends = [int(room) + len(own) for room, own in spans if follow_each_other(own)]
        return max((*ends, *(self.riders[0]["row"] + 1)), default=0)


class Blocks(NamedTuple):
    """Constraints as blocks of up to three rows."""

    blocks_i: Any  # (nb, 8)
    blocks_f: Any  # (nb, 40)
    terms_i: Any  # (nt, 2) of coordinate rows: index into v, index into q or -1
    terms_f: Any  # (nt,) their coefficients
    curves: Any  # (nk, 10) functions of time and of coordinates
    stations: Any  # records VIA of cables
    active: Any  # (nb + 1,) the number of active blocks, then their indices


class Workspace(NamedTuple):
    """Workspace of the constraint kernels.

    w is the maximum number of degrees of freedom on the paths of a block, and m the number of rows,
    a multiple of 3.
    """

    y: Any  # (nb, 3 w) what unit multipliers do in each joint
    slots: Any  # (nb, w + 2) number of joints, first row, then their indices into v
    omega: Any  # (m, m) Delassus matrix
    factor: Any  # (m, m) of omega
    place: Any  # (nb, 15) where and along what a block acts
    vectors: Any  # (VECTORS, at least m, nq, LOOSE + 1) rows are named above
    linear: Any  # (n + 1, 3) velocities of origins [m/s]
    carried: Any  # (n + 1, 6) wrenches on their way to the ground
    watch: Any  # (1,) where the pivots of omega dip in a run
    dips: Any  # (8,) the first dips
    dip_states: Any  # (8, nq + nv) q and v there
    nulls: Any  # (m, m) null directions of omega
    where: Any  # (nv,) places of joints in a row of y, from 1, 0 for none
    own: Any  # (nb, 9) a block's part of omega


class Links(NamedTuple):
    """Addresses of a scene's contacts and of kernels that only some scenes need, 0 if absent."""

    contacts: Any = 0
    find: Any = 0
    forces: Any = 0
    record: Any = 0
    settle: Any = 0
    constraints: Any = 0


class User(NamedTuple):
    """A user's function."""

    address: Any  # 0: none
    exchange: Any  # (3, n) q, v and τ as rows
    answer: Any  # (1,) what it returned


class Scene(NamedTuple):
    """A scene."""

    rows: Any
    const: Any
    drives: Any
    loads: Any
    blocks: Any
    work: Any
    space: Any
    gains: Any  # (2,) of Baumgarte
    given: Any  # (nv,) torques in addition to all others
    user: Any
    links: Any


class Frames(NamedTuple):
    """Arrays that a run records, one row per frame."""

    q: Any
    v: Any
    vdot: Any
    # (n, blocks, 6) wrenches of constraints, with time stepping (n, blocks, 12): then the means
    # since the previous frame
    wrenches: Any
    energies: Any  # (n, 4) kinetic, potential, work of drives, dissipation [J]
    drifts: Any  # (n, 2) largest residuals of constraints
    pushes: Any  # (n, nb, 6) wrenches of contacts on bodies
    pairs: Any  # (n, contact pairs and limits) of PAIR
    missed: Any  # (n, 3) complementarity [N], cone [N], penetration [m]


class Geometry(NamedTuple):
    """Shapes for collision detection."""

    shapes: Any  # records of SHAPE
    vertices: Any  # (nv, 3) in the shape's frame [m]
    normals: Any  # (nf, 3) outward, in the shape's frame
    faces: Any  # records FACE
    rings: Any  # (nr,) vertices around a face, counterclockwise from outside
    edges: Any  # records EDGE
    neighbours: Any  # (nn,) shapes that touch others of the same row
    down: Any  # (3,) direction of gravity, zero without it


class Ground(NamedTuple):
    """The ground: a plane, and rectangles at other heights."""

    plane: Any  # one PLANE
    patches: Any  # records of PATCH


class Candidates(NamedTuple):
    """Candidate shapes for contact."""

    on_ground: Any  # records of GROUND_PAIR
    pairs: Any  # records of SHAPE_PAIR
    members: Any  # records of MEMBER
    apart: Any  # records of APART


class Search(NamedTuple):
    """Scratch space for the search for contact points."""

    room: Any  # records of CANDIDATE
    bounds: Any  # records of BOUNDS
    cells: Any  # records of CELL
    buckets: Any  # (a power of two,) first member of every bucket


class Islands(NamedTuple):
    """Scratch space for the contact solver: islands, the order of one island, its Newton matrix."""

    tree: Any  # (nv,) the tree of every freedom, by its first row
    root: Any  # (n + 1,) the tree of every row
    head: Any  # (n + 1,) the last row of every tree, -1: none
    below: Any  # (n + 1,) the row before in the same tree, -1: none
    chief: Any  # (n + 1,) a tree of the same island, itself if it represents the island
    number: Any  # (n + 1,) the island of such a tree
    edge: Any  # (n + 1,) the first edge of every tree, -1: none
    edges: Any  # (ne, 2) the next edge of the same tree or -1, and the tree at its other end
    blocks: Any  # (nb,) active blocks, island after island
    first: Any  # (nb + 2,) where the blocks of an island begin
    graph: Any  # (n + 1, 7) of every tree, named in `islands`
    queue: Any  # (n + 1,) trees in the order of elimination
    size: Any  # (6,) numbers named in `islands`
    freedoms: Any  # (nv,) in the order of elimination
    place: Any  # (nv,) where a freedom stands in that order, -1: nowhere
    start: Any  # (nv / 4 + 1,) where rows of 4 x 4 blocks begin
    column: Any  # (nu,) columns of blocks
    waiting: Any  # (nv / 4,) the first row or block that has columns for a row, -1: none
    after: Any  # (nv / 4 + nb,) the next one
    upper: Any  # (nu, 16) the matrix, then its factor
    lower: Any  # (nu, 16)
    change: Any  # (at least nv / 4, 4) right-hand side, then solution
    speeds: Any  # (at least nv / 4, 4) w
    free: Any  # (at least nv / 4, 4) w without impulses
    path: Any  # (at least nv / 4, 4) change of w that λ does not include yet
    scale: Any  # (nv,) what a freedom's w is multiplied by to get its speed
    across: Any  # (nf, 12) rows of Y of all blocks, by four columns of the matrix
    reached: Any  # (nf,) these fours of columns
    fours: Any  # (nb + 1,) where those of a block begin
    pushed: Any  # (nb, 3) by how much impulses miss their laws, and those of a conflict [N s]
    slope: Any  # memory of Newton's method and sweeps per block
    weight: Any  # (nb,) largest mobility of all points of a touch [1/kg]
    mobility: Any  # (nb,) largest own entry of Ω [1/kg]


class Contacts(NamedTuple):
    """The contacts of a scene, including the state that is carried from step to step."""

    geometry: Any
    ground: Any
    candidates: Any
    poses: Any  # records of POSE, one per shape
    start_poses: Any  # records of POSE at the start of a step with fast motion
    search: Any
    found: Any  # contact points, of CONTACT
    laws: Any  # records of PAIR_LAW, one per contact pair
    kept: Any  # records of KEPT: impulses of the last step
    before: Any  # records of KEPT: impulses at the start of the step, for when it is repeated
    anchors: Any  # records of KEPT: anchors of penalty friction
    meetings: Any  # records of MEETING
    wrenches: Any  # records of BODY_WRENCH, one per body: wrenches of contacts
    pairs: Any  # records of PAIR: contact pairs, then limits
    tally: Any  # one CONTACT_TALLY
    bodies_i: Any
    bodies_f: Any
    limit_tau: Any  # (nv,) torques of joint limits in the last step
    changes: Any  # records of PHASE_CHANGE. The reader must reset `logged`
    islands: Any
    factored: Any  # a second `work` for the masses that soft and penalty contacts move


class Guard(NamedTuple):
    """The proximity guard of a run that starts without contacts, limits and conditions."""

    geometry: Any
    ground: Any
    candidates: Any
    poses: Any  # records of POSE, one per shape
    search: Any
    found: Any  # records of CONTACT
    limits: Any  # records of LIMIT: limits, then conditions
    state: Any  # one CLEARANCE
    reach: Any  # (n + 1,) of the shapes that a row carries, from its origin [m]
    gaps: Any  # (pairs,) scratch


class EventLinks(NamedTuple):
    """Addresses of the kernels and scenes that make up a scene with contact points."""

    tree: Any  # the equations of motion without points
    bare: Any  # the same scene without active blocks
    held: Any  # the scene whose active blocks are what is projected
    acceleration: Any  # the equations of motion with points
    record: Any  # kernel that records without points
    observe: Any  # kernel that observes points
    project: Any  # kernel that projects


class EventContacts(NamedTuple):
    """Contact points and limits with their phases. The first k of them slide."""

    links: Any
    points: Any  # records of POINT
    every: Any  # every point's `slide_block` as active blocks
    watched: Any  # (4, 3 ns) what ends a phase, where it falls below zero
    columns: Any  # (3 k + 2, m) c and the right side, what Ω_BB⁺ makes of them, Ω of the normals
    small: Any  # (3 k + 2, k)
    frames: Any  # (n, ns) of POINT_FRAME


class EventData(NamedTuple):
    """A scene with contact points. `opened` returns the scene alone."""

    scene: Any
    contact: Any


class RunLinks(NamedTuple):
    """Addresses of the kernels of a run, 0 if absent."""

    accelerate: Any
    project: Any
    record: Any
    step: Any
    look_back: Any = 0  # for events within the last step
    events: Any = 0  # values of a user's events
    watch: Any = 0  # whether something has come near
    cross: Any = 0  # the kernel that ends steps at comparisons of the motion


class Tableau(NamedTuple):
    """The coefficients of a Runge-Kutta method, see `integrators.Tableau`."""

    a: Any
    b: Any
    c: Any
    error: Any
    dense: Any


class Carried(NamedTuple):
    """The runs of duals that repeat the parts of a step of time stepping."""

    repeat: Any  # address of the kernel that repeats a part in all runs
    part: Any  # address of the kernel that does so in one
    runs: Any  # (k,) addresses of the runs of duals
    order: Any  # (m,) rows with unknown impulses
    matrix: Any  # (m, m) of their laws
    right: Any  # (m, WIDTH)
    ended: Any  # (2,) when derivatives ceased to exist [s], and why


class Run(NamedTuple):
    """A run in progress: scene, method, times, state and frames."""

    scene: Any  # address
    links: Any
    tableau: Any
    method: Any  # one METHOD
    times: Any  # (n,) of frames [s]
    substeps: Any  # (n - 1,) given steps between them, where they are given
    width: Any  # (n - 1,) of these [s]
    corners: Any  # (nk,) times at which tables bend: steps end there [s]
    stages: Any  # (STAGE + stages, nq + nv + 2), with rows named in `layout`
    real: Any  # workspace of implicit methods
    pair: Any  # the same, complex
    control: Any  # one STEP_CONTROL
    counters: Any  # one COUNTERS
    flow: Any  # (3,) power put in and dissipated [W], iterations
    watched: Any  # (6, k) what ends a phase or makes an event, where it falls below zero
    signs: Any  # (ne,) signs of a user's events, 0 if unknown
    wanted: Any  # (ne,) counted directions, 0 for both
    values: Any  # (ne,)
    out: Any  # frames


DRIVES = named(Drives, array_of(JOINT_FORCE), F2, i8, F2)
LOADS = named(
    Loads, *(group(array_of(one.row), F2, array_of(VIA)) for one in KINDS_OF_LOADS),
    group(array_of(RIDER), array_of(SHIFT), F2, F2), group(F2, I2, I2),
)  # fmt: skip
BLOCKS = named(Blocks, I2, F2, I2, F1, F2, array_of(VIA), I1)
SPACE = named(
    Workspace, F2, I2, F2, F2, F2, F2, F2, F2, array_of(WATCH), array_of(DIP), F2, F2, I1, F2
)
USER = named(User, i8, F2, I1)
LINKS = named(Links, *[i8] * 6)
SCENE = named(Scene, I2, F2, DRIVES, LOADS, BLOCKS, F2, SPACE, F1, F1, USER, LINKS)
OUT = plain(named(Frames, F2, F2, F2, F3, F2, F2, F3, array_of(PAIR, 2), F2))
GEOMETRY = named(Geometry, array_of(SHAPE), F2, F2, array_of(FACE), I1, array_of(EDGE), I1, F1)
GROUND = named(Ground, array_of(PLANE), array_of(PATCH))
CANDIDATES = named(Candidates, *map(array_of, (GROUND_PAIR, SHAPE_PAIR, MEMBER, APART)))
POSES, FOUND = array_of(POSE), array_of(CONTACT)
SEARCH = named(Search, *map(array_of, (CANDIDATE, BOUNDS, CELL)), I1)
ISLANDS = named(
    Islands, *[I1] * 7, *[I2, I1, I1] * 2, *[I1] * 6, *[F2] * 6, F1, F2, I1, I1, F2, F2, F1, F1
)
CONTACTS = named(
    Contacts, GEOMETRY, GROUND, CANDIDATES, POSES, POSES, SEARCH, FOUND,
    *map(array_of, (PAIR_LAW, KEPT, KEPT, KEPT, MEETING, BODY_WRENCH, PAIR, CONTACT_TALLY)),
    I2, F2, F1, array_of(PHASE_CHANGE), ISLANDS, F2,
)  # fmt: skip
GUARD = named(
    Guard, GEOMETRY, GROUND, CANDIDATES, POSES, SEARCH, FOUND, array_of(LIMIT), array_of(CLEARANCE),
    F1, F1,
)  # fmt: skip
EVENT_CONTACTS = named(
    EventContacts,
    named(EventLinks, *[i8] * 7),
    array_of(POINT),
    I1,
    F2,
    F2,
    F2,
    array_of(POINT_FRAME, 2),
)
EVENT_SCENE = named(EventData, SCENE, EVENT_CONTACTS)
RUN = named(
    Run, i8, named(RunLinks, *[i8] * 8), named(Tableau, F2, F1, F1, F2, F2), array_of(METHOD), F1,
    I1, F1, F1, F2, F2, C2, array_of(STEP_CONTROL), array_of(COUNTERS), F1, F2, I1, I1, F1, OUT,
)  # fmt: skip

CARRIED = named(Carried, i8, i8, I1, I1, F2, F2, F1)

# of numbers with derivatives: a scene but for a user's function, and what a run computes from it
CONTACTS_OF_DUALS = carrying(CONTACTS).but(islands=ISLANDS)
DESCRIBED = carrying(group(GEOMETRY, GROUND, array_of(PAIR_LAW)))  # contacts as a model gives them
SCENE_OF_DUALS = carrying(SCENE).but(user=USER, links=LINKS.but(contacts=of_duals))
RUN_OF_DUALS = RUN.but(scene=of_duals, **{x: carrying(F2) for x in ("stages", "real")})
RUN_OF_DUALS = RUN_OF_DUALS.but(flow=carrying(F1))

save, opened = stored(SCENE, SCENE_OF_DUALS)
save_run_tuple, opened_run = stored(RUN, RUN_OF_DUALS)
save_guard_tuple, guard_at = stored(GUARD)
save_carried_tuple, carried_at = stored(CARRIED)
