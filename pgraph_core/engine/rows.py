"""Named access to a row of the tree: its indices, its constants and its part of the workspace.

The columns of `rows`, `const` and `work` are defined in `layout`, and the kernels of the tree only
use their names. All functions are inlined, work for numbers and lanes, and cost the same as an
index. Columns may be overwritten by later sweeps, so names indicate which content is read.
"""

from . import layout as at
from .compiler.jit import part
from .vec import accumulate, add, add_cross, cross, load, load6, load9, mul, store, store9, sub

# -- what stands in columns: a function that reads them, then functions that write them ------------


def number(column):
    """Return functions that read and write a column."""

    @part
    def get(table, k):
        return table[k, column]

    @part
    def put(table, k, x):
        table[k, column] = x

    return get, put


def vector(column):
    """Return functions that read and write three columns."""

    @part
    def get(table, k):
        return load(table, k, column)

    @part
    def put(table, k, x):
        store(table, k, column, x)

    return get, put


def whole_matrix(column):
    """Return functions that read and write the nine columns of a 3x3 matrix."""

    @part
    def get(table, k):
        return load9(table, k, column)

    @part
    def put(table, k, x):
        store9(table, k, column, x)

    return get, put


def pair(column):
    """Return functions that read, write and increase (angular, linear), as (moment, force)."""

    @part
    def get(table, k):
        return load(table, k, column), load(table, k, column + 3)

    @part
    def put(table, k, angular, linear):
        store(table, k, column, angular)
        store(table, k, column + 3, linear)

    @part
    def increase(table, k, angular, linear):
        accumulate(table, k, column, angular)
        accumulate(table, k, column + 3, linear)

    return get, put, increase


# -- place in the tree ----------------------------------------------------------------------------

parent_of, set_parent = number(at.PARENT)
kind_of, set_kind = number(at.KIND)
q_of, set_q = number(at.QI)  # first index into q
v_of, set_v = number(at.VI)  # first index into v
track_of, set_track = number(at.TRACK)  # first row of a curve's track in the constants
track_rows_of, set_track_rows = number(at.TRACK_ROWS)


@part
def set_row(rows, k, parent, kind, q, v, track, track_rows):
    set_parent(rows, k, parent)
    set_kind(rows, k, kind)
    set_q(rows, k, q)
    set_v(rows, k, v)
    set_track(rows, k, track)
    set_track_rows(rows, k, track_rows)


# -- constants, home axes -------------------------------------------------------------------------

home_axis, set_home_axis = vector(at.AXIS)
home_link, set_home_link = vector(at.LINK)  # from the parent row's origin [m]
home_base, set_home_base = whole_matrix(at.BASE)  # parent's orientation: axes of a ball's q and v
home_pitch, set_home_pitch = number(at.PITCH)  # way along the axis of a screw [m/rad]
armature_of, set_armature = number(at.ARMATURE)


@part
def gravity_of(const):
    return load(const, 0, at.GRAVITY)


@part
def set_gravity(const, gravity):
    store(const, 0, at.GRAVITY, gravity)


@part
def set_motion(const, k, axis, link, base, armature, pitch):
    set_home_axis(const, k, axis)
    set_home_link(const, k, link)
    set_home_base(const, k, base)
    set_armature(const, k, armature)
    set_home_pitch(const, k, pitch)


@part
def mass_of(const, k):
    """Return (mass, centre of mass from the row's origin, inertia about that centre)."""
    return const[k, at.MASS], load(const, k, at.COM), load6(const, k, at.INERTIA)


@part
def set_mass(const, k, mass, com, inertia):
    const[k, at.MASS] = mass
    store(const, k, at.COM, com)
    store(const, k, at.INERTIA, inertia[:3])
    store(const, k, at.INERTIA + 3, inertia[3:])


# -- workspace, world axes at the row's origin ----------------------------------------------------

rotation_of, set_rotation = whole_matrix(at.R)
axis_of, set_axis = vector(at.H)
link_of, set_link = vector(at.L)  # from the parent row's origin, with displacement [m]
spin_of, set_spin = vector(at.W)  # angular velocity [rad/s]
origin_of, set_origin = vector(at.X)  # position of the origin [m], after `positions`
velocity_of, set_velocity = vector(at.VELOCITY)  # origin velocity [m/s], as stored by a sweep
coriolis_of, set_coriolis, _ = pair(at.A)  # a of eq. (8)
bias_of, set_bias, add_bias = pair(at.BIAS)  # b of eq. (12), articulated after the inboard sweep
# V' of eq. (8) with gravity's -g, stored over the bias
acceleration_of, set_acceleration, _ = pair(at.ACCELERATION)
force_of, set_force, add_force = pair(at.FORCE)  # F of eq. (12), transmitted by the joint
projected_of, set_projected, _ = pair(at.PROJECTED)  # U = I h of a hinge, with articulated I
solved_of, set_solved, _ = pair(at.SOLVED)  # the solution from a free motion's factor
slide_of, set_slide = vector(at.SLIDE)  # linear part of the motion axis of a screw or curve
bend_of, set_bend, _ = pair(at.AXIS_SLOPE)  # slope of a curve's motion axis
inverse_pivot_of, set_inverse_pivot = number(at.D)  # 1 / (hᵀ U + armature) of a hinge
added_of, set_added = number(at.ADDED)  # armature of a ball or a free motion
kept_of, set_kept = number(at.KEPT)  # for row 0 alone, see `layout`
counts_of, set_counts = number(at.COUNTS)  # share of a rider, see `riders`
left_of, set_left = number(at.LEFT)  # u = τ - hᵀ b of a hinge


@part
def sine_cosine_of(work, k):
    """Return the sine and cosine of a rotation's angle, valid until the inboard sweep."""
    return work[k, at.ANGLE], work[k, at.ANGLE + 1]


@part
def set_sine_cosine(work, k, sine, cosine):
    work[k, at.ANGLE] = sine
    work[k, at.ANGLE + 1] = cosine


@part
def ball_of(work, k):
    """Return (factor of the 3x3 block, u in world axes) for a ball."""
    return load6(work, k, at.FACTOR3), load(work, k, at.LEFT)


@part
def set_factor(work, k, factor):
    store(work, k, at.FACTOR3, factor[:3])
    store(work, k, at.FACTOR3 + 3, factor[3:])


@part
def set_ball_left(work, k, left):
    store(work, k, at.LEFT, left)


@part
def inertia_of(work, k):
    """Compute (j, b, m) of the 6x6 inertia [j b, bᵀ m], stored as its lower triangle by rows."""
    i = at.IA
    j = (
        work[k, i], work[k, i + 2], work[k, i + 5],
        work[k, i + 1], work[k, i + 3], work[k, i + 4],
    )  # fmt: skip
    b = (
        work[k, i + 6], work[k, i + 10], work[k, i + 15],
        work[k, i + 7], work[k, i + 11], work[k, i + 16],
        work[k, i + 8], work[k, i + 12], work[k, i + 17],
    )  # fmt: skip
    m = (
        work[k, i + 9], work[k, i + 14], work[k, i + 20],
        work[k, i + 13], work[k, i + 18], work[k, i + 19],
    )  # fmt: skip
    return j, b, m


@part
def triangle(j, b, m):
    """Return the lower triangle of [j b, bᵀ m] by rows."""
    return (
        j[0],
        j[3], j[1],
        j[4], j[5], j[2],
        b[0], b[3], b[6], m[0],
        b[1], b[4], b[7], m[3], m[1],
        b[2], b[5], b[8], m[4], m[5], m[2],
    )  # fmt: skip


@part
def set_inertia(work, k, j, b, m):
    i = at.IA
    x = triangle(j, b, m)
    store(work, k, i, x[:3])
    store(work, k, i + 3, x[3:6])
    store(work, k, i + 6, x[6:9])
    store(work, k, i + 9, x[9:12])
    store(work, k, i + 12, x[12:15])
    store(work, k, i + 15, x[15:18])
    store(work, k, i + 18, x[18:])


@part
def add_inertia(work, k, j, b, m):
    i = at.IA
    x = triangle(j, b, m)
    accumulate(work, k, i, x[:3])
    accumulate(work, k, i + 3, x[3:6])
    accumulate(work, k, i + 6, x[6:9])
    accumulate(work, k, i + 9, x[9:12])
    accumulate(work, k, i + 12, x[12:15])
    accumulate(work, k, i + 15, x[15:18])
    accumulate(work, k, i + 18, x[18:])


@part
def traces_of(work, k):
    """Return the (angular, linear) magnitudes of the inertia, to which its rounding is relative."""
    i = at.IA
    angular = work[k, i] + work[k, i + 2] + work[k, i + 5]
    return angular, work[k, i + 9] + work[k, i + 14] + work[k, i + 20]


# -- bodies: by number, 0 is the ground; home axes ------------------------------------------------

carrier_of, _ = number(at.ROW)  # the row that carries a body
offset_of, set_offset = vector(at.OFFSET)  # from that row's origin to the body's [m]
home_of, set_home = whole_matrix(at.HOME)  # home orientation


@part
def body_mass_of(bodies_f, b):
    """Return (mass, centre of mass from the body's origin, inertia about that centre)."""
    return bodies_f[b, at.B_MASS], load(bodies_f, b, at.B_COM), load6(bodies_f, b, at.B_INERTIA)


@part
def set_body(bodies_f, b, offset, home, mass, com, inertia):
    set_offset(bodies_f, b, offset)
    set_home(bodies_f, b, home)
    bodies_f[b, at.B_MASS] = mass
    store(bodies_f, b, at.B_COM, com)
    store(bodies_f, b, at.B_INERTIA, inertia[:3])
    store(bodies_f, b, at.B_INERTIA + 3, inertia[3:])


# -- points that are fixed in a row ---------------------------------------------------------------


@part
def point_of(local, work, k):
    """Return the world position of a point fixed in row k."""
    return add(origin_of(work, k), mul(rotation_of(work, k), local))


@part
def point_velocity(work, linear, k, p):
    """Return the velocity of the material point of row k at p."""
    return add_cross(load(linear, k, 0), spin_of(work, k), sub(p, origin_of(work, k)))


@part
def point_acceleration(work, k, p):
    """Return V' of row k from the sweeps, transformed to its material point at p (R6)."""
    r = sub(p, origin_of(work, k))
    w = spin_of(work, k)
    alpha, linear = acceleration_of(work, k)
    linear = add_cross(linear, alpha, r)
    return add(linear, cross(w, cross(w, r)))
