"""What a reconstruction holds, as facts for its summary file."""

import numpy as np
import xarray as xr

from dapple.formats.meshes import Mesh
from dapple.structure.voxel_data import CAPPED


def of_meshes(leaves: Mesh, wood: Mesh, truth: dict | None = None) -> dict:
    """Facts of a reconstruction made of polygons.

    Parameters
    ----------
    leaves, wood : Mesh
    truth : dict, optional
        Facts of the true plant, with `leaf_area_m2`.

    Returns
    -------
    dict
        `leaf_area_m2`, `wood_area_m2` (one-sided), `n_elements` (leaf polygons),
        `n_wood_elements`, `volume_m3` (of the box around the leaves) and, where the truth is
        known, `true_leaf_area_m2`.
    """
    span = np.ptp(leaves.vertices_m, axis=0) if len(leaves.vertices_m) else np.zeros(3)
    return {
        "leaf_area_m2": leaves.area_m2,
        "wood_area_m2": wood.area_m2,
        "n_elements": leaves.n_elements,
        "n_wood_elements": wood.n_elements,
        "volume_m3": float(span.prod()),
    } | _truth(truth)


def voxel_area_m2(voxels: xr.Dataset) -> float:
    """Plant area of the voxels whose density is known [m²]."""
    density = voxels["plant_area_density_m2_m3"].to_numpy()
    return float(np.nansum(density, dtype=np.float64) * float(voxels.attrs["voxel_size_m"]) ** 3)


def of_voxels(dataset: xr.Dataset, wood: Mesh | None = None, truth: dict | None = None) -> dict:
    """Facts of a reconstruction made of turbid voxels.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `voxels.estimate` gives it.
    wood : Mesh, optional
        The wood that stands in the same scene.
    truth : dict, optional
        Facts of the true plant, with `leaf_area_m2`.

    Returns
    -------
    dict
        `leaf_area_m2` (sum of density times volume over known voxels), `wood_area_m2` where wood
        is given, `n_elements` and `volume_m3` of voxels with leaves, `mean_pad_m2_m3` of these,
        `leaf_area_m2_by` each estimator, `n_unknown` (of these `n_not_reached`), `n_capped`,
        `total_shots`, `total_misses` and, where the truth is known, `true_leaf_area_m2`.
    """
    pad = dataset["plant_area_density_m2_m3"].to_numpy()
    voxel_m3 = float(dataset.attrs["voxel_size_m"]) ** 3
    leafy = pad > 0
    estimates = {
        str(name).removeprefix("pad_").removesuffix("_m2_m3"): values
        for name, values in dataset.data_vars.items()
        if str(name).startswith("pad_")
    }
    return {
        # Densities for light, which account for clumps, do not add up to the leaf area.
        "leaf_area_m2": dataset.attrs.get("leaf_area_before_m2", voxel_area_m2(dataset)),
        **({"wood_area_m2": wood.area_m2} if wood is not None else {}),
        "n_elements": int(leafy.sum()),
        "volume_m3": float(leafy.sum() * voxel_m3),
        "mean_pad_m2_m3": float(pad[leafy].mean(dtype=np.float64)) if leafy.any() else 0.0,
        "leaf_area_m2_by": {
            name: float(np.nansum(values.to_numpy(), dtype=np.float64) * voxel_m3)
            for name, values in estimates.items()
        },
        "n_unknown": int(np.isnan(pad).sum()),
        "n_not_reached": int((dataset["n_shots"].to_numpy() == 0).sum()),
        "n_capped": int(((dataset["flag"].to_numpy() & CAPPED) > 0).sum()),
        "total_shots": int(dataset.attrs.get("total_shots", 0)),
        "total_misses": int(dataset.attrs.get("total_misses", 0)),
    } | _truth(truth)


def _truth(truth: dict | None) -> dict:
    return {"true_leaf_area_m2": float(truth["leaf_area_m2"])} if truth else {}
