"""The walking controller for a block of lanes, which is only compiled for batches that walk."""

from typing import Any, NamedTuple

from ..compiler.address import caller, stored
from ..compiler.jit import kernel, sweep
from ..compiler.kinds import F2, F3, I1, I2, f8, i8, named, plain, void
from ..compiler.lane import in_lanes_of, lanes
from ..gait.tables import FOOT, GAIT_SETTINGS, LEG, Walk
from ..gait.walking import control
from ..stepping.armatures import exchange
from .block import LANE, VECTOR


class WalkOfLanes(NamedTuple):
    """The controller of a run or of a block of runs.

    In a block, the lane is the last axis of each array.
    """

    rows: Any
    spine: Any
    settings: Any  # (1, words) of the run
    legs: Any  # (4, words)
    waves: Any
    limit: Any  # (1, nv)
    all_settings: Any  # (1, words, W)
    all_legs: Any  # (4, words, W)
    all_waves: Any
    all_limits: Any  # (1, nv, W)
    feet: Any  # (4, words, W)
    matrix: Any  # (6, 7, W)
    own: Any  # (n + 1, WORK, W)
    const: Any  # from here on of the block
    work: Any
    linear: Any
    vectors: Any
    lane: Any


WALK_OF_LANES = named(WalkOfLanes, I2, I2, *[F2] * 4, *[F3] * 12)
_save, _opened = stored(WALK_OF_LANES)
_settings, _legs, _feet = map(in_lanes_of, (GAIT_SETTINGS, LEG, FOOT))
ALL = -1  # lanes
call_walk = caller(i8(i8, i8, f8))


@kernel(void(I1, plain(WALK_OF_LANES)), later=True)
def save_walk_of_lanes(buffer, walk):
    """Store the tuple where `walk_in_lanes` finds it."""
    _save(buffer, walk)


@sweep
def numbers_into(one, all_, w):
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            all_[i, j, w] = one[i, j]


@kernel(i8(i8, i8, f8), later=True, lanes=True)
def walk_in_lanes(place, w, h):
    """Add the controller's τ to that of all lanes, at the midpoint of a step h.

    If w >= 0, the values of the run are copied into lane w instead.
    """
    our = _opened(place)
    if w != ALL:
        numbers_into(our.settings, our.all_settings, w)
        numbers_into(our.legs, our.all_legs, w)
        numbers_into(our.waves, our.all_waves, w)
        numbers_into(our.limit, our.all_limits, w)
        return 0
    const, work, x, lane = lanes(our.const), lanes(our.work), lanes(our.vectors), lanes(our.lane)[0]
    nv = our.limit.shape[1]
    v, torque = x[VECTOR.mean, :nv], x[VECTOR.move, :nv]
    lane[LANE.fell] = lane[LANE.fallen]
    walk = Walk(
        our.rows, const, lanes(our.own), lanes(our.linear), _legs(our.all_legs),
        _settings(our.all_settings), lanes(our.all_waves), _feet(our.feet), lanes(our.matrix),
        x[VECTOR.new_q], v, torque, x[VECTOR.vdot, :nv], lanes(our.all_limits)[0], our.spine,
        lane[LANE.fell : LANE.fell + 1], None, work,
    )  # fmt: skip
    exchange(our.rows, const, x[VECTOR.armature])  # the controller has no stiff drives
    control(walk, work, lane[LANE.time] + 0.5 * h)
    exchange(our.rows, const, x[VECTOR.armature])
    power = 0.0 * lane[LANE.time]
    for j in range(nv):
        x[VECTOR.tau, j] += torque[j]
        power += torque[j] * v[j]
    lane[LANE.put_in] += power
    return 0
