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
# knots: float64 (nk, 2): time [s] and value

# cons_i: int64 (nc, 2): rows of the two bodies; cons_f: float64 (nc, 6): the two points in home
# axes, from the row's origin (from the world's origin for the ground)
CON_A, CON_B = 0, 1

# ledger: float64 (2,): work of drives and given torques, dissipation [J]
WORK_DONE, DISSIPATED = 0, 1

# counters: int64 (4,)
N_STEP, N_EVAL, N_PROJECT, N_ITERATE = 0, 1, 2, 3

# cursor: int64 (2,): the frame under way and the steps taken towards it
FRAME, TAKEN = 0, 1

# status codes of a run
DONE, NOT_FINITE, NOT_CONVERGED, RUNNING = 0, 1, 2, 3
