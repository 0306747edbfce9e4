"""Numerical tolerances for values that count as zero, equal, near or converged.

All other thresholds are one of these, or derived from one as `c * EPS * scale`. All are relative
unless a unit is given. A test halves and doubles each one and checks that verdicts stay the same
(`tests/test_tolerances.py`). "From a to b" is an interval in which they did so; for the numbers in
kernels that is Python's use of them, and half to double in kernels.
"""

import math
import sys

EPS: float = sys.float_info.epsilon  # distance of 1 from the next float64, 2.2e-16

# -- equations ------------------------------------------------------------------------------------

# Rounding of a result of many operations, relative to its largest term: 1000 operations, each
# rounded by EPS at most (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).
# From 2e-15 to 2e-11.
ROUNDING = 1024 * EPS

# An equation holds if its residual is this part of its largest term. Newton's method doubles
# the digits of each step, so that a residual stops at ROUNDING or does not pass here.
# From 1e-11 to 1e-7.
SOLVED = 1e-9

# Error of slopes by central differences of order four, relative to the largest: that of
# `step_of_differences`, in sums as those of ROUNDING. About 1e-11 are measured
# (tests/core/test_linear.py). From 1e-11 to 1e-7.
DIFFERENCED = 1024 * EPS ** (4 / 5)

# A difference that a person sees or means: numbers are typed and shown with up to six digits.
# From 1e-8 to 1e-4.
NOTABLE = 1e-6

# An error or depth that a person sees in a graph or picture, relative to what it shows: one in a
# hundred is a pixel or two. From 5e-3 to 2e-2.
VISIBLE = 1e-2

# Square of a length or an angle that is added to a square, so that a quotient by its root is
# finite at zero without a branch. Its root is far below EPS times any length that is used.
# From 5e-61 to 2e-60.
TINY = 1e-60

# -- rows and directions --------------------------------------------------------------------------

# A singular value of constraint rows, relative to the largest, with which a run takes the row for
# none: accelerations of order one then need forces that are a thousand times those at hand.
# From 1e-5 to 1e-2.
FAINT = 1e-3

# Share of the mean diagonal that is added to a matrix of rows before it is factored, so that
# redundant rows do no harm; refinement takes it out again (Carpentier, Budhiraja and Mansard,
# Proximal and sparse resolution of constrained dynamic equations, 2021). From 5e-11 to 2e-10.
PROXIMAL = 1e-10

# Compliance that makes contact impulses with one effect unique, relative to what the rows of an
# island meet on average. Of impulses that have no effect it leaves EPS / SHARED, of the others
# its square after two corrections: both are alike at the cube root of EPS. From 1e-7 to 2e-5.
SHARED = EPS ** (1 / 3)

# Factor by which a pivot falls below its largest if a position may be singular: the rows there
# are a tenth as independent as elsewhere. From 50 to 200.
DIP = 100.0

# A part whose share of the largest is below this is not named in a sentence. From 0.05 to 0.2.
NAMED = 0.1

# Distance of two points, edges or planes that are one, relative to the sizes of shapes, and of
# equal instants, relative to a step: poses at the end of a long chain are rounded to a tenth of
# it, and intended gaps are larger. From 1e-10 to 1e-8.
COINCIDENT = 1e-9

# -- searches -------------------------------------------------------------------------------------

# Longest step of Newton's method, in rad or relative to the mechanism's size: within it sine and
# cosine are close to their tangents. From 0.25 to 5.
LONGEST_STEP = 0.5

# Distance to a position beside a singular one, in rad or relative to the mechanism's size: small
# against a turn, and its square is large against the square root of EPS, both by the same factor.
# From 5e-4 to 0.1.
NEARBY = EPS ** (1 / 8)

# Part of the decrease promised by the slope that a step must bring (Armijo's rule; Nocedal and
# Wright, Numerical Optimization, 2nd ed., section 3.1). From 1e-6 to 1e-2.
SUFFICIENT_DECREASE = 1e-4

# A gap that may be a contact, relative to what it is of: between shapes that inverse dynamics is
# given, poses from measurements are that far off; at a bound of a length, it is the margin within
# which a step's forces look at it. From 5e-4 to 2e-3.
TOUCHING = 1e-3


def step_of_differences(order: int) -> float:
    """Return the step of central differences over its scale, a power of two.

    This balances the truncation error h^order and the rounding error EPS / h.
    """
    return 2.0 ** round(math.log2(EPS) / (order + 1))
