"""Columns of the packed arrays, a glossary for the kernels with shapes and units.

A *row* is one elementary motion. A joint with several motions has several rows, of which only the
last has mass. A welded body has no row and is merged into the row to which it is fixed. Row 0 is
the ground. Rows are in Pgraph order, so the row of a parent precedes the rows of its children.

Row axes are chosen so that every row is aligned with the world at q = 0: R is the identity there,
and all constants of a row are in world axes at q = 0 ("home axes"). The kernels therefore do not
need the constant rotation of a body frame. R_body = R_row · (its home orientation).
"""

# rows: int64 (n + 1, 6)
PARENT = 0  # row of the parent
KIND = 1  # one of the kinds below
QI = 2  # first index into q
VI = 3  # first index into v
TRACK = 4  # row of `const` where the track of a curve begins
TRACK_ROWS = 5  # number of its rows
ROWS = 6

# kinds of motion, in `motions`; the last one, a state of a control, has the last rows
ROTATE, SCREW, TRANSLATE, BALL, FREE, CURVE, WIRE, STATE = 0, 1, 2, 3, 4, 5, 6, 7

# const: float64 (n + 1 + nt, 32), home axes; behind the motions stand the tracks of curves
AXIS = 0  # 3, unit axis of a motion of one coordinate
LINK = 3  # 3, from the parent row's origin to this row's [m]
MASS = 6  # [kg]
COM = 7  # 3, from the row's origin [m]
INERTIA = 10  # 6, about the centre of mass: xx, yy, zz, xy, xz, yz [kg m^2]
BASE = 16  # 9, home orientation of the parent body: the axes of a ball's or free motion's q, v
ARMATURE = 25  # inertia added to each speed of the motion [kg m^2, kg]
PITCH = 26  # way along the axis of a screw [m/rad]
CONST = 32
# The track of a curve has two rows for each piece, and an end. The first row has the coordinate
# where the piece begins [rad, m] and the displacement, the other one a quaternion of any length.
# Both are polynomials of degree 7 in the way from there, the coefficients of each power together.
TRACK_AT = PIECE_AT = 0  # offset of the address in every function in pieces
TRACK_PLACE = 1  # 24, eight vectors
TRACK_RATE = 25  # first row: 1 / period of a closed curve, or 0 [1/rad, 1/m]
TRACK_TURN = 0  # 32 in the other row, eight quaternions
GRAVITY = 0  # 3, of row 0: gravity in world axes [m/s^2]

# work: float64 (n + 1, 73), world axes, at the row's origin
R = 0  # 9, rotation of the row, row-major
H = 9  # 3, motion axis
L = 12  # 3, link vector from the parent row's origin, displacement included [m]
W = 15  # 3, angular velocity [rad/s]
A = 18  # 6, velocity-dependent acceleration a of eq. (8)
BIAS = ACCELERATION = 24  # 6, bias force b of eq. (12), then the articulated one, then V'
IA = 30  # 21, lower triangle of the 6x6 inertia by rows, then its factor for a free motion
# 6: U = I h, articulated inertia times axis; of a ball the factor of its 3x3 block; of a free
# motion what its factor is solved for. Where nothing is solved: velocity of the origin, or force
PROJECTED = FACTOR3 = SOLVED = VELOCITY = FORCE = 51
D = 57  # inverse of the inertia about the axis
ADDED = 57  # armature of a ball or a free motion
KEPT = 57  # for row 0: 1 if q and armatures are those of the frames and articulated inertias
COUNTS = 57  # share of a point that rides which counts in its path
LEFT = 58  # 3, remaining joint force u = τ - Hᵀb, for a ball in world axes
ANGLE = 58  # 2, sine and cosine of a rotation, before that
X = 61  # 3, position of the origin [m] (only where something needs it)
SLIDE = 64  # 3, linear part of the motion axis of a screw or curve [m/rad, 1]
AXIS_SLOPE = 67  # 6, slope of the motion axis of a curve, angular and linear
WORK = 73

# bodies_i: int64 (nb + 1, 12); by number, 0 is the ground; a table's rows count from 1
ROW = 0  # the row that carries the body
BODY_PARENT = 1  # number of the parent body
TABLE = 2  # the table's row of the body
DOF = 3  # degrees of freedom of its joint
OWN_ROWS = 4  # number of rows of its joint, one for the ground
# and by the table's row
BODY_NUMBER = 5  # number of the body
CHILD, NEXT = 6, 7  # rows of the first child and of the next sibling, 0 = none
# first entries of the joint in the table's order
FIRST_MOTION, FIRST_Q, FIRST_V, FIRST_TRACK = 8, 9, 10, 11
BODIES_I = 12

# bodies_f: float64 (nb + 1, 22), home axes
OFFSET = 0  # 3, from the row's origin to the body's [m]
HOME = 3  # 9, home orientation of the body, row-major
B_MASS = 12
B_COM = 13  # 3, from the body's origin
B_INERTIA = 16  # 6
BODY = 22

# knots: float64 (nk, 4): time [s], value, slope after it, or of a table's last one knots a second;
# what acts there of an input with a lag or an integral

# -- constraint blocks ----------------------------------------------------------------------------
# A constraint is one or two blocks of up to three rows; x is the place of a block's point.

# blocks_i: int64 (nb, 9)
B_TYPE = 0  # one of the types below
B_A, B_B = 1, 2  # rows of `body` and `other`, 0 for the ground
B_SIZE = 3  # number of rows, 1 to 3
B_TERM, B_TERMS = 4, 5  # first entry and number of entries in terms
B_CURVE, B_KNOTS = (6, 7)  # first knot, number of knots: 0 for VALUE, or a kind of curve
B_BODY_A, B_BODY_B = 6, 7  # numbers of `body` and `other` of a span, which has no curve
B_STATION, B_STATIONS = 6, 7  # first station and number of stations of a cable, which has none
B_CHAIN = 8  # number of blocks before it in a chain of a cable, whose laws need its tension
BLOCK_I = 9

# blocks_f: float64 (nb, 40); points and directions in the home axes of their rows
PA = 0  # 3, point of A, from its row's origin [m]
PB = 3  # 3, point of B, in world axes if B is the ground
DIR = 6  # 9, up to three directions fixed in B, one after the other
AIM = 15  # 9, up to three directions fixed in A
VALUE = 24  # length, radius [m], offset [rad, m], or velocity [rad/s, m/s]
WRAP_FALL, WRAP_RISE = 6, 7  # bounds of a change of tension, relative to the tension before it
# of a curve, whose DIR is a direction that it never has
WAY, KNOWN = 9, 10  # last place of a point on its curve [m, or as its functions], 1 if it is known
GRAIN = 11  # before the last steps of a search, the way is a whole multiple of this
REACH = 12  # distance from the curve beyond which a point is sought along all of it [m]
FRICTION, BOUNCE = 25, 26  # Coulomb's coefficient; restitution of a contact, or of an impact now
SIZE = 27  # scale of the gaps of a limit [rad, m]
ROUND = 27  # radius of A about a contact point on a plane of B [m], negative if it is no ball
REBOUND = 16  # restitution of a limit
HELD = 16  # force of a joint's friction in the last step [N m, N]
LOCATED = 17  # gap of a limit from which its impact was last located within this step [rad, m]
SURFACE = 18  # 3, velocity [m/s] or spin [rad/s] of A's surface past B's along DIR at a contact
ROOM = 22  # speed at which a unilateral block closes to its tolerated depth in a step [m/s, rad/s]
SETTLED = 21  # whether the λ of a contact is of least norm: TRANSIENT, LEAST_NORM or DUE
# of a constraint in time stepping, on `body` at PA in world axes
PULL = 28  # 6, impulse of the last step [N m s, N s]
MEAN_PULL = 34  # 6, mean wrench since the last frame [N m, N]
BLOCK_F = 40

T_POINT = 0  # DIR_r · (x_A - x_B) = 0
T_ALIGN = 1  # AIM_r · DIR_r = 0, one of them as long as the model, so residuals are in m
T_DISTANCE = 2  # |x_A - x_B| = VALUE
T_BLADE = 3  # AIM_0 · velocity of A's point against B = 0
T_ROUND = 4  # an ellipsoid with semi-axes AIM_r about x_A rolls on the plane through x_B normal to
# DIR_0: its gap, then the slip along DIR_1 and DIR_2. One semi-axis of a thin disc is zero
T_PIN = 5  # x_A = x_B, along the axes of the world
T_COORD = 6  # Σ coefficient q = VALUE, or the curve at t
T_VELOCITY = 7  # Σ coefficient v = VALUE
T_LIMIT = 8  # Σ coefficient q - VALUE ≥ 0, unilateral; in AIM the speed at which it may close
T_CONTACT = (
    9  # a unilateral contact point with PA and DIR in the world, DIR the normal and both tangents
)

T_SPAN = 11  # unilateral sign(VALUE) |x_A - x_B| - VALUE ≥ 0, with AIM the speed at which it may
# close in this step [m/s]
T_FRICTION = 12  # dry friction of Σ coefficient v: at most VALUE [N m, N], AIM an impulse in a part
T_RELATION = 13  # q = f(q') of two coordinates, with f by `curves`
T_CURVE = 14  # x_A stays on a curve of B, by `curves`, along two normals of its tangent
T_CABLE = 15  # the length of a segment of a cable = VALUE, see `cables`
# unilateral VALUE - length of a segment of a cable ≥ 0, with AIM the speed at which it may close
T_SLACK = 16
# friction of a cable on a wheel, between WRAP_FALL and WRAP_RISE: λ is the change of its tension
# there, from the sum of the λ before it in its chain; its stations are those from the wheel on
T_WRAP = 17
T_TURN = 10  # resistance to turning at a contact point: torques along DIR, within bounds

# terms_i: int64 (nt, 2): index into v, index into q or -1; terms_f: float64 (nt,): coefficients

# curves: float64 (nk, 10): time of a knot [s], then c0, c1, c2, c3 of c0 + c1 s + c2 s² + c3 s³
# from there on, s = t - knot; the first piece holds for all times before it and the last one for
# all after it, which are constants where they bound a table. With B_KNOTS = SINE the only row is
# mean, amplitude, frequency [rad/s], phase: mean + amplitude sin(frequency t + phase)
SINE = -1
# With B_KNOTS < SINE the rows are a program of time, of -1 - B_KNOTS instructions, as in
# `signals.py`, of which the last one is the value. The function of a relation is such a program, of
# q' in place of the time, or pieces and their end, with polynomials of degree 7 and 1 / period. The
# curve of a point has three such rows for each piece, x, y and z, and an end
PIECE_POWERS = 1  # 8; the value at the end is in the first one of its row
PIECE_RATE = 9
KNOT = 10

# active: int64 (nb + 1,): the number of active blocks, then their indices

# of `Workspace.place` and `Workspace.slots`
PLACE_P, PLACE_D, PLACE_Q = 0, 3, 12  # 3 on A, 9, 3 on B
PLACE_TURN = 9  # 3, turning of the normals of a curve by way along its tangent [1/m]
PLACE = 15
PLACE_VALUE, PLACE_SLOPE, PLACE_BEND = 0, 1, 2  # f, f' and f'' of a relation now
SLOTS, FIRST, SLOT = 0, 1, 2

# load_knots: float64 (nk, 7): time [s], torque 3, force 3

# ledger: float64 (2,): work of drives and given torques, dissipation [J]
WORK_DONE, DISSIPATED = 0, 1

# status codes of a run
DONE, NOT_FINITE, NOT_CONVERGED, RUNNING = 0, 1, 2, 3
TOO_SMALL, TOO_MANY, NOT_SOLVED, EVENT, NEAR = 4, 5, 6, 7, 8

# -- runs -----------------------------------------------------------------------------------------
# y = q, v, work done, dissipation [rad, m, 1; rad/s, m/s; J]: a row of `Run.stages`
Y, Y_OLD, END = 0, 1, 2  # the state, that before the last step, Y while that step is repeated
SLOPE, CANDIDATE = 3, 4  # v' and power at Y, the state that a step proposes
FROM, ERROR, WEIGHT = 5, 6, 7  # base of the stages, error of CANDIDATE, 1 / tolerance
TRIAL, TORQUE = 8, 9  # a trial state, joint forces
OBSERVED, RATE_CHANGE = 10, 11  # v' for monitors, change of y' in a step
BRANCHES = 12  # difference of the states of both branches of a comparison
# of a part of a time step: the state before, added inertia, the middle of its velocities
PART_BEFORE, PART_DAMPING, PART_MIDDLE = 13, 14, 15
# of its derivatives: times, the width of the last part of the step before, slope of forces in time,
# the state where a part begins, and the one that waits while a path is followed
PART_TIMES, LAST_WIDTH, FORCE_SLOPE, PART_START, WAITING = 16, 17, 18, 19, 20
AT_LIMITS = 21  # a state to be looked at, with coordinates at their closed limits
BENT = 22  # by how much constraints change v' on the way to an impact
# v before constraints were switched last, the time of that [s], and whether this WAITS for the next
# step or has ACTED in the last one
UNSWITCHED = 23
STAGE = 24  # the stages of the method from here on
