"""The filter's loop over events, compiled; tests hold each step against estimators.kalman.

The state is x, y, yaw; for each of the `slots` the lasting errors of one thing: of its range (as a
share of it) and of its bearing; and last, where there is a gyroscope, by how much wheels tell turns
too small, as a share of them (a wrong wheel base), and its bias in rad/s. A thing seen once more
takes its own slot, a new one a free slot or the one not seen for longest.

One module, longer than most: numba keeps a compiled caller though a function that it calls from
another file has changed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: What became of a measurement.
UNUSED, ACCEPTED, REJECTED = 0, 1, 2
#: A thing nearer than this has no bearing, m.
NEAREST_M = 0.05
_TWO_PI = 2.0 * np.pi
#: A turn of the wheels that the gyroscope contradicts is given this many times the squared gap as
#: its variance.
_CONTRADICTED = 100.0


@njit(cache=True)
def wrapped(angle):  # type: ignore[no-untyped-def]
    """An angle brought into [-pi, pi)."""
    return (angle + np.pi) % _TWO_PI - np.pi


@njit(cache=True)
def clear(H):  # type: ignore[no-untyped-def]
    """Fill a matrix with zeros."""
    for i in range(H.shape[0]):
        for j in range(H.shape[1]):
            H[i, j] = 0.0


@njit(cache=True)
def of_moving(things, count, driven, turned, least_m, least_rad):  # type: ignore[no-untyped-def]
    """(M,) which sightings come after some motion since the last one of the same thing.

    Args: things (M,) below `count`; driven and turned (M,) on all the way, m and rad.
    """
    keep = np.zeros(len(things), dtype=np.bool_)
    last = np.full(count, -1)
    for i in range(len(things)):
        before = last[things[i]]
        if (
            before < 0
            or driven[i] - driven[before] >= least_m
            or turned[i] - turned[before] >= least_rad
        ):
            keep[i] = True
            last[things[i]] = i
    return keep


@njit(cache=True)
def predict(x, P, step, Q):  # type: ignore[no-untyped-def]
    """Carry pose and covariance over an increment, in place.

    Args: x (n,) and P (n, n), of which the first three are x y yaw along the parent's axes; step
    (3,) and its covariance Q (3, 3) in axes of the base before it.
    """
    cos, sin = np.cos(x[2]), np.sin(x[2])
    dx, dy = cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]
    x[0] += dx
    x[1] += dy
    x[2] = wrapped(x[2] + step[2])
    n = len(x)
    for j in range(n):  # F P: an error of heading moves the end of the step sideways
        P[0, j] -= dy * P[2, j]
        P[1, j] += dx * P[2, j]
    for i in range(n):
        P[i, 0] -= dy * P[i, 2]
        P[i, 1] += dx * P[i, 2]
    a, b, d = Q[0, 0], Q[0, 1], Q[1, 1]
    P[0, 0] += cos * cos * a - 2.0 * cos * sin * b + sin * sin * d
    P[1, 1] += sin * sin * a + 2.0 * cos * sin * b + cos * cos * d
    mixed = cos * sin * (a - d) + (cos * cos - sin * sin) * b
    P[0, 1] += mixed
    P[1, 0] += mixed
    u, v = cos * Q[0, 2] - sin * Q[1, 2], sin * Q[0, 2] + cos * Q[1, 2]
    P[0, 2] += u
    P[2, 0] += u
    P[1, 2] += v
    P[2, 1] += v
    P[2, 2] += Q[2, 2]


@njit(cache=True)
def fade(x, P, end, keep, variance):  # type: ignore[no-untyped-def]
    """Let lasting errors forget, in place: each keeps a share `keep` of itself, in [0, 1].

    They are the states from 3 to `end`; `variance` (2,) is what the errors of range and bearing
    have without any sighting.
    """
    for i in range(3, end):
        x[i] *= keep
        for j in range(3):
            P[i, j] *= keep
            P[j, i] *= keep
        for j in range(end, len(x)):
            P[i, j] *= keep
            P[j, i] *= keep
        for j in range(3, end):
            P[i, j] *= keep * keep
        P[i, i] += (1.0 - keep * keep) * variance[(i - 3) % 2]


@njit(cache=True)
def scale_turn(x, P, yaw, step):  # type: ignore[no-untyped-def]
    """Correct a predicted step (3,) by the share that wheels lack of turns, in place.

    The turn is spread evenly along the step, so that half of what it lacks turns the way itself.
    """
    n = len(x)
    w = n - 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx, dy = cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]
    by_x, by_y, by_yaw = -0.5 * step[2] * dy, 0.5 * step[2] * dx, step[2]
    x[0] += by_x * x[w]
    x[1] += by_y * x[w]
    x[2] += by_yaw * x[w]
    for j in range(n):
        P[0, j] += by_x * P[w, j]
        P[1, j] += by_y * P[w, j]
        P[2, j] += by_yaw * P[w, j]
    for i in range(n):
        P[i, 0] += by_x * P[i, w]
        P[i, 1] += by_y * P[i, w]
        P[i, 2] += by_yaw * P[i, w]
    x[2] = wrapped(x[2])


@njit(cache=True)
def turn_by_gyro(x, P, yaw, step, Q, turned, variance, dt, gate, out):  # type: ignore[no-untyped-def]
    """Hold the turn of the wheels in a step against the gyroscope's, and take both in, in place.

    The step has been predicted already, so the noise of its turn is part of the error of the state
    and of the innovation: a Kalman filter with correlated noises (Bar-Shalom, Li, Kirubarajan 2001,
    chapter 8). Where the two contradict each other the gyroscope is believed, for wheels slip
    (gyrodometry, Borenstein and Feng 1996), and the way of that step is as uncertain as it is long.

    Args: state and covariance as `predict` and `scale_turn` left them, the heading before, the step
    (3,) as the wheels tell it with its covariance Q (3, 3), the gyroscope's integral `turned` over
    `dt` seconds and its variance, bias apart, and the largest NIS of wheels that agree. `out` (2,)
    becomes residual (wheels minus gyroscope) and its variance. Returns ACCEPTED or REJECTED, of the
    turn of the wheels.
    """
    n = len(x)
    w, b = n - 2, n - 1
    gap = wrapped((1.0 + x[w]) * step[2] - (turned - x[b] * dt))
    cos, sin = np.cos(yaw), np.sin(yaw)
    cross = np.zeros(n)
    cross[0] = cos * Q[0, 2] - sin * Q[1, 2]
    cross[1] = sin * Q[0, 2] + cos * Q[1, 2]
    cross[2] = Q[2, 2]
    for i in range(n):
        cross[i] += P[i, w] * step[2] + P[i, b] * dt
    S = Q[2, 2] + variance + (cross[w] * step[2] + cross[b] * dt)
    out[0], out[1] = gap, S
    status = ACCEPTED
    if gap * gap > gate * S:
        status = REJECTED
        S += _CONTRADICTED * gap * gap
        cross[2] += _CONTRADICTED * gap * gap
        P[2, 2] += _CONTRADICTED * gap * gap
        dx, dy = cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]
        P[0, 0] += dx * dx
        P[0, 1] += dx * dy
        P[1, 0] += dx * dy
        P[1, 1] += dy * dy
    for i in range(n):
        x[i] -= cross[i] / S * gap
    x[2] = wrapped(x[2])
    for i in range(n):
        for j in range(n):
            P[i, j] -= cross[i] * cross[j] / S
    return status


@njit(cache=True)
def of_point(x, lever, H, expected):  # type: ignore[no-untyped-def]
    """Where a point at `lever` (2,) in the base should be: fills in `expected` (2,), H (2, n)."""
    clear(H)
    cos, sin = np.cos(x[2]), np.sin(x[2])
    off_x, off_y = cos * lever[0] - sin * lever[1], sin * lever[0] + cos * lever[1]
    expected[0], expected[1] = x[0] + off_x, x[1] + off_y
    H[0, 0], H[0, 2] = 1.0, -off_y
    H[1, 1], H[1, 2] = 1.0, off_x


@njit(cache=True)
def of_near(x, place, m, H, expected):  # type: ignore[no-untyped-def]
    """What a near thing tells: for m = 3 the pose itself, for m = 2 its x and y in the base.

    Fills in `expected` (m,) and H (m, n); `place` (3,) is the thing's.
    """
    clear(H)
    if m == 3:
        for r in range(3):
            expected[r] = x[r]
            H[r, r] = 1.0
        return
    cos, sin = np.cos(x[2]), np.sin(x[2])
    away_x, away_y = place[0] - x[0], place[1] - x[1]
    expected[0], expected[1] = cos * away_x + sin * away_y, cos * away_y - sin * away_x
    H[0, 0], H[0, 1], H[0, 2] = -cos, -sin, expected[1]
    H[1, 0], H[1, 1], H[1, 2] = sin, -cos, -expected[0]


@njit(cache=True)
def measurement(x, place, slot, m, H, expected):  # type: ignore[no-untyped-def]
    """What a thing at `place` (3,) should look like from the state: `expected` (m,) and H (m, n).

    Both are filled in: range (with its lasting error), bearing, and for m = 3 the heading.
    """
    clear(H)
    away_x, away_y = place[0] - x[0], place[1] - x[1]
    reach = max(np.hypot(away_x, away_y), NEAREST_M)
    share = x[slot] if slot > 0 else 0.0
    expected[0] = reach * (1.0 + share)
    H[0, 0] = -away_x / reach * (1.0 + share)
    H[0, 1] = -away_y / reach * (1.0 + share)
    expected[1] = np.arctan2(away_y, away_x) - x[2]
    H[1, 0] = away_y / (reach * reach)
    H[1, 1] = -away_x / (reach * reach)
    H[1, 2] = -1.0
    if slot > 0:
        H[0, slot] = reach
        H[1, slot + 1] = 1.0
        expected[1] += x[slot + 1]
    if m == 3:
        expected[2] = place[2] - x[2]
        H[2, 2] = -1.0


@njit(cache=True)
def times_rows(P, H, m, out):  # type: ignore[no-untyped-def]
    """Fill in `out` (m, n) with H P for the first m rows of a sparse H (m, n)."""
    n = P.shape[0]
    for r in range(m):
        for j in range(n):
            out[r, j] = 0.0
        for i in range(n):
            if H[r, i] != 0.0:
                for j in range(n):
                    out[r, j] += H[r, i] * P[i, j]


@njit(cache=True)
def innovate(P, H, R, m, HP, S):  # type: ignore[no-untyped-def]
    """Fill in HP (m, n) and S = H P H' + R (m, m)."""
    times_rows(P, H, m, HP)
    for r in range(m):
        for c in range(m):
            total = R[r, c]
            for i in range(P.shape[0]):
                total += HP[r, i] * H[c, i]
            S[r, c] = total


@njit(cache=True)
def lower(S, m, L):  # type: ignore[no-untyped-def]
    """Fill in the Cholesky factor L (m, m) of S; False where S is not positive definite."""
    for i in range(m):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                L[i, i] = np.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True


@njit(cache=True)
def squared(L, residual, m):  # type: ignore[no-untyped-def]
    """|L^-1 residual|^2."""
    white = np.empty(m)
    total = 0.0
    for i in range(m):
        value = residual[i]
        for k in range(i):
            value -= L[i, k] * white[k]
        white[i] = value / L[i, i]
        total += white[i] * white[i]
    return total


@njit(cache=True)
def gain_of(HP, L, m, K):  # type: ignore[no-untyped-def]
    """Fill in the gain K (m, n), transposed: each column solves L L' k = HP[:, i]."""
    for i in range(HP.shape[1]):
        for r in range(m):
            value = HP[r, i]
            for k in range(r):
                value -= L[r, k] * K[k, i]
            K[r, i] = value / L[r, r]
        for r in range(m - 1, -1, -1):
            value = K[r, i]
            for k in range(r + 1, m):
                value -= L[k, r] * K[k, i]
            K[r, i] = value / L[r, r]


@njit(cache=True)
def less_outer(P, U, V, m):  # type: ignore[no-untyped-def]
    """Subtract from P (n, n) the product U' V of the first m rows (m, n), in place."""
    n = P.shape[0]
    for r in range(m):
        for i in range(n):
            for j in range(n):
                P[i, j] -= U[r, i] * V[r, j]


@njit(cache=True)
def correct(x, P, H, R, m, HP, L, residual):  # type: ignore[no-untyped-def]  # noqa: C901
    """Take a measurement in, in place: Joseph's form (I - K H) P (I - K H)' + K R K'.

    With A = P - K H P this is A - (A H' - K R) K', from left to right; A H' = K R only for an
    exact gain, and that the form forgives one that is not is what it is for.
    """
    n = len(x)
    K, rest = np.empty((m, n)), np.empty((m, n))
    gain_of(HP, L, m, K)
    for r in range(m):
        for i in range(n):
            x[i] += K[r, i] * residual[r]
    x[2] = wrapped(x[2])
    less_outer(P, K, HP, m)
    for r in range(m):
        for i in range(n):
            rest[r, i] = 0.0
            for c in range(m):
                rest[r, i] -= K[c, i] * R[c, r]
        for j in range(n):
            if H[r, j] != 0.0:
                for i in range(n):
                    rest[r, i] += P[i, j] * H[r, j]
    less_outer(P, rest, K, m)
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@njit(cache=True)
def slot_of(thing, holder, seen, x, P, variance):  # type: ignore[no-untyped-def]
    """Index in the state of a thing's lasting errors, made free where need be; 0 without slots.

    `holder` (slots,) says whose each slot is (-1: free), `seen` (slots,) at which event it was
    seen last; both are kept up to date by the caller.
    """
    oldest = -1
    for k in range(len(holder)):
        if holder[k] == thing:
            return 3 + 2 * k
        if oldest < 0 or seen[k] < seen[oldest]:
            oldest = k
    if oldest < 0:
        return 0
    holder[oldest] = thing
    at = 3 + 2 * oldest
    for i in range(at, at + 2):
        x[i] = 0.0
        for j in range(len(x)):
            P[i, j] = P[j, i] = 0.0
        P[i, i] = variance[i - at]
    return at


@njit(cache=True)
def take_in(k, m, gate, R, residual, x, P, H, HP, S, L, residual_out, S_out, moved_out):  # type: ignore[no-untyped-def]
    """Correct the state by measurement `k`, of which H and residual are known, within its gate.

    Writes residual and S of the prior, and how far the pose moves, to row `k` of the outputs;
    returns ACCEPTED or REJECTED.
    """
    innovate(P, H, R, m, HP, S)
    for r in range(m):
        residual_out[k, r] = residual[r]
        for c in range(m):
            S_out[k, r, c] = S[r, c]
    for r in range(3):
        moved_out[k, r] = 0.0
    if not lower(S, m, L) or squared(L, residual, m) > gate:
        return REJECTED
    before_x, before_y, before_yaw = x[0], x[1], x[2]
    correct(x, P, H, R, m, HP, L, residual)
    moved_out[k, 0], moved_out[k, 1] = x[0] - before_x, x[1] - before_y
    moved_out[k, 2] = wrapped(x[2] - before_yaw)
    return ACCEPTED


@njit(cache=True)
def run(  # type: ignore[no-untyped-def]  # noqa: C901 - the filter's loop
    first,
    last,
    starts,
    t_ns,
    steps,
    Q,
    turns,
    turn_variance,
    measured,
    row,
    sensed,
    R,
    dims,
    things,
    places,
    is_near,
    antenna,
    gates,
    lasting,
    lasting_s,
    bias_walk,
    patience,
    retry_ns,
    x,
    P,
    holder,
    seen,
    lost,
    xyyaw_out,
    cov_out,
    updated_out,
    residual_out,
    S_out,
    status_out,
    moved_out,
    turn_out,
    turn_status_out,
    turn_moved_out,
):
    """Run events first to last - 1; returns the first event not run, which is `last` in the end.

    It ends early behind an event at which every sighting of the last `patience[1]` ns and at
    least `patience[0]` of them were rejected, not before `retry_ns`.

    Args: `starts` says that the state is already that at the first event, and not at the one
    before it. Of the events (E,): t_ns, steps (E, 3) and Q (E, 3, 3) from the one before, `turns`
    (E,) of the gyroscope from the one before (NaN: none) and their variance `turn_variance` (E,);
    `measured` and `row` the index of what happens there or -1. Of the measurements (M,), `sensed`
    (M, 3), R (M, 3, 3), dims, and things: range, bearing and heading of a thing of the T in
    `places` (T, 3); where it `is_near` (M,) x, y and heading of the base by it, for dims = 2 its
    own x and y in the base; where the thing is -1, x and y of the `antenna` (2,). `gates`
    (4,) the largest NIS for each dimension. `lasting` (2,) variances of lasting errors,
    `lasting_s` their time constant; `bias_walk` variance of the bias after a second. The state x
    (n,), P (n, n), `holder` and `seen` (slots,), `lost` (3,): number and first time of the
    rejections in a row, and whether anything was taken in since the last row. Outputs are filled in
    by row, by measurement, and by event (`turn_*`); they and the state change in place.
    """
    n = len(x)
    end = 3 + 2 * len(holder)
    H, HP, S, L = np.zeros((3, n)), np.zeros((3, n)), np.zeros((3, 3)), np.zeros((3, 3))
    expected, residual, before = np.zeros(3), np.zeros(3), np.zeros(3)
    for e in range(first, last):
        if e > first or not starts:
            yaw = x[2]
            predict(x, P, steps[e], Q[e])
            if end > 3 and t_ns[e] > t_ns[e - 1]:
                fade(x, P, end, np.exp((t_ns[e - 1] - t_ns[e]) * 1e-9 / lasting_s), lasting)
            if n > end and t_ns[e] > t_ns[e - 1]:
                scale_turn(x, P, yaw, steps[e])
                dt = (t_ns[e] - t_ns[e - 1]) * 1e-9
                P[n - 1, n - 1] += bias_walk * dt
                if np.isfinite(turns[e]):
                    for r in range(3):
                        before[r] = x[r]
                    turn_status_out[e] = turn_by_gyro(
                        x, P, yaw, steps[e], Q[e], turns[e], turn_variance[e], dt, gates[1],
                        turn_out[e],
                    )  # fmt: skip
                    for r in range(3):
                        turn_moved_out[e, r] = x[r] - before[r]
                    turn_moved_out[e, 2] = wrapped(turn_moved_out[e, 2])
        s, k = measured[e], row[e]
        if k >= 0:
            for r in range(3):  # slices would be shorter, and take far longer to compile
                xyyaw_out[k, r] = x[r]
                for c in range(3):
                    cov_out[k, r, c] = P[r, c]
            updated_out[k] = lost[2]
            lost[2] = 0
        if s < 0:
            continue
        m, thing = dims[s], things[s]
        if thing < 0:
            of_point(x, antenna, H, expected)
        else:
            slot = slot_of(thing, holder, seen, x, P, lasting)
            if slot > 0:
                seen[(slot - 3) // 2] = e
            if is_near[s]:
                of_near(x, places[thing], m, H, expected)
            else:
                measurement(x, places[thing], slot, m, H, expected)
        for r in range(m):
            residual[r] = sensed[s, r] - expected[r]
            if thing >= 0 and (r == 2 or (r == 1 and not is_near[s])):
                residual[r] = wrapped(residual[r])
        status_out[s] = take_in(
            s, m, gates[m], R[s], residual, x, P, H, HP, S, L, residual_out, S_out, moved_out
        )
        if status_out[s] == ACCEPTED:
            lost[0], lost[2] = 0, 1
            continue
        if thing < 0:
            continue
        if lost[0] == 0:
            lost[1] = t_ns[e]
        lost[0] += 1
        silent = lost[0] >= patience[0] and t_ns[e] - lost[1] >= patience[1]
        if silent and t_ns[e] >= retry_ns:
            return e + 1
    return last
