"""Principal values and directions of symmetric 3 x 3 tensors, in closed form.

Tensors are six numbers xx, yy, zz, yz, xz, xy (tensor shear). Values are ordered s1 >= s2 >= s3: tension positive, so
s1 is the most tensile and s3 the most compressive. All kernels allocate nothing and use no library function beyond the
square root: with numbers, the same bits on every machine. Those without a branch take lanes, too (simd/lanes.py).

The scheme is that of Scherzinger & Dohrmann (2008, Comput. Methods Appl. Mech. Eng. 197, 4007). Of the three roots of
the characteristic cubic only the one farthest from the others is well conditioned, whatever the Lode angle: it is found
first, then its direction, then the 2 x 2 problem in the plane across it. No digits are lost where values nearly repeat.
Everything happens on the deviator divided by its own size, so the result is scale invariant from 1e-150 to 1e150; a
deviator smaller than that counts as zero.
"""

import math

from numba import njit

from mpm_core.simd.lanes import choose

# cos(arccos(r) / 3) on 0 <= r <= 1: Chebyshev interpolant of degree 3 (error 4e-5). Each Newton step about squares the
# error (3e-9, then below round-off).
ROOT_START = (0.86606633, 0.16533035, -0.0406912, 0.00931968)
SQRT3 = math.sqrt(3.0)

# Bound of the error of the values from `extreme_stresses`, as a share of the deviator's size. Where two values repeat
# the error is the square root of a few round-offs.
MAX_FAST_ERROR = 2e-7


@njit(cache=True, error_model="numpy", inline="always")
def split_deviator(xx, yy, zz, yz, xz, xy):
    """Mean, deviatoric diagonal and J2 = s:s / 2 of a tensor: (mean, dx, dy, dz, j2), Pa and Pa^2.

    The mean is taken twice: what rounding left of the trace the first time would spoil the cubic of a tensor that is
    nearly isotropic.
    """
    first = (xx + yy + zz) * (1.0 / 3.0)
    dx = xx - first
    dy = yy - first
    dz = zz - first
    rest = (dx + dy + dz) * (1.0 / 3.0)
    dx -= rest
    dy -= rest
    dz -= rest
    j2 = 0.5 * (dx * dx + dy * dy + dz * dz) + yz * yz + xz * xz + xy * xy
    return first + rest, dx, dy, dz, j2


@njit(cache=True, error_model="numpy", inline="always")
def _farthest_root(dx, dy, dz, dyz, dxz, dxy):
    """Root of the characteristic cubic farthest from the other two, for a deviator with J2 = 3: |root| in [sqrt 3, 2].

    With root = 2 x sign(det) the cubic is 4 x^3 - 3 x = |det| / 2; its slope there is at least 6.
    """
    determinant = dx * (dy * dz - dyz * dyz) - dxy * (dxy * dz - dyz * dxz) + dxz * (dxy * dyz - dy * dxz)
    r = min(abs(0.5 * determinant), 1.0)
    x = ROOT_START[0] + r * (ROOT_START[1] + r * (ROOT_START[2] + r * ROOT_START[3]))
    x -= ((4.0 * x * x - 3.0) * x - r) / (12.0 * x * x - 3.0)
    x -= ((4.0 * x * x - 3.0) * x - r) / (12.0 * x * x - 3.0)
    return math.copysign(2.0 * min(x, 1.0), determinant)


@njit(cache=True, error_model="numpy", inline="always")
def scaled_deviator(dx, dy, dz, yz, xz, xy, j2):
    """Deviator divided by its size sqrt(J2 / 3), the size, and its farthest root: (dx, dy, dz, yz, xz, xy, size, root).

    The first half of an eigen-solve, from `split_deviator`; J2 must not be 0.
    """
    size = math.sqrt(j2 * (1.0 / 3.0))
    scale = 1.0 / size
    dx *= scale
    dy *= scale
    dz *= scale
    yz *= scale
    xz *= scale
    xy *= scale
    return dx, dy, dz, yz, xz, xy, size, _farthest_root(dx, dy, dz, yz, xz, xy)


@njit(cache=True, error_model="numpy", inline="always")
def extreme_stresses(mean, size, root):
    """Largest and smallest principal value, and a bound of their error: (s1, s3, error), from `scaled_deviator`.

    No directions are computed. The bound is loose (MAX_FAST_ERROR of the deviator), for tests that may err on one side.
    """
    half_gap = SQRT3 * math.sqrt(max(0.0, 1.0 - 0.25 * root * root))
    if root > 0.0:
        return mean + size * root, mean - size * (0.5 * root + half_gap), size * MAX_FAST_ERROR
    return mean + size * (half_gap - 0.5 * root), mean + size * root, size * MAX_FAST_ERROR


@njit(cache=True, error_model="numpy")
def directions_from_root(mean, size, root, dx, dy, dz, yz, xz, xy):
    """The second half of an eigen-solve, from `scaled_deviator`: what `principal_directions` returns."""
    # Its direction v: the adjugate of (deviator - root) is a multiple of v v^T of size 3 to 9; take its largest column.
    bx = dx - root
    by = dy - root
    bz = dz - root
    axx = by * bz - yz * yz
    ayy = bx * bz - xz * xz
    azz = bx * by - xy * xy
    ayz = xy * xz - bx * yz
    axz = xy * yz - by * xz
    axy = xz * yz - bz * xy
    first, second = (axx >= ayy) & (axx >= azz), ayy >= azz
    vx = choose(first, axx, choose(second, axy, axz))
    vy = choose(first, axy, choose(second, ayy, ayz))
    vz = choose(first, axz, choose(second, ayz, azz))
    length = 1.0 / math.sqrt(vx * vx + vy * vy + vz * vz)
    vx *= length
    vy *= length
    vz *= length

    # Two directions p, q across v, without a branch (Duff et al. 2017, J. Comput. Graph. Tech. 6, 1).
    sign = math.copysign(1.0, vz)
    a = -1.0 / (sign + vz)
    b = vx * vy * a
    px, py, pz = 1.0 + sign * vx * vx * a, sign * b, -sign * vx
    qx, qy, qz = b, sign + vy * vy * a, -vy

    # The 2 x 2 problem in their plane, by one Jacobi rotation (cosine, sine).
    ux = dx * px + xy * py + xz * pz
    uy = xy * px + dy * py + yz * pz
    uz = xz * px + yz * py + dz * pz
    wx = dx * qx + xy * qy + xz * qz
    wy = xy * qx + dy * qy + yz * qz
    wz = xz * qx + yz * qy + dz * qz
    pp = px * ux + py * uy + pz * uz
    qq = qx * wx + qy * wy + qz * wz
    pq = px * wx + py * wy + pz * wz
    half_difference = 0.5 * (pp - qq)
    half_gap = math.sqrt(half_difference * half_difference + pq * pq)
    apart = half_gap > 0.0
    cosine = choose(apart, math.sqrt(0.5 * (1.0 + abs(half_difference) / half_gap)), 1.0)
    sine = choose(apart, 0.5 * pq / (half_gap * cosine), 0.0)
    sine = choose(half_difference < 0.0, -sine, sine)
    # (cosine, sine) belongs to the larger value of the plane where pp >= qq, else to the smaller
    cx, cy, cz = cosine * px + sine * qx, cosine * py + sine * qy, cosine * pz + sine * qz
    ex, ey, ez = cosine * qx - sine * px, cosine * qy - sine * py, cosine * qz - sine * pz
    middle = 0.5 * (pp + qq)
    high = mean + size * (middle + half_gap)
    low = mean + size * (middle - half_gap)
    farthest = mean + size * root
    tensile = root > 0.0  # the farthest is the first; else it is the third, and the plane's larger one the first
    turned = half_difference < 0.0
    larger = choose(turned, ex, cx), choose(turned, ey, cy), choose(turned, ez, cz)
    smaller = choose(turned, cx, ex), choose(turned, cy, ey), choose(turned, cz, ez)
    return (
        choose(tensile, farthest, high),
        choose(tensile, high, low),
        choose(tensile, low, farthest),
        (choose(tensile, vx, larger[0]), choose(tensile, vy, larger[1]), choose(tensile, vz, larger[2])),
        (choose(tensile, smaller[0], vx), choose(tensile, smaller[1], vy), choose(tensile, smaller[2], vz)),
    )


@njit(cache=True, error_model="numpy")
def principal_directions(xx, yy, zz, yz, xz, xy):
    """Principal values and the directions of the first and the third: (s1, s2, s3, (n1), (n3)), each direction x, y, z.

    s1 >= s2 >= s3. Directions are unit vectors at right angles, of arbitrary sign; the second is n3 x n1. Values and
    rebuilt tensor are good to a few round-offs of the largest entry. An isotropic tensor gets the axes x and z.
    """
    mean, dx, dy, dz, j2 = split_deviator(xx, yy, zz, yz, xz, xy)
    if j2 == 0.0:
        return mean, mean, mean, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    dx, dy, dz, yz, xz, xy, size, root = scaled_deviator(dx, dy, dz, yz, xz, xy, j2)
    return directions_from_root(mean, size, root, dx, dy, dz, yz, xz, xy)


@njit(cache=True, error_model="numpy")
def principal_stresses(xx, yy, zz, yz, xz, xy):
    """Principal values (s1, s2, s3), s1 >= s2 >= s3, to a few round-offs of the largest entry."""
    s1, s2, s3, _, _ = principal_directions(xx, yy, zz, yz, xz, xy)
    return s1, s2, s3


@njit(cache=True, error_model="numpy", inline="always")
def tensor_from_principal(s1, s2, s3, n1, n3):
    """Tensor (xx, yy, zz, yz, xz, xy) with these principal values and first and third directions.

    s2 I + (s1 - s2) n1 n1 + (s3 - s2) n3 n3: two dyads, and shear exactly zero where the three values agree.
    """
    a = s1 - s2
    b = s3 - s2
    return (
        s2 + a * n1[0] * n1[0] + b * n3[0] * n3[0],
        s2 + a * n1[1] * n1[1] + b * n3[1] * n3[1],
        s2 + a * n1[2] * n1[2] + b * n3[2] * n3[2],
        a * n1[1] * n1[2] + b * n3[1] * n3[2],
        a * n1[0] * n1[2] + b * n3[0] * n3[2],
        a * n1[0] * n1[1] + b * n3[0] * n3[1],
    )
