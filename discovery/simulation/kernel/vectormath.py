"""Elementary functions that the compiler can vectorise: branch-free, a few ulp, no library call.

The ordinary ones are calls into the C library, which end vectorisation across lanes unless a vendor's vector library
is installed. Coefficients are those of the Cephes library (Moshier 1989), public domain.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

__all__ = ["atan2", "barrier", "cos", "exp", "rolled", "sin", "sqrt"]

_fast = njit(forceinline=True, fastmath={"contract", "reassoc", "nsz", "arcp"})

_TWO_OVER_PI = 2 / math.pi
_ONE_OVER_LN2 = 1 / math.log(2)
# ln 2 in two parts, as pi/2 below.
_L1, _L2 = 6.93145751953125e-1, 1.42860682030941723212e-6
# pi/2 in two parts, so that the reduction keeps its digits.
_P1, _P2 = 1.5707963267948966, 6.123233995736766e-17


@intrinsic
def barrier(context):
    """Make the compiler leave numbers in memory here; no instruction.

    Else it carries them in registers past every branch between two loops, whether the branch is taken or not.
    """

    def build(context, builder, signature, arguments):
        builder.fence("acq_rel", "singlethread")
        return context.get_dummy_value()

    return types.none(), build


@intrinsic
def rolled(context):
    """Keep the compiler from unrolling short loops of the function that calls this before it vectorises them.

    Unrolled, they stay scalar in part, and lanes may be rounded differently.
    """

    def build(context, builder, signature, arguments):
        builder.function.attributes.add("optsize")
        return context.get_dummy_value()

    return types.none(), build


@_fast
def _sin_poly(z, z2):
    """Sine on [-pi/4, pi/4]."""
    p = 1.58962301576546568060e-10
    p = p * z2 - 2.50507477628578072866e-8
    p = p * z2 + 2.75573136213857245213e-6
    p = p * z2 - 1.98412698295895385996e-4
    p = p * z2 + 8.33333333332211858878e-3
    p = p * z2 - 1.66666666666666307295e-1
    return z + z * z2 * p


@_fast
def _cos_poly(z2):
    """Cosine on [-pi/4, pi/4]."""
    p = -1.13585365213876817300e-11
    p = p * z2 + 2.08757008419747316778e-9
    p = p * z2 - 2.75573141792967388112e-7
    p = p * z2 + 2.48015872888517045348e-5
    p = p * z2 - 1.38888888888730564116e-3
    p = p * z2 + 4.16666666666665929218e-2
    return 1.0 - 0.5 * z2 + z2 * z2 * p


@_fast
def _sin_quadrant(x, shift):
    n = np.floor(x * _TWO_OVER_PI + 0.5)
    z = (x - n * _P1) - n * _P2
    z2 = z * z
    m = n + shift
    quadrant = m - 4.0 * np.floor(m * 0.25)
    odd = quadrant - 2.0 * np.floor(quadrant * 0.5)
    sign = 1.0 - 2.0 * np.floor(quadrant * 0.5)
    value = _cos_poly(z2) if odd > 0.5 else _sin_poly(z, z2)
    return sign * value


@_fast
def sin(x):
    """Return the sine of an angle [rad], |x| up to 1e5."""
    return _sin_quadrant(x, 0.0)


@_fast
def cos(x):
    """Return the cosine of an angle [rad], |x| up to 1e5."""
    return _sin_quadrant(x, 1.0)


@intrinsic
def _power_of_two(context, n):
    """Return 2^n of a whole number in floating point, -1022 <= n <= 1023."""

    def build(context, builder, signature, arguments):
        # Adding 1.5 2^52 brings n, with the bias of exponents, into the low bits of the mantissa.
        shifted = builder.fadd(arguments[0], arguments[0].type(1.5 * 2.0**52 + 1023.0))
        whole = context.get_value_type(types.int64)
        bits = builder.bitcast(shifted, whole)
        return builder.bitcast(builder.shl(bits, whole(52)), shifted.type)

    return types.float64(types.float64), build


@_fast
def exp(x):
    """Return the exponential; that of -708 below it and of 709 above."""
    x = -708.0 if x < -708.0 else x
    x = 709.0 if x > 709.0 else x
    n = np.floor(x * _ONE_OVER_LN2 + 0.5)
    z = (x - n * _L1) - n * _L2
    z2 = z * z
    p = z * ((1.26177193074810590878e-4 * z2 + 3.02994407707441961300e-2) * z2 + 9.99999999999999999910e-1)
    q = ((3.00198505138664455042e-6 * z2 + 2.52448340349684104192e-3) * z2 + 2.27265548208155028766e-1) * z2 + 2.0
    return (1.0 + 2.0 * (p / (q - p))) * _power_of_two(n)  # type: ignore[call-arg]


@_fast
def sqrt(x):
    """Return the square root; zero for tiny negative round-off."""
    return math.sqrt(x if x > 0.0 else 0.0)


@_fast
def _atan_reduced(x):
    """Arc tangent for 0 <= x <= tan(pi/8) or so."""
    z = x * x
    p = (
        ((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z - 7.500855792314704667340e1) * z
        - 1.228866684490136173410e2
    ) * z - 6.485021904942025371773e1
    q = (
        (((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z + 4.328810604912902668951e2) * z
        + 4.853903996359136964868e2
    ) * z + 1.945506571482613964425e2
    return x + x * (z * p / q)


@_fast
def atan2(y, x):
    """Return the angle of (x, y) [rad], in (-pi, pi]."""
    ax, ay = abs(x), abs(y)
    big = ax if ax > ay else ay
    small = ay if ax > ay else ax
    ratio = small / (big if big > 0.0 else 1.0)
    # Beyond tan(pi/8) turn by pi/4.
    turned = (ratio - 1.0) / (ratio + 1.0)
    steep = ratio > 0.4142135623730950488
    reduced = turned if steep else ratio
    angle = _atan_reduced(reduced) + (0.7853981633974483 if steep else 0.0)
    angle = angle if ax >= ay else 1.5707963267948966 - angle
    angle = angle if x >= 0.0 else 3.141592653589793 - angle
    return angle if y >= 0.0 else -angle
