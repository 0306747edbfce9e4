"""Axes that turn with the trunk, and what a gait's clock asks for at a time."""

import math

from ..compiler.elementary import sine_cosine
from ..compiler.jit import part, sweep

# waves (5, 8), each a1, b1, a2, b2, ...: Σ a cos(2π k phase) + b sin(2π k phase)
RISE, NOD, SWAY, SURGE, FLEXION = 0, 1, 2, 3, 4  # of height, pitch, place, place, spine hinges
HARMONICS = 4


@part
def into(heading, x):
    """World axes to heading axes; `heading` (cosine, sine) of the angle about y."""
    c, s = heading
    return (c * x[0] - s * x[2], x[1], s * x[0] + c * x[2])


@part
def out_of(heading, x):
    """Heading axes to world axes."""
    c, s = heading
    return (c * x[0] + s * x[2], x[1], c * x[2] - s * x[0])


@part
def smooth(x):
    """0 below 0, 1 above 1, level at both."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@sweep
def wave(waves, i, s, phase):
    """(value, rate, acceleration) of wave i."""
    rate = 2.0 * math.pi / s.stride
    x = 0.0
    x1 = 0.0
    x2 = 0.0
    for k in range(HARMONICS):
        a, b = waves[i, 2 * k], waves[i, 2 * k + 1]
        if a == 0.0 and b == 0.0:
            continue
        n, c = sine_cosine(2.0 * math.pi * (k + 1) * phase)
        w = rate * (k + 1)
        x += a * c + b * n
        x1 += w * (b * c - a * n)
        x2 -= w * w * (a * c + b * n)
    return x, x1, x2


@part
def speed_at(s, t):
    """Forward speed that is wanted [m/s]: a ramp."""
    most = s.speed_rate * max(t - s.speed_time, 0.0)
    return s.speed_from + min(max(s.speed_to - s.speed_from, -most), most)


@part
def phase_at(s, t):
    return s.clock_phase + (t - s.clock_time) / s.stride
