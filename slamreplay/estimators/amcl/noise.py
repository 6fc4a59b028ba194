"""Numbers of the particle filter's loops: random ones, and functions that compile to vectors.

A random number is a function of key, step and particle alone, so that neither the order of work
nor the number of threads changes one bit. Noise is float32: what that loses is far below it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_F, _I, _U, _U64 = np.float32, np.int32, np.uint32, np.uint64
#: Of Philox, and its fewest rounds that pass every test of TestU01's BigCrush.
_M0, _M1, _W0, _W1, _ROUNDS = _U64(0xD2511F53), _U64(0xCD9E8D57), _U(0x9E3779B9), _U(0xBB67AE85), 7
#: Multiply and add may be fused, and no input is NaN: else loops over particles stay scalar.
_FAST = {"contract", "nsz", "nnan"}


@njit(inline="always")  # a loop that calls it is vectorised only so
def philox(particle, step, key0, key1):  # type: ignore[no-untyped-def]
    """Four random uint32 of a counter: Philox 4x32 (Salmon et al. 2011, SC11, section 3.3)."""
    a, b, c, d = _U(particle), _U(step), _U(0), _U(0)
    k0, k1 = _U(key0), _U(key1)
    for _ in range(_ROUNDS):
        p, q = _M0 * _U64(a), _M1 * _U64(c)
        a, c = _U(_U(q >> _U64(32)) ^ b ^ k0), _U(_U(p >> _U64(32)) ^ d ^ k1)
        b, d = _U(q), _U(p)
        k0, k1 = _U(k0 + _W0), _U(k1 + _W1)
    return a, b, c, d


@njit(inline="always", fastmath=_FAST)
def log(value):  # type: ignore[no-untyped-def]
    """Natural logarithm of a positive float32 to 1e-7 (the polynomial of Cephes' logf)."""
    bits = _F(value).view(np.int32)
    exponent = (bits - _I(0x3F3504F3)) >> _I(23)
    m = _I(bits - (_I(exponent) << _I(23))).view(np.float32) - _F(1.0)
    p = _F(7.0376836292e-2)
    p = p * m - _F(1.1514610310e-1)
    p = p * m + _F(1.1676998740e-1)
    p = p * m - _F(1.2420140846e-1)
    p = p * m + _F(1.4249322787e-1)
    p = p * m - _F(1.6668057665e-1)
    p = p * m + _F(2.0000714765e-1)
    p = p * m - _F(2.4999993993e-1)
    p = p * m + _F(3.3333331174e-1)
    return _F(_I(exponent)) * _F(0.6931471805599453) + (m + m * m * (m * p - _F(0.5)))


@njit(inline="always", fastmath=_FAST)
def normal(bits):  # type: ignore[no-untyped-def]
    """A standard normal number of a random uint32: the quantile that its 31 lower bits say.

    By the inverse of the error function (Giles 2010, GPU Computing Gems, chapter 10, table 1).
    """
    tail = (_F(_I(bits & _U(0x7FFFFFFF))) + _F(0.5)) * _F(2.0**-31)
    w = -log(tail * (_F(2.0) - tail))
    a = w - _F(2.5)
    p = _F(2.81022636e-08)
    p = p * a + _F(3.43273939e-07)
    p = p * a - _F(3.5233877e-06)
    p = p * a - _F(4.39150654e-06)
    p = p * a + _F(0.00021858087)
    p = p * a - _F(0.00125372503)
    p = p * a - _F(0.00417768164)
    p = p * a + _F(0.246640727)
    p = p * a + _F(1.50140941)
    b = np.sqrt(max(w, _F(0.0))) - _F(3.0)
    q = _F(-0.000200214257)
    q = q * b + _F(0.000100950558)
    q = q * b + _F(0.00134934322)
    q = q * b - _F(0.00367342844)
    q = q * b + _F(0.00573950773)
    q = q * b - _F(0.0076224613)
    q = q * b + _F(0.00943887047)
    q = q * b + _F(1.00167406)
    q = q * b + _F(2.83297682)
    size = _F(1.4142135623730951) * (_F(1.0) - tail) * (p if w < _F(5.0) else q)
    return size * (_F(1.0) - _F(2.0) * _F(_I(bits >> _U(31))))


@njit(inline="always", fastmath=_FAST)
def cos_sin(angle):  # type: ignore[no-untyped-def]
    """Cosine and sine to 1e-15 of an angle of a few turns at most: Taylor's within pi/4."""
    quarter = np.floor(angle * (2.0 / np.pi) + 0.5)
    r = (angle - quarter * 1.5707963267948966) - quarter * 6.123233995736766e-17
    z = r * r
    s = 1.0 / 6227020800.0 - z * (1.0 / 1307674368000.0)
    s = (1.0 / 362880.0) - z * ((1.0 / 39916800.0) - z * s)
    sin = r - r * z * ((1.0 / 6.0) - z * ((1.0 / 120.0) - z * ((1.0 / 5040.0) - z * s)))
    c = 1.0 / 479001600.0 - z * (1.0 / 87178291200.0 - z * (1.0 / 20922789888000.0))
    c = (1.0 / 40320.0) - z * ((1.0 / 3628800.0) - z * c)
    cos = 1.0 - z * (0.5 - z * ((1.0 / 24.0) - z * ((1.0 / 720.0) - z * c)))
    turn = _I(quarter)
    is_odd = (turn & _I(1)) != 0
    x, y = (sin if is_odd else cos), (cos if is_odd else sin)
    x = -x if ((turn + _I(1)) & _I(2)) != 0 else x
    y = -y if (turn & _I(2)) != 0 else y
    return x, y


@njit(cache=True, fastmath=_FAST, error_model="numpy")
def normals(number, key0, key1, out):  # type: ignore[no-untyped-def]
    """Fill (3, N) float32 with the standard normal numbers of the step that has this number."""
    for i in range(out.shape[1]):
        a, b, c, _ = philox(i, number, key0, key1)
        out[0, i], out[1, i], out[2, i] = normal(a), normal(b), normal(c)
