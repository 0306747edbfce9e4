"""Sensor readings from a motion, and rotation matrices as quaternions."""

import math

from ..compiler.jit import kernel, part
from ..compiler.kinds import F1, F2, F3, array_of, read, void
from ..records import INTEGER, REAL, columns, record
from ..vec import (
    add,
    add_cross,
    cross,
    load,
    load3,
    load9,
    mat_mul,
    mul,
    mul_t,
    quaternion_matrix,
    scale,
    sub,
    xyz,
)

SENSED = columns(
    "q", "v", "position", "rotation", "velocity", "spin", "velocimeter", "gyro", "accelerometer",
    "force", "torque",
)  # fmt: skip

SENSOR = record(
    kind=INTEGER,  # one of the above
    entry=INTEGER,  # index in q or v
    body=INTEGER,  # 0: the ground
    first=INTEGER,  # column of what it reads
    point=(REAL, 3),  # origin of its frame in the body's axes [m]
    turn=(REAL, 4),  # unit quaternion of the frame relative to the body
)
STILL = (0.0, 0.0, 0.0)


@part
def quaternion_of(r):
    """Return [w, x, y, z] of a rotation with the largest entry positive, the best of four forms."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = r
    squares = (1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
    if squares[0] >= max(squares[1], squares[2], squares[3]):
        w, x, y, z = squares[0], zy - yz, xz - zx, yx - xy
    elif squares[1] >= max(squares[2], squares[3]):
        w, x, y, z = zy - yz, squares[1], xy + yx, xz + zx
    elif squares[2] >= squares[3]:
        w, x, y, z = xz - zx, xy + yx, squares[2], yz + zy
    else:
        w, x, y, z = yx - xy, xz + zx, yz + zy, squares[3]
    s = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return (s * w, s * x, s * y, s * z)


@kernel(void(read(F3), read(F3), F3), nogil=True)
def as_quaternions(position, rotation, pose):
    """Combine positions (n, nb, 3) and rotations (n, nb, 9) into x y z, w x y z (n, nb, 7)."""
    for i in range(pose.shape[0]):
        for b in range(pose.shape[1]):
            pose[i, b, 0], pose[i, b, 1], pose[i, b, 2] = load(position[i], b, 0)
            turn = quaternion_of(load9(rotation[i], b, 0))
            pose[i, b, 3], pose[i, b, 4], pose[i, b, 5], pose[i, b, 6] = turn


@kernel(void(*map(read, (array_of(SENSOR), F1, F2, F2, F3, F3, F3, F3)), F2), nogil=True)
def read_sensors(sensors, gravity, q, v, pose, velocity, acceleration, force, out):
    """Compute the sensor readings in every frame (n, columns).

    `pose` (n, nb, 7), `velocity`, `acceleration` and `force` (n, nb, 6) are those of the bodies, at
    their origins in world axes. `gravity` is (3,).
    """
    for i in range(out.shape[0]):
        for sensor in sensors:
            first, kind, b = sensor.first, sensor.kind, sensor.body - 1
            if kind == SENSED.q:
                out[i, first] = q[i, sensor.entry]
            elif kind == SENSED.v:
                out[i, first] = v[i, sensor.entry]
            elif kind == SENSED.rotation:
                turn = (1.0, 0.0, 0.0, 0.0)
                if b >= 0:
                    turn = (pose[i, b, 3], pose[i, b, 4], pose[i, b, 5], pose[i, b, 6])
                w, x, y, z = turned(turn, sensor.turn)
                out[i, first], out[i, first + 1], out[i, first + 2], out[i, first + 3] = w, x, y, z
            else:
                value = of_frame(
                    sensor, gravity, b, pose[i], velocity[i], acceleration[i], force[i]
                )
                out[i, first], out[i, first + 1], out[i, first + 2] = value


@part
def turned(p, q):
    """Compute the quaternion p q, which is the rotation q followed by p."""
    a, b, c, d = p
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


@part
def of_frame(sensor, gravity, b, pose, velocity, acceleration, force):
    """Return a three-number reading of a frame fixed to body b, from 0, or the ground, -1."""
    turn, place, speed, omega = quaternion_matrix(1.0, 0.0, 0.0, 0.0), STILL, STILL, STILL
    alpha, linear, torque, push = STILL, STILL, STILL, STILL
    if b >= 0:
        turn = quaternion_matrix(pose[b, 3], pose[b, 4], pose[b, 5], pose[b, 6])
        place, omega, speed = load(pose, b, 0), load(velocity, b, 0), load(velocity, b, 3)
        alpha, linear = load(acceleration, b, 0), load(acceleration, b, 3)
        torque, push = load(force, b, 0), load(force, b, 3)
    kind, arm, own = sensor.kind, mul(turn, xyz(sensor.point)), sensor.turn
    speed = add_cross(speed, omega, arm)
    if kind == SENSED.position:
        return add(place, arm)
    if kind == SENSED.velocity:
        return speed
    if kind == SENSED.spin:
        return omega
    own_axes = mat_mul(turn, quaternion_matrix(own[0], own[1], own[2], own[3]))
    if kind == SENSED.velocimeter:
        return mul_t(own_axes, speed)
    if kind == SENSED.gyro:
        return mul_t(own_axes, omega)
    if kind == SENSED.accelerometer:
        felt = add(add_cross(linear, alpha, arm), cross(omega, cross(omega, arm)))
        return mul_t(own_axes, sub(felt, load3(gravity, 0)))
    if kind == SENSED.force:
        return mul_t(own_axes, push)
    return mul_t(own_axes, add_cross(torque, scale(-1.0, arm), push))
