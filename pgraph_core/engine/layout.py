"""The columns of the packed arrays: the glossary of the kernels, with shapes and units.

A *row* is one elementary motion. A body whose joint has several motions has several rows, all
but the last without mass; a welded body has none: it is merged into the row that carries it.
Row 0 is the ground; rows stand in Pgraph order, so a parent's row comes before its children's.

Row axes are chosen so that every row is aligned with the world at q = 0: R is the identity
there, and all constants of a row are in world axes at q = 0 ("home axes"). That takes the
constant rotation of a body frame out of the kernels. R_body = R_row · (its home orientation).
"""

# rows: int64 (n + 1, 4)
PARENT = 0  # row of the parent
KIND = 1  # one of the four kinds below
QI = 2  # first index into q
VI = 3  # first index into v

ROTATE, TRANSLATE, BALL, FREE = 0, 1, 2, 3  # kinds of motion

# const: float64 (n + 1, 28), home axes
AXIS = 0  # 3, unit axis of a rotate or translate motion
LINK = 3  # 3, from the parent row's origin to this row's [m]
MASS = 6  # [kg]
COM = 7  # 3, from the row's origin [m]
INERTIA = 10  # 6, about the centre of mass: xx, yy, zz, xy, xz, yz [kg m^2]
BASE = 16  # 9, home orientation of the parent body: the axes of a ball's or free motion's q, v
ARMATURE = 25  # added inertia about the axis [kg m^2, kg]
CONST = 28
GRAVITY = 0  # 3, of row 0: gravity in world axes [m/s^2]

# work: float64 (n + 1, 64), world axes, at the row's origin; 8 cache lines a row
R = 0  # 9, rotation of the row, row-major
H = 9  # 3, motion axis
L = 12  # 3, link vector from the parent row's origin, displacement included [m]
W = 15  # 3, angular velocity [rad/s]
A = 18  # 6, velocity-dependent acceleration a of eq. (8)
P = 24  # 6, bias force b of eq. (12), then the articulated one; then the acceleration V'
IA = 30  # 21, lower triangle of the 6x6 inertia, row by row; then its factor for a free motion
U = 51  # 6, articulated inertia times axis; for a ball: the factor of its 3x3 block
D = 57  # inverse of the inertia about the axis
UU = 58  # 3, what is left of the joint force: u = τ - Hᵀp; for a ball in world axes
X = 61  # 3, position of the origin [m] (only where something needs it)
WORK = 64

# bodies_i: int64 (nb + 1, 11); by number, 0 is the ground; a table's rows count from 1
ROW = 0  # the row that carries the body
BODY_PARENT = 1  # number of the parent body
TABLE = 2  # the table's row of the body
DOF = 3  # degrees of freedom of its joint
OWN_ROWS = 4  # how many rows its joint has; the ground has one
# and by the table's row
NUMBER = 5  # of the body
CHILD, NEXT = 6, 7  # rows of the first child and of the next sibling, 0 = none
FIRST_MOTION, FIRST_Q, FIRST_V = 8, 9, 10  # of the joint, in the table's order
BODIES_I = 11

# bodies_f: float64 (nb + 1, 22), home axes
OFFSET = 0  # 3, from the row's origin to the body's [m]
HOME = 3  # 9, home orientation of the body, row-major
B_MASS = 12
B_COM = 13  # 3, from the body's origin
B_INERTIA = 16  # 6
BODY = 22

# drives: float64 (nd, 10): torque = clamp(kp (target(t) - q) - kd v + torque(t)) - friction sign(v)
# springs, dampers and friction of joints come first, then motors and servos
DR_V, DR_Q = 0, 1  # indices into v and q (-1: no position)
DR_KP, DR_KD, DR_LIMIT = 2, 3, 4
DR_TARGET, DR_TARGET_N = 5, 6  # first knot and number of knots of the target
DR_TORQUE, DR_TORQUE_N = 7, 8
DR_FRICTION = 9  # [N m, N]
DRIVE = 10
CREEP = 1e-3  # rad/s, m/s: friction is regularised as v / √(v² + creep²)
# knots: float64 (nk, 3): time [s], value, slope after it; of a table's last one, knots a second

# -- constraint blocks -----------------------------------------------------------------------------
# A constraint is one or two blocks of up to three rows; x is the place of a block's point.

# blocks_i: int64 (nb, 8)
B_TYPE = 0  # one of the eight types below
B_A, B_B = 1, 2  # rows of `body` and `other`; 0 is the ground
B_SIZE = 3  # number of rows, 1 to 3
B_TERM, B_TERMS = 4, 5  # first entry and number of entries in terms
B_CURVE, B_KNOTS = 6, 7  # first knot and number of knots in curves; 0 knots: VALUE, SINE: a sine
BLOCK_I = 8

# blocks_f: float64 (nb, 28); points and directions in the home axes of their rows
PA = 0  # 3, point of A, from its row's origin [m]
PB = 3  # 3, point of B; of the ground in the world
DIR = 6  # 9, up to three directions fixed in B, one after the other
AIM = 15  # 9, up to three directions fixed in A
VALUE = 24  # length, radius [m], offset [rad, m], or velocity [rad/s, m/s]
FRICTION, BOUNCE = 25, 26  # of a contact or limit: Coulomb's coefficient, restitution
BLOCK_F = 28

T_POINT = 0  # DIR_r · (x_A - x_B) = 0
T_ALIGN = 1  # AIM_r · DIR_r = 0; one of the two is as long as the model is large: residuals in m
T_DISTANCE = 2  # |x_A - x_B| = VALUE
T_BLADE = 3  # AIM_0 · velocity of A's point against B = 0
T_SPHERE = 4  # a sphere of radius VALUE about x_A rolls on the plane through x_B normal to DIR_0;
# three rows: its gap, then the slip along DIR_1 and DIR_2
T_DISC = 5  # the same for a thin disc with the axis AIM_0
T_COORD = 6  # Σ coefficient q = VALUE, or the curve at t
T_VELOCITY = 7  # Σ coefficient v = VALUE
T_LIMIT = 8  # Σ coefficient q - VALUE ≥ 0, unilateral
T_CONTACT = (
    9  # a contact point: PA in the world, DIR in the world: normal, two tangents; unilateral
)

# terms_i: int64 (nt, 2): index into v, index into q or -1; terms_f: float64 (nt,): coefficients

# curves: float64 (nk, 5): time of a knot [s], then c0, c1, c2, c3 of c0 + c1 s + c2 s² + c3 s³ from
# there on, s = t - knot; before the first knot s = 0; the last piece goes on for ever (constant
# where it ends a table). With B_KNOTS = SINE the only row is mean, amplitude, frequency [rad/s],
# phase: mean + amplitude sin(frequency t + phase)
SINE = -1

# active: int64 (nb + 1,): the number of active blocks, then their indices

# space of the constraint kernels, float64; w: most degrees of freedom on the paths of a block
# y (nb, 3 w): what unit multipliers do in each joint; place (nb, 15): where and along what
# omega, factor, nulls (m, m), m a multiple of 3; vectors (14, max(m, nq, 3))
# linear (n + 1, 3): velocities of origins
# whole (n + 1, 6): wrenches on their way to the ground
# dips (9, 5 + nq + nv): of the pivots of Ω in a run; row 0 counts, the others are the first ones
# own (nb, 9): a block's part of omega
# slots, int64 (nb, w + 2): number of joints, first row, then their indices into v
PLACE_P, PLACE_D, PLACE_Q = 0, 3, 12  # 3 on A, 9, 3 on B
PLACE = 15
SLOTS, FIRST, SLOT = 0, 1, 2
DIP_DEPTH, DIP_TIME, DIP_APART, DIP_STATE = 0, 1, 2, 3  # largest pivot over it; of the deepest
# place: its time, time since the evaluation before [s], q and v; of row 0: of the last evaluation
DIP_COUNT, DIP_ROWS, DIP_INSIDE = 0, 3, 4  # of row 0: dips, rows to watch, whether one is under way
DIPS = 9

# loads: forces between two bodies, or on one; loads_i: int64 (nl, 8)
L_TYPE, L_A, L_B, L_FRAME, L_KNOT, L_KNOTS = 0, 1, 2, 3, 4, 5
WRENCH, SPRING, TORSION = 0, 1, 2
# loads_f: float64 (nl, 20), home axes of the rows
L_PA, L_PB = 0, 3  # 3 each
L_AXIS, L_REF, L_REF_B = 6, 9, 12  # 3 each: axis and a perpendicular in A, and one in B
L_STIFF, L_DAMP, L_REST = 15, 16, 17
LOAD_I, LOAD_F = 8, 20
# load_knots: float64 (nk, 7): time [s], torque 3, force 3

# ledger: float64 (2,): work of drives and given torques, dissipation [J]
WORK_DONE, DISSIPATED = 0, 1

# status codes of a run
DONE, NOT_FINITE, NOT_CONVERGED, RUNNING = 0, 1, 2, 3
TOO_SMALL, TOO_MANY, NOT_SOLVED, EVENT = 4, 5, 6, 7

# -- adaptive runs -----------------------------------------------------------------------------
# y = q, v, work done, dissipation [rad, m, 1; rad/s, m/s; J]: a row of `stages`
Y, Y_OLD, SLOPE, CANDIDATE = 0, 1, 2, 3  # state, the one before the last step, y' at Y, the next
ERROR, WEIGHT, TRIAL, TORQUE = (
    4,
    5,
    6,
    7,
)  # of CANDIDATE; one over the tolerance; scratch; joint forces
STAGE = 8  # the stages of the method from here on

# shapes_i: int64 (ns, 9): what can touch; vertices, faces and edges are ranges of the tables below
SH_KIND = 0  # one of the kinds below
SH_ROW = 1  # the row that carries it, 0 where it is fixed to the ground
SH_BODY = 2  # number of its body
SH_VERTEX, SH_VERTICES = 3, 4  # first and how many
SH_FACE, SH_FACES = 5, 6
SH_EDGE, SH_EDGES = 7, 8
SHAPE_I = 9

SPHERE, CAPSULE, BOX, CYLINDER, HULL, POINTS = 0, 1, 2, 3, 4, 5  # kinds of shape

# shapes_f: float64 (ns, 21): the shape's frame in the home axes of its row, and sizes [m]
SH_POS = 0  # 3, from the row's origin (from the world's origin on row 0)
SH_ROT = 3  # 9, rotation, row-major
SH_RADIUS = 12  # of a sphere, capsule or cylinder; 0 of what has corners
SH_HALF = 13  # half the length of a capsule (without its caps) or cylinder, along z
SH_BOX = 14  # 3, half extents of the bounding box in the shape's frame; of a box its own
SH_MID = 17  # 3, centre of that box in the shape's frame
SH_REACH = 20  # from the origin of the shape's frame to its farthest point
SHAPE_F = 21

# What bounds a shape. A ball of SH_RADIUS about one vertex is a sphere, about two a capsule; a
# cylinder's faces are those of a prism, which only other bodies see: the ground sees the cylinder.
# vertices: float64 (nvert, 3), in the shape's frame [m]
# normals: float64 (nface, 3), outward, in the shape's frame
# faces: int64 (nface, 2): first entry and number of entries in `rings`
# rings: int64 (nring,): vertices around a face, counterclockwise from outside, from SH_VERTEX
# edges: int64 (nedge, 4): vertices u, v (from SH_VERTEX) and the faces f, g beside the edge (from
#   SH_FACE), v - u along n_g × n_f; a capsule's edge has the faces -1, -1
# geometry: (shapes_i, shapes_f, vertices, normals, faces, rings, edges)

# poses: float64 (ns, 12): position of the shape's origin [m] and rotation, row-major, in the world
PO_POS, PO_ROT = 0, 3
POSE = 12

# ground: float64 (1 + np, 9); row 0: the plane through the world's origin
GR_NORMAL, GR_X, GR_Y = 0, 3, 6  # 3 each: unit normal and two unit directions in the plane
# rows 1 on: patches at another height, the last one that a point is over counts [m]
GR_X0, GR_X1, GR_Y0, GR_Y1, GR_HEIGHT = 0, 1, 2, 3, 4
GROUND = 9

# what may touch: on_ground int64 (ng, 2): shape, contact; pairs int64 (np, 3): shape A, shape B,
# contact; members int64 (nm, 2): shape, contact: every two members of one contact may touch;
# apart int64 (nx, 2): bodies a < b, sorted, that may not touch as members (joined by a joint)
# touch: (on_ground, pairs, members, apart)

# contacts: float64 (nmax, 10), world axes; B is the ground or the second shape
CT_A, CT_B = 0, 3  # 3 each: the point on A and on B [m]
CT_NORMAL = 6  # 3, unit, from B to A
CT_GAP = 9  # (point on A - point on B) · normal [m], negative where they penetrate
CONTACT_F = 10
# contacts_i: int64 (nmax, 4)
CT_SHAPE_A, CT_SHAPE_B = 0, 1  # shapes; B is -1 for the ground
CT_FEATURE = 2  # which vertex, edge or face touches: the same number as long as it does
CT_CONTACT = 3  # number of the contact that asked for it
CONTACT_I = 4

# room: float64 (nroom, 5): scratch of one pair: a vector, a height [m], a tag
RO_HEIGHT, RO_TAG = 3, 4
ROOM = 5
# bounds: float64 (ns, 6): lower and upper corner of every shape's box in the world [m]
# cells: int64 (nm, 5): next member in the bucket (-1: none), the cell's three numbers, large or not
CE_NEXT, CE_X, CE_LARGE = 0, 1, 4
CELL = 5
# buckets: int64 (a power of two,): first member of every bucket
# search: (room, bounds, cells, buckets)

# -- contacts in a scene -----------------------------------------------------------------------
# A touch is a shape over the ground, a pair of shapes, or all members of one contact together.
# laws: float64 (nt, 6), one row a touch
LW_LAW, LW_FRICTION, LW_BOUNCE, LW_STIFF, LW_DAMP = 0, 1, 2, 3, 4
RIGID, SOFT, PENALTY = 0, 1, 2
LAW = 6
# kept: float64 (nmax, 3) impulses of the last step's contact points, or anchors of their friction;
# kept_i: int64 (nmax, 3) shape A, shape B, feature
# pushes: float64 (nb + 1, 6): [torque, force] of contacts on each body, about its row's origin
# touches: float64 (nt, 8), world axes: what A gets, smallest gap, fastest slip
TO_FORCE, TO_TORQUE, TO_GAP, TO_SLIP = 0, 3, 6, 7  # torque about the origin of A's body
TOUCH = 8
# stages: int64 (nt,) the touches' phases (below), -1 before the first step
# changes: float64 (room, 3): time [s], touch, its new phase; whoever reads them sets N_LOGGED to 0
CH_TIME, CH_TOUCH, CH_PHASE = 0, 1, 2
# tally: int64 (10,)
N_FOUND, N_KEPT, FIRST_LIMIT, N_LIMITS, FIRST_CONTACT = 0, 1, 2, 3, 4
FROZEN = 5  # 1: `pushes` of the last step act, rigid contacts being known only by their impulses
N_FALLBACK, N_CALMED = 6, 7  # steps solved by ADMM; steps whose bounce was left out
N_MISSED = 8  # steps with more contact points than there is room for
N_LOGGED = 9  # changes of phases that wait in `changes`
TALLY = 10
# limit_tau: float64 (nv,): torques of joint limits in the last step; their touches come last
# worst: float64 (2,): largest law missed relative to the velocities, deepest penetration [m]
MISSED, DEEPEST = 0, 1

# -- contact points and limits of event-driven runs ------------------------------------------------
# sites_i: int64 (ns, 6)
S_PHASE = 0  # one of the four below; a limit is in SWING or STANCE
S_STANCE, S_SLIDE, S_GAP = 1, 2, 3  # blocks: held, normal and two tangents, normal alone
S_LIMIT = 4  # 1: a joint's limit
S_FRESH = 5  # 1: its phase began at this instant, so what is watched starts at zero; 2: bounced
SITE_I = 6
SWING, ACCEPTANCE, SLIP, STANCE = 0, 1, 2, 3

# sites_f: float64 (ns, 31), world axes; a limit's force and rates are about or along its axis
S_FRICTION = 0
S_NORMAL = 1  # 3
S_WAY = 4  # 3, direction of slip, also where it is only about to slip
S_FORCE = 7  # 3, on the body
S_PUSH, S_DRAG = 10, 11  # normal and tangential part of it [N]
S_DISTANCE, S_RATE = 12, 13  # gap [m, rad] and its rate
S_SLIP_V = 14  # 3, tangential velocity of the point
S_PLACE = 17  # 3, the point
S_PIVOT = 20  # normal acceleration that one newton gives a sliding point, of what it gives unslid
S_NOISE = 21  # rounding of the gap
S_STILL = 22  # speed that counts as none, beside which a direction means nothing
S_ACC_N, S_ACC_T = 23, 24  # normal acceleration; 3, tangential
S_START = 27  # gap at the start of the step, or slip along S_WAY where it slides
S_EASE = 28  # tangential acceleration that one newton gives a sliding point
S_BLEND = 29  # speed below which a step cannot follow how friction turns slip
S_BEFORE = 30  # S_RATE at the start of the step
SITE_F = 31

# of a frame: float64 (ns, 11)
F_FORCE, F_PLACE, F_SLIP, F_PUSH, F_GAP = 0, 3, 6, 9, 10  # 3, 3, 3; normal part of the force
SITE_FRAME = 11

# watched: float64 (4, 3 ns): what ends a phase, where it falls below zero: gap or normal force;
# friction left or slip along S_WAY; S_PIVOT. Rows: at a step's start, lower and upper bracket, now
W_START, W_LOW, W_HIGH, W_NOW = 0, 1, 2, 3
