"""Leaf density from contact frequency, corrected by how well the laser covered each cell."""

from dataclasses import dataclass

import numpy as np

from dapple.structure.leaf_angles import projection
from dapple.survey.shadow import in_cells
from dapple.survey.voxel_status import HIT, UNSEEN

CLASSES = ("full", "80-100", "60-80", "40-60", "20-40", "0-20")
"""Share of a cell's voxels that were hit or passed [%]."""

NEVER = len(CLASSES)
"""Number of the class of cells that no beam reached."""

_NEARLY_FULL = 1 - 1e-9


@dataclass(frozen=True)
class Cells:
    """What a scan found in each cell, beside what is there.

    Attributes
    ----------
    contact : (nx, ny, nz) float64
        Contact frequency n₁/(n₁ + n_p); 0 where no beam came.
    coverage_class : (nx, ny, nz) int64
        Position in `CLASSES`, or NEVER.
    by_angle : (nx, ny, nz) float64
        Contact frequency as leaf area density, corrected for the leaves' angle [m² m⁻³].
    true_share : (nx, ny, nz) float64
        Share of voxels that hold leaf or wood.
    true_density : (nx, ny, nz) float64
        Leaf area density [m² m⁻³].
    voxel_size_m : float
        Edge of the voxels that contact frequency counts [m].
    """

    contact: np.ndarray
    coverage_class: np.ndarray
    by_angle: np.ndarray
    true_share: np.ndarray
    true_density: np.ndarray
    voxel_size_m: float

    @property
    def contact_density(self) -> np.ndarray:
        """Contact frequency as leaf area density of leaves that face the beams [m² m⁻³]."""
        return self.contact / self.voxel_size_m

    @property
    def even(self) -> np.ndarray:
        """Every other cell, like one colour of a chessboard."""
        return np.indices(self.contact.shape).sum(axis=0) % 2 == 0


def coverage_classes(coverage: np.ndarray) -> np.ndarray:
    """Position in `CLASSES` of shares of voxels reached; NEVER for 0."""
    fifth = 5 - np.ceil(np.clip(coverage, 0, 1) * 5 - 1e-9).astype(int)  # 0 for 80 to 100 %
    number = np.where(coverage >= _NEARLY_FULL, 0, fifth + 1)
    return np.where(coverage > 0, number, NEVER)


def contact_frequency(attribute: np.ndarray, per_edge: int) -> tuple[np.ndarray, np.ndarray]:
    """Contact frequency, and share of voxels reached, of each cell."""
    hits = in_cells(attribute == HIT, per_edge, "sum")
    reached = in_cells(attribute != UNSEEN, per_edge, "sum")
    return hits / np.maximum(reached, 1), reached / per_edge**3


def angle_factor(mean_zenith_deg: np.ndarray, leaf_angle_distribution: str) -> np.ndarray:
    """cosθ/G(θ) of beams at a mean angle from the vertical (Hosoi and Omasa 2006, eq. 4).

    Cells whose beams are not known (NaN) get the value of 57.5°, at which it hardly depends on the
    leaves.
    """
    zenith = np.radians(np.where(np.isfinite(mean_zenith_deg), mean_zenith_deg, 57.5))
    return np.cos(zenith) / projection(leaf_angle_distribution, zenith.ravel()).reshape(
        zenith.shape
    )


def cells_of(
    attribute: np.ndarray,
    leaf_area_m2: np.ndarray,
    wood_area_m2: np.ndarray,
    mean_zenith_deg: np.ndarray,
    leaf_angle_distribution: str,
    voxel_size_m: float,
    per_edge: int,
) -> Cells:
    """Contact frequency and truth of all cells; arguments as they lie in voxels or cells."""
    contact, coverage = contact_frequency(attribute, per_edge)
    factor = angle_factor(mean_zenith_deg, leaf_angle_distribution)
    cell_m3 = (voxel_size_m * per_edge) ** 3
    return Cells(
        contact,
        coverage_classes(coverage),
        factor * contact / voxel_size_m,
        in_cells((leaf_area_m2 > 0) | (wood_area_m2 > 0), per_edge),
        in_cells(leaf_area_m2.astype(np.float64), per_edge, "sum") / cell_m3,
        voxel_size_m,
    )


def regression(x: np.ndarray, y: np.ndarray) -> tuple[float, float, int]:
    """Slope through the origin, R² about the mean of y, and number of pairs; NaN below three."""
    if len(x) < 3 or not np.any(x):
        return np.nan, np.nan, len(x)
    slope = (x @ y) / (x @ x)
    spread = np.sum((y - y.mean()) ** 2)
    r2 = 1 - np.sum((y - slope * x) ** 2) / spread if spread > 0 else np.nan
    return float(slope), float(r2), len(x)


def regressions(cells: list[Cells]) -> list[dict]:
    """Contact frequency against truth in each class, over cells that hold something.

    Returns
    -------
    list of dict
        `coverage_class`, `slope`, `r2`, `n` against the share of voxels truly filled, and
        `slope_area`, `r2_area`, the same of `by_angle` against leaf area density.
    """
    rows = []
    for number, name in enumerate(CLASSES):
        chosen = [(c, (c.coverage_class == number) & (c.true_share > 0)) for c in cells]
        pairs = [np.concatenate([getattr(c, key)[m] for c, m in chosen])
                 for key in ("true_share", "contact", "true_density", "by_angle")]  # fmt: skip
        slope, r2, n = regression(pairs[0], pairs[1])
        slope_area, r2_area, _ = regression(pairs[2], pairs[3])
        rows.append(
            {"coverage_class": name, "slope": slope, "r2": r2, "n": n,
             "slope_area": slope_area, "r2_area": r2_area}
        )  # fmt: skip
    return rows


QUANTITIES = {"share": ("true_share", "contact"), "area": ("true_density", "by_angle")}
"""Truth and measured value of the two quantities that are corrected."""


def fit_factors(cells: list[Cells], quantity: str) -> np.ndarray:
    """Correction factors of the classes from even cells, the last one for cells never reached.

    A class's factor is the sum of the truth over the sum of what was measured. For cells never
    reached it is the sum of the truth over that of `_neighbours`: they are denser than
    what was seen at their height.

    Returns
    -------
    (len(CLASSES) + 1,) float64
        Where a class has no even cell, the factor of the next better one.
    """
    truth_key, measured_key = QUANTITIES[quantity]
    truth, measured = np.zeros((2, NEVER + 1))
    for c in cells:
        number = c.coverage_class[c.even]
        truth += np.bincount(number, getattr(c, truth_key)[c.even], NEVER + 1)
        measured += np.bincount(number, getattr(c, measured_key)[c.even], NEVER + 1)
    factors = np.ones(NEVER + 1)
    for number in range(NEVER):
        before = factors[max(number - 1, 0)]
        factors[number] = truth[number] / measured[number] if measured[number] > 0 else before
    guess = 0.0
    for c in cells:
        at = (c.coverage_class == NEVER) & c.even
        guess += _neighbours(c, factors, measured_key)[at].sum()
    factors[NEVER] = truth[NEVER] / guess if guess > 0 else 1.0
    return factors


def apply_factors(cells: Cells, factors: np.ndarray, quantity: str) -> np.ndarray:
    """Corrected density of every cell; cells never reached get a value from their layer."""
    measured_key = QUANTITIES[quantity][1]
    corrected = getattr(cells, measured_key) * factors[cells.coverage_class]
    from_layer = _neighbours(cells, factors, measured_key) * factors[NEVER]
    return np.where(cells.coverage_class == NEVER, from_layer, corrected)


def _neighbours(cells: Cells, factors: np.ndarray, measured_key: str) -> np.ndarray:
    """Mean corrected density of the poorest covered cells of the same layer, for every cell.

    A cell that no beam reached lies behind others that few reached: those of below 40 % are its
    like. A layer without such takes all that were reached, one without any the layer below it.
    """
    corrected = getattr(cells, measured_key) * factors[cells.coverage_class]
    of_layer, last = np.zeros(corrected.shape[2]), 0.0
    for k in range(corrected.shape[2]):
        number = cells.coverage_class[:, :, k]
        alike = (number >= NEVER - 2) & (number < NEVER)
        chosen = alike if alike.any() else number < NEVER
        last = of_layer[k] = corrected[:, :, k][chosen].mean() if chosen.any() else last
    return np.broadcast_to(of_layer, corrected.shape)


def relative_rmse(measured: np.ndarray, true: np.ndarray) -> float:
    """Root mean square difference of two profiles over the mean of the true one."""
    return float(np.sqrt(np.mean((measured - true) ** 2)) / np.mean(true))
