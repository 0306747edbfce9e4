"""Three-vectors as tuples, 3x3 matrices as nine numbers row by row, symmetric ones as six.

Symmetric: xx, yy, zz, xy, xz, yz. These functions do not allocate memory, and LLVM keeps their
values in registers.
"""

from .compiler.jit import part


@part
def load(a, i, j):
    return (a[i, j], a[i, j + 1], a[i, j + 2])


@part
def store(a, i, j, x):
    a[i, j] = x[0]
    a[i, j + 1] = x[1]
    a[i, j + 2] = x[2]


@part
def accumulate(a, i, j, x):
    a[i, j] += x[0]
    a[i, j + 1] += x[1]
    a[i, j + 2] += x[2]


@part
def load9(a, i, j):
    return (
        a[i, j], a[i, j + 1], a[i, j + 2],
        a[i, j + 3], a[i, j + 4], a[i, j + 5],
        a[i, j + 6], a[i, j + 7], a[i, j + 8],
    )  # fmt: skip


@part
def store9(a, i, j, x):
    a[i, j] = x[0]
    a[i, j + 1] = x[1]
    a[i, j + 2] = x[2]
    a[i, j + 3] = x[3]
    a[i, j + 4] = x[4]
    a[i, j + 5] = x[5]
    a[i, j + 6] = x[6]
    a[i, j + 7] = x[7]
    a[i, j + 8] = x[8]


@part
def xyz(field):
    """Return a field of three numbers."""
    return (field[0], field[1], field[2])


@part
def set_xyz(field, x):
    field[0] = x[0]
    field[1] = x[1]
    field[2] = x[2]


@part
def add_xyz(field, x):
    field[0] += x[0]
    field[1] += x[1]
    field[2] += x[2]


@part
def matrix(field):
    """Return a field of nine numbers."""
    return (
        field[0], field[1], field[2],
        field[3], field[4], field[5],
        field[6], field[7], field[8],
    )  # fmt: skip


@part
def set_matrix(field, x):
    for n in range(9):
        field[n] = x[n]


@part
def add(x, y):
    return (x[0] + y[0], x[1] + y[1], x[2] + y[2])


@part
def sub(x, y):
    return (x[0] - y[0], x[1] - y[1], x[2] - y[2])


@part
def scale(s, x):
    return (s * x[0], s * x[1], s * x[2])


@part
def add_scaled(x, s, y):
    """Return x + s y."""
    return (x[0] + s * y[0], x[1] + s * y[1], x[2] + s * y[2])


@part
def dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@part
def cross(x, y):
    return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])


@part
def add_cross(a, x, y):
    """Return a + x × y."""
    return (
        a[0] + x[1] * y[2] - x[2] * y[1],
        a[1] + x[2] * y[0] - x[0] * y[2],
        a[2] + x[0] * y[1] - x[1] * y[0],
    )


@part
def mul(m, x):
    """Return m x for a 3x3 matrix."""
    return (
        m[0] * x[0] + m[1] * x[1] + m[2] * x[2],
        m[3] * x[0] + m[4] * x[1] + m[5] * x[2],
        m[6] * x[0] + m[7] * x[1] + m[8] * x[2],
    )


@part
def mul_t(m, x):
    """Return mᵀ x for a 3x3 matrix."""
    return (
        m[0] * x[0] + m[3] * x[1] + m[6] * x[2],
        m[1] * x[0] + m[4] * x[1] + m[7] * x[2],
        m[2] * x[0] + m[5] * x[1] + m[8] * x[2],
    )


@part
def mat_mul(a, b):
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@part
def add9(a, b):
    return (
        a[0] + b[0], a[1] + b[1], a[2] + b[2],
        a[3] + b[3], a[4] + b[4], a[5] + b[5],
        a[6] + b[6], a[7] + b[7], a[8] + b[8],
    )  # fmt: skip


@part
def add_outer(s, x, y):
    """Return s + x yᵀ for a symmetric result."""
    return (
        s[0] + x[0] * y[0],
        s[1] + x[1] * y[1],
        s[2] + x[2] * y[2],
        s[3] + x[0] * y[1],
        s[4] + x[0] * y[2],
        s[5] + x[1] * y[2],
    )


@part
def add_outer9(m, x, y):
    """Return m + x yᵀ for a 3x3 matrix."""
    return (
        m[0] + x[0] * y[0], m[1] + x[0] * y[1], m[2] + x[0] * y[2],
        m[3] + x[1] * y[0], m[4] + x[1] * y[1], m[5] + x[1] * y[2],
        m[6] + x[2] * y[0], m[7] + x[2] * y[1], m[8] + x[2] * y[2],
    )  # fmt: skip


@part
def rows_of(m):
    """Return the rows of a 3x3 matrix."""
    return (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8])


@part
def columns_of(m):
    """Return the columns of a 3x3 matrix."""
    return (m[0], m[3], m[6]), (m[1], m[4], m[7]), (m[2], m[5], m[8])


@part
def cross_sym(x, s):
    """Return x× s as a 3x3 matrix, for a symmetric s."""
    a = cross(x, (s[0], s[3], s[4]))
    b = cross(x, (s[3], s[1], s[5]))
    c = cross(x, (s[4], s[5], s[2]))
    return (a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2])


@part
def transpose(m):
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@part
def sym_mul(s, x):
    """Return s x for a symmetric matrix."""
    return (
        s[0] * x[0] + s[3] * x[1] + s[4] * x[2],
        s[3] * x[0] + s[1] * x[1] + s[5] * x[2],
        s[4] * x[0] + s[5] * x[1] + s[2] * x[2],
    )


@part
def sym_full(s):
    return (s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2])


@part
def rotate_sym(r, s):
    """r s rᵀ."""
    t = mat_mul(r, sym_full(s))
    return (
        t[0] * r[0] + t[1] * r[1] + t[2] * r[2],
        t[3] * r[3] + t[4] * r[4] + t[5] * r[5],
        t[6] * r[6] + t[7] * r[7] + t[8] * r[8],
        t[0] * r[3] + t[1] * r[4] + t[2] * r[5],
        t[0] * r[6] + t[1] * r[7] + t[2] * r[8],
        t[3] * r[6] + t[4] * r[7] + t[5] * r[8],
    )


@part
def about_origin(s, m, c):
    """Compute the inertia about a point c away from the centre of mass, s + m (c² 1 - c cᵀ)."""
    x, y, z = m * c[0], m * c[1], m * c[2]
    return (
        s[0] + y * c[1] + z * c[2],
        s[1] + x * c[0] + z * c[2],
        s[2] + x * c[0] + y * c[1],
        s[3] - x * c[1],
        s[4] - x * c[2],
        s[5] - y * c[2],
    )


@part
def rodrigues(u, s, c):
    """Return Rot(u, θ) = I + (u×) s + (u×)² (1 - c) of a unit axis, s = sin θ, c = cos θ."""
    t = 1.0 - c
    tx, ty, tz = t * u[0], t * u[1], t * u[2]
    sx, sy, sz = s * u[0], s * u[1], s * u[2]
    return (
        c + tx * u[0], tx * u[1] - sz, tx * u[2] + sy,
        tx * u[1] + sz, c + ty * u[1], ty * u[2] - sx,
        tx * u[2] - sy, ty * u[2] + sx, c + tz * u[2],
    )  # fmt: skip


@part
def quaternion_matrix(w, x, y, z):
    """Compute the rotation matrix of a quaternion of any length: only its direction matters."""
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        1.0 - s * (y * y + z * z),
        s * (x * y - w * z),
        s * (x * z + w * y),
        s * (x * y + w * z),
        1.0 - s * (x * x + z * z),
        s * (y * z - w * x),
        s * (x * z - w * y),
        s * (y * z + w * x),
        1.0 - s * (x * x + y * y),
    )


@part
def load6(a, i, j):
    return (a[i, j], a[i, j + 1], a[i, j + 2], a[i, j + 3], a[i, j + 4], a[i, j + 5])


@part
def load3(x, i):
    return (x[i], x[i + 1], x[i + 2])


@part
def store3(x, i, value):
    x[i] = value[0]
    x[i + 1] = value[1]
    x[i + 2] = value[2]


@part
def finite(x):
    """Check whether every entry of a vector is finite."""
    n = x.shape[0]
    even = 0.0
    odd = 0.0
    for i in range(0, n - 1, 2):
        even += 0.0 * x[i]
        odd += 0.0 * x[i + 1]
    if n % 2 == 1:
        even += 0.0 * x[n - 1]
    return even + odd == 0.0


@part
def largest(x, m):
    """Find the largest magnitude of the first m numbers, or nan if one is nan."""
    size = 0.0
    for r in range(m):
        if not abs(x[r]) <= size:
            size = abs(x[r])
    return size
