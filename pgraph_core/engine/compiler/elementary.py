"""Elementary functions from sums, products and quotients, bit-identical on every processor.

How the C library rounds them depends on its version and on the processor. These functions are
implemented in plain floating-point arithmetic, with an error of one unit in the last place, or two
for atan2 and for very large or small powers. tests/core/test_elementary.py compares them with
mpmath. Coefficients are those of Cephes (S. L. Moshier) and of FDLIBM (Sun Microsystems).
"""

from __future__ import annotations

import math
import struct
from typing import Any

from .jit import late, part, sweep

# sin and cos of Cephes (S. L. Moshier): reduction by π/4 in three parts, minimax polynomials;
# within 0.9 ulp for |x| < 1e5, but for values below 1e-10 away from 0, which are good to 1e-27.
PI_4 = (7.85398125648498535156e-1, 3.77489470793079817668e-8, 2.69515142907905952645e-15)
SIN = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
COS = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)


PI_4_REST = 4.23921383018445e-32  # remainder of π/4 beyond the three parts
FAR = 1e5  # rad: from here on the reduction by three parts loses digits

# -- numbers as bits ------------------------------------------------------------------------------

# the 64 bits of a double as an integer, and the double of such
bits_of: Any = late("elementary", "bits_of", lambda x: struct.unpack("<q", struct.pack("<d", x))[0])
float_of: Any = late(
    "elementary", "float_of", lambda n: struct.unpack("<d", struct.pack("<q", n))[0]
)


@part
def power_of_two(n):
    """Return 2ⁿ for -1022 <= n <= 1023."""
    return float_of((n + 1023) << 52)


@part
def scaled(x, n):
    """Return x 2ⁿ, rounded once. The result may be subnormal or overflow."""
    if n > 1023:
        return x * power_of_two(1023) * power_of_two(min(n - 1023, 1023))
    if n < -1022:
        return x * power_of_two(-969) * power_of_two(max(n + 969, -1022))
    return x * power_of_two(n)


@part
def two_sum(a, b):
    """Compute (a + b, its rounding error)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@part
def halves(x):
    """Split x into two numbers of 26 bits [Dekker 1971]."""
    t = 134217729.0 * x
    high = t - (t - x)
    return high, x - high


@part
def two_product(a, b):
    """Compute (a b, its rounding error)."""
    p = a * b
    a0, a1 = halves(a)
    b0, b1 = halves(b)
    return p, ((a0 * b0 - p) + a0 * b1 + a1 * b0) + a1 * b1


# -- sine and cosine ------------------------------------------------------------------------------


# 2 / π in digits of 24 bits, after two zeros
DIGITS = (
    0, 0, 10680707, 7228996, 1387004, 2578385, 16069853, 12639074, 9804092, 4427841, 16666979,
    11263675, 12935607, 2387514, 4345298, 14681673, 3074569, 13734428, 16653803, 1880361, 10960616,
    8533493, 3062596, 8710556, 7349940, 6258241, 3772886, 3769171, 3798172, 8675211, 12450088,
    3874808, 9961438, 366607, 15675153, 9132554, 7151469, 3571407, 2607881, 12013382, 4155038,
    6285869, 7677882, 13102053, 15825725, 473591, 9065106, 15363067, 6271263, 9264392, 5636912,
    4652155, 7056368, 13614112, 0, 0,
)  # fmt: skip
DIGIT = 1 << 24
MASK = DIGIT - 1
HALF_PI = (1.5707963267948966, 6.123233995736766e-17)


@sweep
def reduced(x):
    """Return (n mod 4, r, low): x = n π/2 + r + low for |x| >= FAR, |r| <= π/4 [Payne, Hanek 1983].

    x = m 2ᵉ times the digits of 2/π that do not only add multiples of four.
    """
    bits = bits_of(abs(x))
    e = (bits >> 52) - 1075
    m = (bits & 4503599627370495) | 4503599627370496
    first = (e + 22) // 24 + 1  # digits before it give multiples of four
    shift = e - 24 * (first - 1)  # 2^shift is its weight: -22 to 1
    a, b, c = m & MASK, (m >> 24) & MASK, m >> 48
    carry = 0
    low = 0.0  # digits of x 2/π, the last ones first
    middle = 0.0  # sum of two digits, exact
    for j in range(9, 1, -1):
        k = first + j
        total = carry + a * DIGITS[k] + b * DIGITS[k + 1] + c * DIGITS[k + 2]
        carry = total >> 24
        if j > 3:
            low = (low + (total & MASK)) / DIGIT
        else:
            middle = (middle + (total & MASK)) / DIGIT
    k = first + 1
    total = carry + a * DIGITS[k] + b * DIGITS[k + 1] + c * DIGITS[k + 2]
    second = total & MASK
    k = first
    top = (total >> 24) + a * DIGITS[k] + b * DIGITS[k + 1] + c * DIGITS[k + 2]
    unit = power_of_two(shift)
    top &= 67108863  # drops multiples of four
    high = unit * (top + second / DIGIT)
    n = math.floor(high + 0.5)
    y, rest = two_sum(high - n, unit * (middle / DIGIT))
    y, more = two_sum(y, unit * (low / DIGIT / DIGIT / DIGIT))
    rest += more
    r, error = two_product(y, HALF_PI[0])
    error += y * HALF_PI[1] + rest * HALF_PI[0]
    r, error = two_sum(r, error)
    n = int(n)
    if x < 0.0:
        return -n & 3, -r, -error
    return n & 3, r, error


@part
def _sine_near_zero(r, low):
    z = r * r
    y = SIN[0]
    for c in SIN[1:]:
        y = y * z + c
    return r + (r * z * y + low)


@part
def _cosine_near_zero(r, low):
    z = r * r
    y = COS[0]
    for c in COS[1:]:
        y = y * z + c
    half = 0.5 * z
    cosine = 1.0 - half
    return cosine + (z * z * y - r * low + ((1.0 - cosine) - half))


def _near_in_python(x):
    """Return the same as `lowering.elementary.near`, using the same operations."""
    n = round(x * (2.0 / math.pi))
    r, low = x, 0.0
    for third in PI_4:
        less = n * (2.0 * third)
        left = r - less
        low = low + ((r - left) - less)
        r = left
    s, c = _sine_near_zero(r, low), _cosine_near_zero(r, low)
    s, c = (c, -s) if n & 1 else (s, c)
    return (-s, -c) if n & 2 else (s, c)


# (sin x, cos x) of a lane or a number up to FAR: in place, in half the time of a call
_near: Any = late("elementary", "near", _near_in_python)


@sweep
def _far(x):
    """Return (sin x, cos x) for |x| >= FAR, or nan if x is not finite."""
    if not abs(x) < math.inf:
        return math.nan, math.nan
    n, r, low = reduced(x)
    s, c = _sine_near_zero(r, low), _cosine_near_zero(r, low)
    if n & 1:
        s, c = c, -s
    return (-s, -c) if n & 2 else (s, c)


@part
def _of_number(x):
    if abs(x) < FAR:
        return _near(x)
    return _far(x)


# (sin x, cos x) of a number, or of a lane up to FAR
sine_cosine: Any = late("elementary", "sine_cosine", _of_number)


@part
def sin(x):
    return sine_cosine(x)[0]


@part
def cos(x):
    return sine_cosine(x)[1]


TAN = (
    2.59073051863633712884e-05,
    -1.85586374855275456654e-05,
    7.14072491382608190305e-05,
    7.81794442939557092300e-05,
    2.46463134818469906812e-04,
    5.88041240820264096874e-04,
    1.45620945432529025516e-03,
    3.59207910759131235356e-03,
    8.86323982359930005737e-03,
    2.18694882948595424599e-02,
    5.39682539762260521377e-02,
    1.33333333333201242699e-01,
    3.33333333333334091986e-01,
)


@part
def parted(x):
    """Return `reduced` for |x| < FAR."""
    n = math.floor(x * (2.0 / math.pi) + 0.5)
    r, low = x, 0.0
    for third in (*PI_4, PI_4_REST):
        less, lost = two_product(n, 2.0 * third)
        r, more = two_sum(r, -less)
        low += more - lost
    r, low = two_sum(r, low)
    return int(n), r, low


@sweep
def _tan(x):
    if not abs(x) < math.inf:
        return math.nan
    n, r, low = parted(x) if abs(x) < FAR else reduced(x)
    negative = r < 0.0
    if negative:
        r, low = -r, -low
    near_one = r >= 0.6744
    if near_one:  # expand at π/4 - r
        r, low = (0.5 * HALF_PI[0] - r) + (0.5 * HALF_PI[1] - low), 0.0
    z = r * r
    p = TAN[0]
    for c in TAN[1:-1]:
        p = p * z + c
    cube = z * r
    rest = low + z * (cube * p + low) + TAN[-1] * cube
    w = r + rest
    if near_one:
        v = -1.0 if n & 1 else 1.0
        y = v - 2.0 * (r - (w * w / (w + v) - rest))
    elif n & 1:  # -1 / (r + rest), to less than its rounding
        high = float_of(bits_of(w) & -4294967296)
        t = -1.0 / w
        a = float_of(bits_of(t) & -4294967296)
        y = a + t * ((1.0 + a * high) + a * (rest - (high - r)))
    else:
        y = w
    return -y if negative else y


# -- arcs -----------------------------------------------------------------------------------------

ARC = (
    1.62858201153657823623e-02,
    -3.65315727442169155270e-02,
    4.97687799461593236017e-02,
    -5.83357013379057348645e-02,
    6.66107313738753120669e-02,
    -7.69187620504482999495e-02,
    9.09088713343650656196e-02,
    -1.11111104054623557880e-01,
    1.42857142725034663711e-01,
    -1.99999999998764832476e-01,
    3.33333333333329318027e-01,
)
# arctangents of 0.5, 1, 1.5 and infinity, each with what its rounding has taken off
ARCS = (
    4.63647609000806093515e-01, 7.85398163397448278999e-01,
    9.82793723247329054082e-01, 1.57079632679489655800e00,
)  # fmt: skip
ARCS_LOW = (
    2.26987774529616870924e-17, 3.06161699786838301793e-17,
    1.39033110312309984516e-17, 6.12323399573676603587e-17,
)  # fmt: skip


@part
def _atan(x):
    size = abs(x)
    if not size < 1e18:
        return math.copysign(ARCS[3], x) if size >= 1e18 else x
    n = -1
    y = size
    if size >= 2.4375:
        n, y = 3, -1.0 / size
    elif size >= 1.1875:
        n, y = 2, (size - 1.5) / (1.0 + 1.5 * size)
    elif size >= 0.6875:
        n, y = 1, (size - 1.0) / (size + 1.0)
    elif size >= 0.4375:
        n, y = 0, (2.0 * size - 1.0) / (2.0 + size)
    z = y * y
    p = ARC[0]
    for c in ARC[1:]:
        p = p * z + c
    arc = y - y * (z * p) if n < 0 else ARCS[n] - ((y * (z * p) - ARCS_LOW[n]) - y)
    return -arc if x < 0.0 else arc


@part
def _quotient_arc(y, x):
    """Return atan(y / x) for x > 0, corrected for the rounding error of the quotient."""
    q = y / x
    if not (1e-140 < x < 1e140 and 1e-140 < abs(q) < 1e140):
        return _atan(q)
    p, lost = two_product(q, x)
    return _atan(q) + ((y - p) - lost) / (x * (1.0 + q * q))


@sweep
def _atan2(y, x):
    if x > 0.0 and abs(y) < math.inf:
        return _quotient_arc(y, x)
    if math.isnan(x) or math.isnan(y):
        return math.nan
    half = ARCS[3]
    if abs(y) == math.inf:
        if abs(x) == math.inf:
            return math.copysign(0.5 * half if x > 0.0 else 1.5 * half, y)
        return math.copysign(half, y)
    if x == 0.0:
        return math.copysign(half, y) if y != 0.0 else y
    arc = _quotient_arc(abs(y), -x) - 2.0 * ARCS_LOW[3]
    return math.copysign(2.0 * half - arc, y)


# the angle of (x, y) from the x axis, -π to π, of numbers or lanes
atan2: Any = late("elementary", "atan2", _atan2)


ASIN = (
    3.47933107596021167570e-05,
    7.91534994289814532176e-04,
    -4.00555345006794114027e-02,
    2.01212532134862925881e-01,
    -3.25565818622400915405e-01,
    1.66666666666666657415e-01,
)
ASIN_BELOW = (
    7.70381505559019352791e-02,
    -6.88283971605453293030e-01,
    2.02094576023350569471e00,
    -2.40339491173441421878e00,
    1.0,
)


@part
def _asin_rest(z):
    """Compute (asin x - x) / x for z = x², x up to 1/2."""
    p = ASIN[0]
    for c in ASIN[1:]:
        p = p * z + c
    q = ASIN_BELOW[0]
    for c in ASIN_BELOW[1:]:
        q = q * z + c
    return z * p / q


@part
def _upper(x):
    """Return acos x = 2 asin √((1 - x) / 2) for x from 1/2 to 1."""
    z = 0.5 * (1.0 - x)
    s = math.sqrt(z)
    high = float_of(bits_of(s) & -4294967296)
    low = (z - high * high) / (s + high) if s > 0.0 else 0.0
    return s, high, low, _asin_rest(z)


@part
def _asin(x):
    """nan beyond -1 and 1."""
    size = abs(x)
    if size < 0.5:
        return x + x * _asin_rest(x * x)
    if not size <= 1.0:
        return math.nan
    s, high, low, rest = _upper(size)
    arc = 0.5 * HALF_PI[0] - (
        (2.0 * s * rest - (HALF_PI[1] - 2.0 * low)) - (0.5 * HALF_PI[0] - 2.0 * high)
    )
    return -arc if x < 0.0 else arc


@part
def _acos(x):
    """nan beyond -1 and 1."""
    if abs(x) < 0.5:
        return HALF_PI[0] - (x - (HALF_PI[1] - x * _asin_rest(x * x)))
    if not abs(x) <= 1.0:
        return math.nan
    s, high, low, rest = _upper(abs(x))
    if x < 0.0:
        return 2.0 * HALF_PI[0] - 2.0 * (s + (s * rest - HALF_PI[1]))
    return 2.0 * (high + (low + s * rest))


# -- exponential, logarithm, power ----------------------------------------------------------------

LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
EXP = (
    4.13813679705723846039e-08,
    -1.65339022054652515390e-06,
    6.61375632143793436117e-05,
    -2.77777777770155933842e-03,
    1.66666666666666019037e-01,
)
LOG = (
    1.479819860511658591e-01,
    1.531383769920937332e-01,
    1.818357216161805012e-01,
    2.222219843214978396e-01,
    2.857142874366239149e-01,
    3.999999999940941908e-01,
    6.666666666666735130e-01,
)


@sweep
def _exp(x, more):
    """Return exp(x + more), where `more` is within the rounding error of x."""
    if not x < 709.8:
        return math.inf if x >= 709.8 else x
    if x < -745.2:
        return 0.0
    n = math.floor(x * 1.44269504088896338700 + 0.5)
    high, low = x - n * LN2[0], n * LN2[1] - more
    r = high - low
    z = r * r
    p = EXP[0]
    for c in EXP[1:]:
        p = p * z + c
    p = r - z * p
    return scaled(1.0 - ((low - r * p / (2.0 - p)) - high), int(n))


@part
def _exp_of(x):
    return _exp(x, 0.0)


@sweep
def _log(x):
    """Compute (log x, its rounding error) for 0 < x < ∞."""
    n = 0
    if x < 2.2250738585072014e-308:
        x *= 18014398509481984.0
        n = -54
    bits = bits_of(x)
    n += (bits >> 52) - 1023
    f = float_of((bits & 4503599627370495) | (1023 << 52))
    if f > math.sqrt(2.0):
        f *= 0.5
        n += 1
    f -= 1.0
    # log(1 + f) = 2 s + 2/3 s³ + ..., s = f / (2 + f) as a quotient and its remainder
    below, lost = two_sum(2.0, f)
    s = f / below
    p, q = two_product(s, below)
    rest = (((f - p) - q) - s * lost) / below
    z = s * s
    y = LOG[0]
    for c in LOG[1:]:
        y = y * z + c
    high, more = two_sum(n * LN2[0], 2.0 * s)
    more += n * LN2[1] + (2.0 * rest + s * z * y)
    return two_sum(high, more)


@part
def _log_of(x):
    if x > 0.0 and x < math.inf:
        return _log(x)[0]
    return -math.inf if x == 0.0 else x if x > 0.0 else math.nan


@part
def _power(x, y):
    """x^y for x >= 0."""
    if not (x > 0.0 and x < math.inf):
        if y == 0.0:
            return 1.0
        if not (x >= 0.0 and abs(y) <= math.inf):
            return math.nan
        return x if y > 0.0 else 1.0 / x
    high, low = _log(x)
    product, rest = two_product(high, y)
    if not abs(product) < 1e4:
        return _exp(product, 0.0)
    return _exp(product, rest + low * y)


# -- of numbers, or of duals: with the slope at (x, f(x)) ------------------------------------------


def _with(slope: Any, of_number: Any) -> Any:
    """Extend a scalar function to dual numbers, given its derivative at (x, f(x))."""
    return late("elementary", "with_slope", of_number, of_number, part(slope))


tan = _with(lambda x, y: 1.0 + y * y, _tan)
atan = _with(lambda x, y: 1.0 / (1.0 + x * x), _atan)
asin = _with(lambda x, y: 1.0 / math.sqrt(1.0 - x * x), _asin)  # nan beyond -1 and 1
acos = _with(lambda x, y: -1.0 / math.sqrt(1.0 - x * x), _acos)  # nan beyond -1 and 1
exp = _with(lambda x, y: y, _exp_of)
log = _with(lambda x, y: 1.0 / x, _log_of)
power: Any = late("elementary", "power", _power)  # x^y for x >= 0
