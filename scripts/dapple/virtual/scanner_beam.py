"""A laser beam of finite width: its sub-rays, and the echoes that their hits merge into."""

import numba
import numpy as np


def beam_pattern(n_rays: int) -> np.ndarray:
    """Spread sub-rays of equal energy over a Gaussian beam.

    Parameters
    ----------
    n_rays : int
        Number of sub-rays; one lies on the axis.

    Returns
    -------
    (n_rays, 2) float64
        Places in the cross-section, in units of the radius where the irradiance is 1/e² of
        that on the axis.

    Notes
    -----
    The share of a Gaussian beam's energy inside radius r is 1 - exp(-2 r²), so radii at equal
    steps of that share carry equal energy; successive angles differ by the golden angle (Vogel
    1979), which covers the disc evenly for any number.
    """
    if n_rays == 1:
        return np.zeros((1, 2))
    inside = (np.arange(n_rays) + 0.5) / n_rays
    radius = np.sqrt(-0.5 * np.log(1.0 - inside))
    angle = np.arange(n_rays) * np.pi * (3.0 - np.sqrt(5.0))
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@numba.njit(cache=True)
def sub_rays(origin, direction, turn, pattern, aperture_radius_m, half_divergence, rays):
    """Fill in the sub-rays of every shot.

    The beam's radius is `aperture_radius_m + half_divergence * range`. Directions have length
    one along the axis, so that ray parameters are ranges along the axis.

    Parameters
    ----------
    origin, direction : (n, 3) float64
        Beam axes.
    turn : (n,) float64
        Angle by which each shot's pattern is turned [rad].
    pattern : (k, 2) float64
        From `beam_pattern`.
    aperture_radius_m, half_divergence : float
        1/e² radius at the exit [m] and its growth per metre.
    rays : (6, n * k) float32
        Overwritten: origins and directions, x, y, z each.
    """
    n_rays = len(pattern)
    for i in range(len(direction)):
        x, y, z = direction[i]
        # two unit vectors across the axis, the first one horizontal where that is possible
        across = np.sqrt(x * x + y * y)
        if across > 1e-6:
            ux, uy, uz = y / across, -x / across, 0.0
        else:
            ux, uy, uz = 1.0, 0.0, 0.0
        vx, vy, vz = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
        cosine, sine = np.cos(turn[i]), np.sin(turn[i])
        for j in range(n_rays):
            a = cosine * pattern[j, 0] - sine * pattern[j, 1]
            b = sine * pattern[j, 0] + cosine * pattern[j, 1]
            px, py, pz = a * ux + b * vx, a * uy + b * vy, a * uz + b * vz
            at = i * n_rays + j
            rays[0, at] = origin[i, 0] + aperture_radius_m * px
            rays[1, at] = origin[i, 1] + aperture_radius_m * py
            rays[2, at] = origin[i, 2] + aperture_radius_m * pz
            rays[3, at] = x + half_divergence * px
            rays[4, at] = y + half_divergence * py
            rays[5, at] = z + half_divergence * pz


@numba.njit(cache=True)
def merge_hits(
    range_m,
    triangle,
    rays,
    normal,
    brightness,
    kind,
    incidence_exponent,
    min_range_m,
    min_separation_m,
    min_energy,
):
    """Merge the hits of every shot's sub-rays into echoes.

    The two neighbouring echoes nearest to each other in range merge, again and again, until all
    are at least `min_separation_m` apart. An echo's range is the mean of its hits weighted by
    energy.

    Parameters
    ----------
    range_m : (n, k) float32
        Range of each sub-ray's hit; infinite for a miss [m].
    triangle : (n, k) uint32
        Triangle that was hit.
    rays : (6, n * k) float32
        From `sub_rays`.
    normal : (t, 3) float32
        Unit normals of triangles.
    brightness : (t,) float64
        Reflectance of triangles at normal incidence, of a white plate's.
    kind : (t,) uint8
        0, 1 or 2: what a triangle is part of.
    incidence_exponent : float
        Echo energy is proportional to the cosine of incidence to this power.
    min_range_m, min_separation_m : float
        Nearest echo; least distance between echoes [m].
    min_energy : float
        Weakest echo, of a white plate's that takes the whole beam.

    Returns
    -------
    n_echoes : (n,) int64
    echo_range_m, energy, spread_m : (n, k) float64
        Near to far; energy of a white plate's; standard deviation of range inside the echo [m].
    echo_kind : (n, k) uint8
        The kind with the largest energy.
    """
    n, k = range_m.shape
    n_echoes = np.zeros(n, np.int64)
    echo_range = np.empty((n, k))
    energy = np.empty((n, k))
    spread = np.empty((n, k))
    echo_kind = np.empty((n, k), np.uint8)
    r, e, m2 = np.empty(k), np.empty(k), np.empty(k)
    of_kind = np.empty((k, 3))
    for i in range(n):
        m = 0
        for j in range(k):
            if not min_range_m <= range_m[i, j] < np.inf:
                continue
            t, at = triangle[i, j], i * k + j
            cosine = abs(
                rays[3, at] * normal[t, 0] + rays[4, at] * normal[t, 1] + rays[5, at] * normal[t, 2]
            )
            here = brightness[t] * min(cosine, 1.0) ** incidence_exponent / k
            if here <= 0.0:
                continue
            place = m
            while place > 0 and r[place - 1] > range_m[i, j]:
                r[place], e[place] = r[place - 1], e[place - 1]
                of_kind[place] = of_kind[place - 1]
                place -= 1
            r[place], e[place] = range_m[i, j], here
            of_kind[place] = 0.0
            of_kind[place, kind[t]] = here
            m += 1
        m2[:m] = 0.0
        while m > 1:
            nearest, gap = 0, np.inf
            for j in range(m - 1):
                if r[j + 1] - r[j] < gap:
                    nearest, gap = j, r[j + 1] - r[j]
            if gap >= min_separation_m:
                break
            j, total = nearest, e[nearest] + e[nearest + 1]
            m2[j] += m2[j + 1] + e[j] * e[j + 1] / total * gap * gap
            r[j] += gap * e[j + 1] / total
            e[j] = total
            of_kind[j] += of_kind[j + 1]
            for q in range(j + 1, m - 1):
                r[q], e[q], m2[q] = r[q + 1], e[q + 1], m2[q + 1]
                of_kind[q] = of_kind[q + 1]
            m -= 1
        for j in range(m):
            if e[j] < min_energy:
                continue
            at = n_echoes[i]
            echo_range[i, at], energy[i, at] = r[j], e[j]
            spread[i, at] = np.sqrt(m2[j] / e[j])
            echo_kind[i, at] = np.argmax(of_kind[j])
            n_echoes[i] += 1
    return n_echoes, echo_range, energy, spread, echo_kind
