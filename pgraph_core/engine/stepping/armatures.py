"""Dampers and springs of joints as inertia in a step of time stepping.

With h d + h²/2 k as armature, a step evaluates a damper d and a spring k at its end, so that it is
stable for any d and k. A motion of several coordinates has one armature, that of its least damper
and spring. What its other coordinates have beyond these is evaluated at the middle of the step.

The second pass of a step takes them at the mean velocity of the first one, where they are soft.
"""

from ...tolerances import TINY
from .. import layout as at
from ..compiler.jit import part, sweep
from ..compiler.masks import chosen, larger, more, smaller
from ..motions import diagonal, nv_of, transmits
from ..rows import armature_of, kind_of, parent_of, v_of


@part
def takes_armature(rows, k):
    """Check whether row k may have an armature, which the parent must feel if it moves."""
    return transmits(kind_of(rows, k)) or parent_of(rows, k) == 0


@part
def least_of(rows, k, x):
    """Return the smallest value of x (nv,) in row k."""
    j = v_of(rows, k)
    found = x[j]
    for i in range(j + 1, j + nv_of(kind_of(rows, k))):
        found = smaller(found, x[i])
    return found


@part
def share(part_of_it, whole):
    """Return a part over the whole: 1 of nothing, 0 if both are zero."""
    return chosen(more(whole, 0.0), part_of_it / larger(TINY, whole), more(part_of_it, 0.0))


@sweep
def stiffen(rows, const, h, v, damping, stiffness, driven, own, given):
    """Replace dampers and springs (nv,) by armatures and torques for a step of width h at speeds v.

    `damping` is then h d + h²/2 k, and `driven` the share of its former value in it. The first
    entry of a row in `own` keeps its armature without them.
    """
    for k in range(1, rows.shape[0]):
        if takes_armature(rows, k):
            j = v_of(rows, k)
            spring = least_of(rows, k, stiffness)
            extra = h * least_of(rows, k, damping) + 0.5 * h * h * spring
            own[j] = armature_of(const, k)
            const[k, at.ARMATURE] += extra
            for i in range(j, j + nv_of(kind_of(rows, k))):
                driven[i] = share(driven[i], damping[i])
                damping[i] = extra
                stiffness[i] = spring
                given[i] -= 0.5 * h * spring * v[i]


@sweep
def soften(rows, work, h, v, mean, damping, stiffness, own, given, dinv):
    """Write torques `given`, without drives `own`, that take drives at the mean velocity, where
    they are soft.

    `stiffness` becomes the difference, and `dinv` (nv,) the diagonal of D⁻¹.
    """
    for k in range(1, rows.shape[0]):
        if takes_armature(rows, k):
            j = v_of(rows, k)
            diagonal(rows, work, k, dinv)
            for i in range(j, j + nv_of(kind_of(rows, k))):
                softer = softened(dinv[i], damping[i], stiffness[i], h, v[i], mean[i])
                given[i] = own[i] + softer
                stiffness[i] = softer


@part
def softened(pivot, extra, stiffness, h, before, mean):
    """Compute the torque that replaces h d + h²/2 k as inertia, where it is small beside 1 / pivot.

    With z = (h d + h²/2 k) / m, where m is the other inertia that the joint feels, a damper leaves
    (2 + 3 z) / ((2 + z) (1 + z)²) of a velocity. This is exp(-z) to second order, and vanishes for
    a stiff damper.

    Between the coordinates of one motion, D is a matrix. With X = h d D⁻¹ ≤ 1 and the diagonal S of
    their shares 2 / (2 + z) ≤ 1, a damper leaves 1 - X - X S X / 2, whose size is below 1.
    """
    whole = 1.0 / pivot
    share = 2.0 * (whole - extra) / (2.0 * whole - extra)  # 2 / (2 + z)
    change = 2.0 * (mean - before)
    damping = extra / h - 0.5 * h * stiffness
    torque = 0.5 * (1.0 + share) * damping * change
    return torque + 0.5 * h * stiffness * (share * change - (1.0 - share) * before)


@sweep
def relax(rows, const, own):
    """Restore the armatures without drives."""
    for k in range(1, rows.shape[0]):
        if takes_armature(rows, k):
            const[k, at.ARMATURE] = own[v_of(rows, k)]


@sweep
def exchange(rows, const, own):
    """Swap the armatures with those without drives."""
    for k in range(1, rows.shape[0]):
        if takes_armature(rows, k):
            j = v_of(rows, k)
            stiff = armature_of(const, k)
            const[k, at.ARMATURE] = own[j]
            own[j] = stiff


@sweep
def corrections(rows, tau, before, taken, extra, softer, driven, h, v, none):
    """Return what the work of drives and the loss in joints lack for a step [J].

    The power of joint torques was taken at the velocities `taken`, and that of the torques `softer`
    as work. Both belong to the loss but for the share `driven`, that of servos in the damping.
    `none` is zero in the number type of the run.
    """
    work, lost = none, none
    for k in range(1, rows.shape[0]):
        if takes_armature(rows, k):
            j = v_of(rows, k)
            for i in range(j, j + nv_of(kind_of(rows, k))):
                change = v[i] - before[i]
                mean = 0.5 * (v[i] + before[i])
                pushed = h * tau[i]
                gained = (pushed - extra[i] * change) * mean - pushed * taken[i]
                own = h * softer[i] * taken[i]
                passive = (1.0 - driven[i]) * (gained + own)
                work += gained - passive
                lost -= passive
    return work, lost
