"""Elementary functions that the compiler can vectorise: branch-free, a few ulp, no library call.

The ordinary ones are calls into the C library, which end vectorisation across lanes unless a vendor's vector library
is installed. Coefficients are those of the Cephes library (Moshier 1989), public domain.
"""

from __future__ import annotations

import math

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

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

    Unrolled, they stay scalar in part, and lanes may be rounded differently. Vectors may be as wide as registers are:
    by default the compiler takes half of them on some processors, and a step up to 1.5 times as long.
    """

    def build(context, builder, signature, arguments):
        attributes = builder.function.attributes
        attributes.add("optsize")
        # One of the target, which the list of common ones does not know.
        set.add(attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), build


@intrinsic
def put(context, out, where, w, row, count):
    """Copy `count` numbers of an array from `row` on to out[j, k], from `place` on, where `where` is (j, k, place).

    A loop would take them one by one, for the compiler cannot know that the arrays do not overlap.
    """

    def build(context, builder, signature, arguments):
        array, indices, source, first, length = arguments
        kind = signature.args[0]
        target = context.make_array(kind)(context, builder, array)
        place = [builder.extract_value(indices, k) for k in range(3)]
        there = cgutils.get_item_pointer(context, builder, kind, target, place)
        here = builder.gep(context.make_array(signature.args[2])(context, builder, source).data, [first], inbounds=True)
        cgutils.raw_memcpy(builder, there, here, length, 8)
        return context.get_dummy_value()

    whole = types.int64
    return types.none(out, types.UniTuple(whole, 3), w, whole, whole), build


@intrinsic
def _number(context, whole):
    """Return the floating-point number that has given bits."""

    def build(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], context.get_value_type(types.float64))

    return types.float64(types.int64), build


@intrinsic
def _bits(context, number):
    """Return the bits of a floating-point number."""

    def build(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], context.get_value_type(types.int64))

    return types.int64(types.float64), build


@intrinsic
def _nearest(context, x, scale):
    """Return the whole number nearest to a product, and bits whose lowest are those of it; |product| < 2^51.

    A sum with 1.5 2^52 has no digits behind the point. Its own flags keep the compiler from taking the sum apart.
    """

    def build(context, builder, signature, arguments):
        big = arguments[0].type(1.5 * 2.0**52)
        product = builder.fmul(*arguments, flags=("contract",))
        shifted = builder.fadd(product, big, flags=("contract",))
        whole = builder.fsub(shifted, big, flags=("contract",))
        bits = builder.bitcast(shifted, context.get_value_type(types.int64))
        return context.make_tuple(builder, signature.return_type, (whole, bits))

    return types.Tuple((types.float64, types.int64))(types.float64, types.float64), build


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
    n, bits = _nearest(x, _TWO_OVER_PI)  # type: ignore[call-arg, var-annotated]
    z = (x - n * _P1) - n * _P2
    z2 = z * z
    quadrant = bits + shift
    value = _cos_poly(z2) if quadrant & 1 else _sin_poly(z, z2)
    # The second lowest bit becomes the sign.
    return _number(_bits(value) ^ ((quadrant & 2) << 62))


@_fast
def sin(x):
    """Return the sine of an angle [rad], |x| up to 1e5."""
    return _sin_quadrant(x, 0)


@_fast
def cos(x):
    """Return the cosine of an angle [rad], |x| up to 1e5."""
    return _sin_quadrant(x, 1)


@_fast
def exp(x):
    """Return the exponential; that of -650 below it and of 709 above.

    From -708 on it has no full digits, and products with the smallest numbers that have them take ten times the time.
    """
    x = -650.0 if x < -650.0 else x
    x = 709.0 if x > 709.0 else x
    n, bits = _nearest(x, _ONE_OVER_LN2)  # type: ignore[call-arg, var-annotated]
    z = (x - n * _L1) - n * _L2
    z2 = z * z
    p = z * ((1.26177193074810590878e-4 * z2 + 3.02994407707441961300e-2) * z2 + 9.99999999999999999910e-1)
    q = ((3.00198505138664455042e-6 * z2 + 2.52448340349684104192e-3) * z2 + 2.27265548208155028766e-1) * z2 + 2.0
    # The bits of 2^n.
    return (1.0 + 2.0 * (p / (q - p))) * _number((bits + 1023) << 52)


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
    # Beyond tan(pi/8) turn by pi/4.
    steep = small > 0.4142135623730950488 * big
    above = small - big if steep else small
    below = small + big if steep else big
    reduced = above / (below if below > 0.0 else 1.0)
    angle = _atan_reduced(reduced) + (0.7853981633974483 if steep else 0.0)
    angle = angle if ax >= ay else 1.5707963267948966 - angle
    angle = angle if x >= 0.0 else 3.141592653589793 - angle
    return angle if y >= 0.0 else -angle
