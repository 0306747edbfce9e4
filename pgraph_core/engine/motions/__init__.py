"""Kinds of motion, one file each, and the questions that sweeps ask of the kind of a row.

A new kind with one degree of freedom is a file beside `hinge` and an entry of `single.SINGLES`.
"""

from functools import cache

import numpy as np

from ..compiler.jit import part
from ..rows import kind_of, parent_of
from .ball import BALL
from .contract import count, flag, question
from .free import FREE
from .single import MOTIONS_OF_ONE

MOTIONS = tuple(sorted((*MOTIONS_OF_ONE, BALL, FREE), key=lambda one: one.number))


def _answers(name):
    return {one.number: getattr(one, name) for one in MOTIONS}


def _flag(name):
    return flag(one.number for one in MOTIONS if getattr(one, name))


def _moving(one):
    place, set_rates = one.place, one.set_rates

    @part
    def move(rows, work, k, const, q, v):
        place(rows, work, k, const, q)
        set_rates(rows, work, k, const, v)

    return move


@cache
def _reducing(condense, relay):
    @part
    def reduce(rows, work, k, const, tau):
        condense(rows, work, k, const)
        relay(rows, work, k, const, tau)

    return reduce


@cache
def facts(name):
    """Return an attribute of all kinds by their numbers, for tables of rows in Python."""
    found = np.array([getattr(one, name) for one in MOTIONS])
    found.setflags(write=False)
    return found


# -- facts, of the number of a kind ----------------------------------------------------------------

nq_of = count(_answers("coordinates"))
nv_of = count(_answers("freedoms"))
has_attitude = _flag("attitude")
is_angle = _flag("angle")
turns = _flag("turns")
travels = _flag("travels")
bends = _flag("bends")
transmits = _flag("transmits")
is_inert = _flag("inert")


@part
def numbers_of(kind):
    """Return (offset in v, count) of the coordinates besides a quaternion, which is behind them.

    The offset is 3 with a quaternion, whose angular velocity stands first in v, and otherwise 0.
    """
    first = 3 if has_attitude(kind) else 0
    return first, nv_of(kind) - first


@part
def feeling(rows, k):
    """Return the parent of row k if it feels loads on the row, otherwise the ground."""
    return parent_of(rows, k) if transmits(kind_of(rows, k)) else 0


# -- the motion of row k: questions of (rows, work, k, ...) ----------------------------------------

# const, q, v: write the frame of the row, its velocity and a_k, eqs. (5), (9) with R4
move = question({one.number: _moving(one) for one in MOTIONS})
# const, v: write velocity and a_k for the frame of the last `move`
set_rates = question(_answers("set_rates"))
# const, c: return column c of H_k, eqs. (6), (7), as (angular, linear) in world axes
column = question(_answers("column"))
# const, c: return a wrench W with Hᵀ W = 1 at column c, 0 at the others
unit_wrench = question(_answers("unit_wrench"))
# const, q: return (angular, linear) of dH/dq in world axes, and of d²H/dq², where H depends on q
slopes = question(_answers("slopes"))
# const, x, alpha, linear: return V + H x, with V = (alpha, linear) and x of the length of v
add_motion = question(_answers("add_motion"))
# const, moment, force, out: write Hᵀ F, eq. (23), into `out` at the row's index in v
project = question(_answers("project"))

# -- the articulated-body algorithm [Featherstone 2008, ch. 7] -------------------------------------

# const, tau: add the articulated inertia and bias force to the parent's
reduce = question({one.number: _reducing(one.condense, one.relay) for one in MOTIONS})
# const, tau: add the bias force alone, for the inertia of the last `reduce`
relay = question(_answers("relay"))
# const, alpha, linear, vdot: write v', given φ V'_p + a. Returns V'
solve = question(_answers("solve"))
# check whether the articulated inertia vanishes along a motion, up to rounding
is_singular = question(_answers("is_singular"))
# dinv: write the diagonal of D⁻¹
diagonal = question(_answers("diagonal"))
# restore the inertia if it was factored in place
restore = question(_answers("restore"))

# -- responses to wrenches, see `constraints.paths` ------------------------------------------------

# moment, force, reach, y, i, slot: store the joint's share of three wrenches in row i of y. Returns
# whether it has any, and the wrenches on the parent
past = question(_answers("past"))
# moment, force: return the speed of the joint along a wrench [1/kg], and the wrench on the parent
mobility = question(_answers("mobility"))
# const, step, alpha, linear: replace shares D⁻¹ Yᵀ λ by v. Returns V, given φ V_p
respond = question(_answers("respond"))
# const, speeds, alpha, linear: undo `respond`
gather = question(_answers("gather"))
