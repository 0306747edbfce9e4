"""What a scene is, as kernels take it: named tuples of arrays, and their numba types.

A *scene* is what never changes during a run, and the workspaces, in one tuple behind one address
(`compiler.address`), so that every method takes the same, and a sweep one argument instead of all
arrays. `opened` gives it back with its names; reading by name costs no instruction more than by
position. The columns of the arrays are named in `layout`.
"""

from typing import Any, NamedTuple

from numba import types

from .compiler.address import plain, stored

F1 = types.float64[::1]
F2 = types.float64[:, ::1]
F3 = types.float64[:, :, ::1]
I1 = types.int64[::1]
I2 = types.int64[:, ::1]
i8, f8 = types.int64, types.float64


class Drives(NamedTuple):
    """Springs, dampers and friction of joints, then motors and servos."""

    table: Any  # (nd, 10)
    knots: Any  # (nk, 3) time [s], value, slope after it
    passive: Any  # how many rows of the table are springs and dampers


class Loads(NamedTuple):
    """Forces between two bodies, or on one."""

    loads_i: Any  # (nl, 8)
    loads_f: Any  # (nl, 20)
    knots: Any  # (nk, 7) time [s], torque, force


class Blocks(NamedTuple):
    """Constraints as blocks of up to three rows."""

    blocks_i: Any  # (nb, 8)
    blocks_f: Any  # (nb, 28)
    terms_i: Any  # (nt, 2) of coordinate rows: index into v, index into q or -1
    terms_f: Any  # (nt,) their coefficients
    curves: Any  # (nk, 5) cubics over time
    active: Any  # (nb + 1,) the number of active blocks, then their indices


class Workspace(NamedTuple):
    """Workspace of the constraint kernels.

    w is the most degrees of freedom on the paths of a block; m rows, a multiple of 3.
    """

    y: Any  # (nb, 3 w) what unit multipliers do in each joint
    slots: Any  # (nb, w + 2) number of joints, first row, then their indices into v
    omega: Any  # (m, m) Delassus matrix
    factor: Any  # (m, m) of omega
    place: Any  # (nb, 15) where and along what a block acts
    vectors: Any  # (14, max(m, nq, 3)) rows are named where they are used
    linear: Any  # (n + 1, 3) velocities of origins [m/s]
    carried: Any  # (n + 1, 6) wrenches on their way to the ground
    dips: Any  # (9, 5 + nq + nv) of the pivots of omega in a run; row 0 counts
    nulls: Any  # (m, m) null directions of omega
    where: Any  # (nv,) places of joints in a row of y, from 1; 0: not there
    own: Any  # (nb, 9) a block's part of omega


class Links(NamedTuple):
    """Addresses of a scene's contacts and of the kernels that only some scenes need; 0: none."""

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
    """What a run records, one row a frame."""

    q: Any
    v: Any
    vdot: Any
    wrenches: Any  # of blocks
    energies: Any  # (n, 4) kinetic, potential, work of drives, dissipation [J]
    drifts: Any  # (n, 2) largest residuals of constraints
    pushes: Any  # (n, nb, 6) wrenches of contacts on bodies
    touches: Any  # (n, nt, 8)


class Geometry(NamedTuple):
    """Shapes that can touch; see `layout`."""

    shapes_i: Any
    shapes_f: Any
    vertices: Any
    normals: Any
    faces: Any
    rings: Any
    edges: Any


class Candidates(NamedTuple):
    """What may touch."""

    on_ground: Any  # (ng, 2) shape, contact
    pairs: Any  # (np, 3) shape A, shape B, contact
    members: Any  # (nm, 2) shape, contact: every two members of one contact may touch
    apart: Any  # (nx, 2) bodies a < b, sorted, that may not touch as members


class Search(NamedTuple):
    """Scratch of the search for contact points."""

    room: Any  # (nroom, 5) of one pair
    bounds: Any  # (ns, 6) corners of every shape's box in the world [m]
    cells: Any  # (nm, 5)
    buckets: Any  # (a power of two,) first member of every bucket


class Found(NamedTuple):
    """Contact points."""

    points: Any  # (nmax, 10)
    labels: Any  # (nmax, 4)


class Contacts(NamedTuple):
    """The contacts of a scene, with what they remember from step to step."""

    geometry: Any
    ground: Any
    candidates: Any
    poses: Any
    search: Any
    found: Any
    laws: Any
    kept: Any
    kept_i: Any
    pushes: Any
    touches: Any
    tally: Any
    worst: Any
    bodies_i: Any
    bodies_f: Any
    limit_tau: Any
    stages: Any
    changes: Any


class SiteLinks(NamedTuple):
    """Addresses of the kernels and scenes that a scene with sites is made of."""

    tree: Any  # the equations of motion without sites
    bare: Any  # the same scene without active blocks
    held: Any  # the scene whose active blocks are what is projected
    phased: Any  # the equations of motion with sites
    record: Any  # what records without sites
    observe: Any  # what observes sites
    project: Any  # what projects


class Sites(NamedTuple):
    """Contact points and limits in phases; k slide."""

    links: Any
    sites_i: Any
    sites_f: Any
    every: Any  # every site's S_SLIDE as active blocks
    watched: Any  # (4, 3 ns)
    columns: Any  # (3 k + 2, m) c and the right side, what Ω_BB⁺ makes of them, Ω of the normals
    small: Any  # (3 k + 2, k)
    phases: Any  # (n, ns) of every frame
    frames: Any  # (n, ns, 11)


class Phased(NamedTuple):
    """A scene with sites; `opened` finds the scene alone."""

    scene: Any
    sites: Any


class Walk(NamedTuple):
    """A walking controller; columns in `gait.layout`."""

    rows: Any
    const: Any
    work: Any
    linear: Any
    legs_i: Any
    legs_f: Any
    settings: Any
    waves: Any
    feet: Any
    matrix: Any  # (6, 7)
    q: Any
    v: Any
    tau: Any
    vdot: Any
    limit: Any  # (nv,)
    spine: Any
    fallen: Any
    theirs: Any  # work of the run that asks, after `outboard`; empty where none does


def named(kind: Any, *members: Any) -> Any:
    """The numba type of a named tuple."""
    return types.BaseTuple.from_types(members, kind)


DRIVES = named(Drives, F2, F2, i8)
LOADS = named(Loads, I2, F2, F2)
BLOCKS = named(Blocks, I2, F2, I2, F1, F2, I1)
SPACE = named(Workspace, F2, I2, F2, F2, F2, F2, F2, F2, F2, F2, I1, F2)
USER = named(User, i8, F2, I1)
LINKS = named(Links, *[i8] * 6)
SCENE = named(Scene, I2, F2, DRIVES, LOADS, BLOCKS, F2, SPACE, F1, F1, USER, LINKS)
OUT = plain(named(Frames, F2, F2, F2, F3, F2, F2, F3, F3))
GEOMETRY = named(Geometry, I2, F2, F2, F2, I2, I1, I2)
CANDIDATES = named(Candidates, I2, I2, I2, I2)
SEARCH = named(Search, F2, F2, I2, I1)
FOUND = named(Found, F2, I2)
CONTACTS = named(
    Contacts, GEOMETRY, F2, CANDIDATES, F2, SEARCH, FOUND, F2, F2, I2, F2, F2, I1, F1, I2, F2, F1,
    I1, F2,
)  # fmt: skip
SITES = named(Sites, named(SiteLinks, *[i8] * 7), I2, F2, I1, F2, F2, F2, I2, F3)
PHASED = named(Phased, SCENE, SITES)
WALK = named(Walk, I2, F2, F2, F2, I2, F2, F1, F2, F2, F2, F1, F1, F1, F1, F1, I2, F1, F2)

save, opened = stored(SCENE)
