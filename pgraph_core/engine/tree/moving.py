"""Motion of q along v: rates, finite steps, unit quaternions."""

import math

from ...tolerances import TINY
from ..compiler.elementary import sine_cosine, tan
from ..compiler.jit import part, sweep
from ..motions import numbers_of
from ..rows import kind_of, q_of, v_of
from ..vec import add_cross, add_scaled, cross, dot, load3, scale, store3


@sweep
def advance(rows, q, v, h):
    """Move q along v for the time h, with quaternions by the exponential of the rotation h ω."""
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = v_of(rows, k)
        first, count = numbers_of(kind_of(rows, k))
        for n in range(count):
            q[i + n] += h * v[j + first + n]
        if first > 0:
            turn(q, i + count, scale(0.5 * h, load3(v, j)))


@part
def turn(q, i, half):
    """Rotate the quaternion at q[i] by twice the vector `half`, in the fixed (parent's) axes."""
    angle = math.sqrt(dot(half, half) + TINY)
    s, c = sine_cosine(angle)
    x = scale(s / angle, half)
    w = q[i]
    u = (q[i + 1], q[i + 2], q[i + 3])
    q[i] = c * w - dot(x, u)
    new = add_cross(add_scaled(scale(c, u), w, x), x, u)
    store3(q, i + 1, new)
    normalise(q, i)


@part
def normalise(q, i):
    """Normalise the quaternion at q[i]."""
    w, x, y, z = q[i], q[i + 1], q[i + 2], q[i + 3]
    s = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    for n in range(4):
        q[i + n] *= s


@sweep
def rate(rows, q, v, out):
    """Compute q' of v. Quaternions have the rate half ω times q with ω in the parent's axes."""
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = v_of(rows, k)
        first, count = numbers_of(kind_of(rows, k))
        for n in range(count):
            out[i + n] = v[j + first + n]
        if first == 0:
            continue
        i += count
        x, y, z = 0.5 * v[j], 0.5 * v[j + 1], 0.5 * v[j + 2]
        w, a, b, c = q[i], q[i + 1], q[i + 2], q[i + 3]
        out[i] = -x * a - y * b - z * c
        out[i + 1] = x * w + y * c - z * b
        out[i + 2] = y * w + z * a - x * c
        out[i + 3] = z * w + x * b - y * a


@sweep
def normalise_all(rows, q):
    """Normalise every quaternion."""
    for k in range(1, rows.shape[0]):
        first, count = numbers_of(kind_of(rows, k))
        if first > 0:
            normalise(q, q_of(rows, k) + count)


@sweep
def local_rate(rows, xi, v, out):
    """Compute ξ' after q has moved along ξ, for rotations dexp⁻¹(ξ) ω ([Hairer et al. 2006]).

    The rate is ω - ½ ξ × ω + c ξ × (ξ × ω) with c = (1 - ½ φ cot ½ φ) / φ² and φ = |ξ|.
    """
    for k in range(1, rows.shape[0]):
        j = v_of(rows, k)
        first, count = numbers_of(kind_of(rows, k))
        for n in range(first, first + count):
            out[j + n] = v[j + n]
        if first == 0:
            continue
        x = (xi[j], xi[j + 1], xi[j + 2])
        omega = (v[j], v[j + 1], v[j + 2])
        square = dot(x, x)
        c = 1.0 / 12.0 + square / 720.0
        if square > 1e-4:
            half = 0.5 * math.sqrt(square)
            c = (1.0 - half / tan(half)) / square
        turned = cross(x, omega)
        store3(out, j, add_scaled(add_scaled(omega, -0.5, turned), c, cross(x, turned)))
