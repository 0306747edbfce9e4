"""Impulse of a single contact by Signorini's and Coulomb's laws, with all others fixed.

Let u = W λ + f denote the three velocities of the contact, starting with the normal velocity. A
sliding contact has u_t = -s λ_t with s ≥ 0 and |λ_t| = μ λ_n. For a given s, three linear equations
give the impulse. s is the root of ψ(s) = μ λ_n(s) / |λ_t(s)| - 1. The function is nearly linear, so
Newton's method takes one to three steps, as for the multiplier of a trust region [Conn, Gould &
Toint 2000]. The same code serves numbers and lanes.
"""

import math

from ...tolerances import EPS, NOTABLE, ROUNDING, SOLVED, TINY
from ..compiler.jit import sweep
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, without

THIN = 64 * EPS  # relative: a mobility across the normal that is rounding of some ten terms
NO_FRICTION = math.sqrt(TINY)  # less friction is none
NEWTON = 30  # limit on steps, of which more than five are rare


@sweep
def contact(own, u, old, mu, here):
    """Return λ of a contact in lanes `here`, where u is the velocity for the `old` λ.

    `own` (9,) is its part of Ω. If both sticking and sliding are possible, for example if a body
    leans into its slip with large friction, the smaller impulse is the regular solution.
    """
    moves = both(here, more(own[0], 0.0))
    free_n = u[0] - own[0] * old[0] - own[1] * old[1] - own[2] * old[2]
    free_x = u[1] - own[3] * old[0] - own[4] * old[1] - own[5] * old[2]
    free_y = u[2] - own[6] * old[0] - own[7] * old[1] - own[8] * old[2]
    w = 1.0 / own[0]
    p, q = w * own[3], w * own[6]
    a, b, c = own[4] - p * own[1], own[5] - p * own[2], own[8] - q * own[2]
    thin = most(a * c - b * b, THIN * (own[4] + own[8]) * (abs(a) + abs(c)))
    slack = ROUNDING * (own[0] + own[4] + own[8])
    a, c = chosen(thin, abs(a) + slack, a), chosen(thin, abs(c) + slack, c)
    x, y = free_x - p * free_n, free_y - q * free_n
    x = chosen(most(abs(x), ROUNDING * abs(p * free_n)), 0.0 * x, x)
    y = chosen(most(abs(y), ROUNDING * abs(q * free_n)), 0.0 * y, y)
    det = a * c - b * b
    smooth = most(mu, NO_FRICTION)
    hold_x = chosen(smooth, 0.0, (b * y - c * x) / det)
    hold_y = chosen(smooth, 0.0, (b * x - a * y) / det)
    hold_n = -w * (free_n + own[1] * hold_x + own[2] * hold_y)
    holds = most(math.sqrt(hold_x * hold_x + hold_y * hold_y), mu * hold_n)
    holds = both(both(moves, more(hold_n, 0.0)), holds)
    new_n, new_x, new_y = only(holds, (hold_n, hold_x, hold_y))
    lean = mu * w * math.sqrt(own[1] * own[1] + own[2] * own[2])
    bent = lean * (a + c)
    sure = more(4.0 * det, bent * bent)  # there is one impulse only
    pull = math.sqrt(x * x + y * y)
    asked = both(without(moves, both(holds, sure)), both(more(0.0, free_n), more(pull, 0.0)))
    if not any_of(asked):
        return new_n, new_x, new_y
    reach = -pull / (mu * w * free_n)
    low, high = 0.0 * reach, reach * (1.0 + lean)
    s = reach + (own[1] * x + own[2] * y) / free_n - 0.5 * (a + c)  # the root where a = c, b = 0
    s = chosen(sure, larger(s, 0.0), high)
    open_, found = asked, 0.0 * asked
    for _ in range(NEWTON):
        i, k = a + s, c + s
        scale = 1.0 / (i * k - b * b)
        tx, ty = scale * (b * y - k * x), scale * (b * x - i * y)
        n = -w * (free_n + own[1] * tx + own[2] * ty)
        square = tx * tx + ty * ty
        size = math.sqrt(square)
        rate_x, rate_y = scale * (b * ty - k * tx), scale * (b * tx - i * ty)
        rate_n = -w * (own[1] * rate_x + own[2] * rate_y)
        beyond = size - mu * n
        slope = mu * (rate_n * square - n * (tx * rate_x + ty * rate_y))
        above = more(beyond, 0.0)
        low, high = chosen(above, s, low), chosen(above, high, s)
        new = s + beyond * square / slope
        open_ = without(open_, both(holds, most(new, 0.0)))  # there is no root
        inside = both(most(low, new), most(new, high))
        new = chosen(inside, new, math.sqrt(larger(low, ROUNDING * high) * high))
        done = both(most(abs(new - s), SOLVED * (s + a + c)), most(abs(beyond), NOTABLE * size))
        s = chosen(open_, new, s)
        found = either(found, both(open_, done))
        open_ = without(open_, done)
        if not any_of(open_):
            break
    i, k = a + s, c + s
    tx, ty = b * y - k * x, b * x - i * y
    fit = 1.0 / math.sqrt(tx * tx + ty * ty)
    tx, ty = fit * tx, fit * ty
    n = -free_n * w / (1.0 + w * mu * (own[1] * tx + own[2] * ty))
    smaller = both(found, both(more(n, 0.0), more(hold_n, n)))
    slides = both(asked, either(without(1.0 + 0.0 * n, holds), smaller))
    n, tx, ty = only(slides, (n, mu * n * tx, mu * n * ty))
    return (chosen(slides, n, new_n), chosen(slides, tx, new_x), chosen(slides, ty, new_y))


@sweep
def only(mask, x):
    """Return the impulse where the mask is set, and zero elsewhere."""
    return chosen(mask, x[0], 0.0), chosen(mask, x[1], 0.0), chosen(mask, x[2], 0.0)
