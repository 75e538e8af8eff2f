"""Plant area density of every voxel from the sums of its shots, by each estimator."""

import numpy as np

from dapple.structure import estimators, traversal
from dapple.structure.voxel_sums import Sums


def transmittance(sums: Sums) -> np.ndarray:
    """By the light that beams lose (`estimators.transmittance`), (v,) [m² m⁻³]."""
    moments = sums.visits[:, traversal.VISIT_MOMENTS :]
    weight = sums.hits[:, traversal.HIT_MOMENTS]
    found, met = np.zeros(len(weight)), np.flatnonzero(weight > 0)
    u, all_weight = estimators.path_nodes(moments[met], sums.u_max)
    found[met] = estimators.transmittance(
        u, all_weight, weight[met], moments[met, 0], sums.max_pad_m2_m3
    )
    return found


def ppl(sums: Sums) -> np.ndarray:
    """By maximum likelihood on potential paths (`estimators.potential_path`), (v,) [m² m⁻³]."""
    moments = sums.visits[:, traversal.VISIT_MOMENTS :]
    hit_moments = sums.hits[:, traversal.HIT_MOMENTS :]
    weight = hit_moments[:, 0]
    found, met = np.zeros(len(weight)), np.flatnonzero(weight > 0)
    u, hit_weight = estimators.path_nodes(hit_moments[met], sums.u_max)
    # Σ b·u of what passes: everything less the hits, from the first two moments.
    passing = moments[met, :2].sum(axis=1) - hit_moments[met, :2].sum(axis=1)
    found[met] = estimators.potential_path(
        u,
        hit_weight,
        weight[met],
        np.maximum(0.5 * sums.u_max * passing, 0.0),
        sums.max_pad_m2_m3,
    )
    return found


def fpl(sums: Sums) -> np.ndarray:
    """By free paths, corrected for bias (`estimators.free_path`), (v,) [m² m⁻³]."""
    return _free_path(sums)[0]


def fpl_biased(sums: Sums) -> np.ndarray:
    """By free paths as they are (`estimators.free_path`), (v,) [m² m⁻³]."""
    return _free_path(sums)[1]


def fpl_standard_error(sums: Sums) -> np.ndarray:
    """Of `fpl`, from the finite number of beams, (v,) [m² m⁻³]."""
    return _free_path(sums)[2]


def contact_frequency(sums: Sums) -> np.ndarray | None:
    """By the share of sub-voxels with a hit (`estimators.contact_frequency`), (v,) [m² m⁻³].

    None where sub-voxels were not counted.
    """
    if not (part_m := sums.settings["contact_voxel_m"]) > 0:
        return None
    with np.errstate(invalid="ignore"):
        factor = sums.visits[:, traversal.PART_FACTOR] / sums.visits[:, traversal.PARTS]
    return estimators.contact_frequency(sums.n_hit_parts, sums.n_touched_parts, factor, part_m)


def _free_path(sums: Sums) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    visits, hits = sums.visits, sums.hits
    return estimators.free_path(
        hits[:, traversal.HIT_MOMENTS],
        hits[:, traversal.HIT_FREE],
        visits[:, traversal.FREE],
        visits[:, traversal.VISIT_MOMENTS],
        visits[:, traversal.N_SHOTS],
    )
