"""Named access to a row of the tree: its indices, its constants and its part of the workspace.

The columns of `rows`, `const` and `work` are in `layout`; no kernel of the tree counts them. All
parts are inlined, take numbers or lanes, and cost what an index costs. What a sweep leaves in a
column, a later one may write over: the names say which of its meanings is read.
"""

from . import layout as at
from .compiler.jit import part
from .vec import accumulate, add, add_cross, load, load6, load9, mul, store, store9, sub

ROTATE, SCREW, TRANSLATE, BALL, FREE = at.ROTATE, at.SCREW, at.TRANSLATE, at.BALL, at.FREE

# -- place in the tree ----------------------------------------------------------------------------


@part
def parent_of(rows, k):
    return rows[k, at.PARENT]


@part
def kind_of(rows, k):
    return rows[k, at.KIND]


@part
def q_of(rows, k):
    """Return the first index into q."""
    return rows[k, at.QI]


@part
def v_of(rows, k):
    """Return the first index into v."""
    return rows[k, at.VI]


@part
def set_row(rows, k, parent, kind, q, v):
    rows[k, at.PARENT] = parent
    rows[k, at.KIND] = kind
    rows[k, at.QI] = q
    rows[k, at.VI] = v


@part
def nv_of(kind):
    """Return the number of degrees of freedom of a row."""
    return 1 if kind <= TRANSLATE else 3 if kind == BALL else 6


@part
def nq_of(kind):
    """Return the number of coordinates of a row, with spatial rotations as quaternions."""
    return 1 if kind <= TRANSLATE else 4 if kind == BALL else 7


# -- constants, home axes -------------------------------------------------------------------------


@part
def home_axis(const, k):
    return load(const, k, at.AXIS)


@part
def home_link(const, k):
    """Return the vector from the parent row's origin [m]."""
    return load(const, k, at.LINK)


@part
def home_base(const, k):
    """Return the parent body's orientation, the axes of a ball's or free motion's q and v."""
    return load9(const, k, at.BASE)


@part
def set_motion(const, k, axis, link, base, armature, pitch):
    store(const, k, at.AXIS, axis)
    store(const, k, at.LINK, link)
    store9(const, k, at.BASE, base)
    const[k, at.ARMATURE] = armature
    const[k, at.PITCH] = pitch


@part
def home_pitch(const, k):
    """Way along the axis of a screw [m/rad]."""
    return const[k, at.PITCH]


@part
def armature_of(const, k):
    return const[k, at.ARMATURE]


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


@part
def gravity_of(const):
    return load(const, 0, at.GRAVITY)


@part
def set_gravity(const, gravity):
    store(const, 0, at.GRAVITY, gravity)


# -- workspace, world axes at the row's origin ----------------------------------------------------


@part
def rotation_of(work, k):
    return load9(work, k, at.R)


@part
def set_rotation(work, k, r):
    store9(work, k, at.R, r)


@part
def axis_of(work, k):
    return load(work, k, at.H)


@part
def set_axis(work, k, h):
    store(work, k, at.H, h)


@part
def link_of(work, k):
    """Return the vector from the parent row's origin, including displacement [m]."""
    return load(work, k, at.L)


@part
def set_link(work, k, link):
    store(work, k, at.L, link)


@part
def spin_of(work, k):
    """Angular velocity [rad/s]."""
    return load(work, k, at.W)


@part
def set_spin(work, k, w):
    store(work, k, at.W, w)


@part
def origin_of(work, k):
    """Return the position of the origin [m], after `positions`."""
    return load(work, k, at.X)


@part
def set_origin(work, k, x):
    store(work, k, at.X, x)


@part
def coriolis_of(work, k):
    """Return a of eq. (8) as (angular, linear)."""
    return load(work, k, at.A), load(work, k, at.A + 3)


@part
def set_coriolis(work, k, angular, linear):
    store(work, k, at.A, angular)
    store(work, k, at.A + 3, linear)


@part
def sine_cosine_of(work, k):
    """Return the sine and cosine of a rotation's angle, valid until the inboard sweep."""
    return work[k, at.ANGLE], work[k, at.ANGLE + 1]


@part
def set_sine_cosine(work, k, sine, cosine):
    work[k, at.ANGLE] = sine
    work[k, at.ANGLE + 1] = cosine


@part
def bias_of(work, k):
    """Return b of eq. (12) as (moment, force), articulated after the inboard sweep."""
    return load(work, k, at.BIAS), load(work, k, at.BIAS + 3)


@part
def set_bias(work, k, moment, force):
    store(work, k, at.BIAS, moment)
    store(work, k, at.BIAS + 3, force)


@part
def add_bias(work, k, moment, force):
    accumulate(work, k, at.BIAS, moment)
    accumulate(work, k, at.BIAS + 3, force)


@part
def acceleration_of(work, k):
    """Return V' of eq. (8) with gravity's -g as (angular, linear), stored over the bias."""
    return load(work, k, at.ACCELERATION), load(work, k, at.ACCELERATION + 3)


@part
def set_acceleration(work, k, angular, linear):
    store(work, k, at.ACCELERATION, angular)
    store(work, k, at.ACCELERATION + 3, linear)


@part
def force_of(work, k):
    """Return F of eq. (12), transmitted by the joint, as (moment, force)."""
    return load(work, k, at.FORCE), load(work, k, at.FORCE + 3)


@part
def set_force(work, k, moment, force):
    store(work, k, at.FORCE, moment)
    store(work, k, at.FORCE + 3, force)


@part
def add_force(work, k, moment, force):
    accumulate(work, k, at.FORCE, moment)
    accumulate(work, k, at.FORCE + 3, force)


@part
def velocity_of(work, k):
    """Return the velocity of the origin [m/s], as stored by a sweep."""
    return load(work, k, at.VELOCITY)


@part
def set_velocity(work, k, velocity):
    store(work, k, at.VELOCITY, velocity)


@part
def projected_of(work, k):
    """Return U = I h of a rotation or translation, with articulated I, as (angular, linear)."""
    return load(work, k, at.PROJECTED), load(work, k, at.PROJECTED + 3)


@part
def pitch_of(work, k):
    """Way along the axis of a screw [m/rad], from the first sweep."""
    return work[k, at.ADVANCE]


@part
def set_pitch(work, k, pitch):
    work[k, at.ADVANCE] = pitch


@part
def inverse_pivot_of(work, k):
    """Return 1 / (hᵀ U + armature) for a rotation or translation."""
    return work[k, at.D]


@part
def left_of(work, k):
    """Return u = τ - hᵀ b for a rotation or translation."""
    return work[k, at.LEFT]


@part
def set_hinge(work, k, angular, linear, pivot, left):
    """Store U, 1 / (hᵀ U + armature) and u."""
    store(work, k, at.PROJECTED, angular)
    store(work, k, at.PROJECTED + 3, linear)
    work[k, at.D] = pivot
    work[k, at.LEFT] = left


@part
def ball_of(work, k):
    """Return (factor of the 3x3 block, u in world axes) for a ball."""
    return load6(work, k, at.FACTOR3), load(work, k, at.LEFT)


@part
def set_ball(work, k, factor, left):
    store(work, k, at.FACTOR3, factor[:3])
    store(work, k, at.FACTOR3 + 3, factor[3:])
    store(work, k, at.LEFT, left)


@part
def solved_of(work, k):
    """Return the solution from a free motion's factor as (angular, linear)."""
    return load(work, k, at.SOLVED), load(work, k, at.SOLVED + 3)


@part
def set_solved(work, k, angular, linear):
    store(work, k, at.SOLVED, angular)
    store(work, k, at.SOLVED + 3, linear)


@part
def inertia_of(work, k):
    """Return (j, b, m) of the 6x6 inertia [j b, bᵀ m], stored as its lower triangle by rows."""
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


@part
def carrier_of(bodies_i, b):
    """Return the row that carries body b."""
    return bodies_i[b, at.ROW]


@part
def offset_of(bodies_f, b):
    """Return the vector from the carrying row's origin to the body's origin [m]."""
    return load(bodies_f, b, at.OFFSET)


@part
def home_of(bodies_f, b):
    """Return the home orientation of body b."""
    return load9(bodies_f, b, at.HOME)


@part
def body_mass_of(bodies_f, b):
    """Return (mass, centre of mass from the body's origin, inertia about that centre)."""
    return bodies_f[b, at.B_MASS], load(bodies_f, b, at.B_COM), load6(bodies_f, b, at.B_INERTIA)


@part
def set_body(bodies_f, b, offset, home, mass, com, inertia):
    store(bodies_f, b, at.OFFSET, offset)
    store9(bodies_f, b, at.HOME, home)
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
