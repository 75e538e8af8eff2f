"""Paint triangles into an image, near ones over far ones, pixel by pixel."""

import numba
import numpy as np


def render(
    corners_m: np.ndarray,
    rgb: np.ndarray,
    low_m: np.ndarray,
    high_m: np.ndarray,
    *,
    width_px: int,
    samples: int = 3,
) -> np.ndarray:
    """Orthographic picture of triangles.

    Parameters
    ----------
    corners_m : (t, 3, 3) array
        Triangles, corners, and across, up, towards the eye [m].
    rgb : (t, 3) array
        Colours, 0 to 1.
    low_m, high_m : (2,) array
        Edges of the picture, across and up [m].
    width_px : int
        Width of the picture; the height follows from the edges.
    samples : int
        Samples along one side of a pixel, averaged.

    Returns
    -------
    (rows, columns, 4) float32 array
        Red, green, blue, opacity, 0 to 1; the first row is the lowest.

    Notes
    -----
    A depth buffer: memory depends on the picture and not on the number of triangles, and
    triangles that cross each other are drawn rightly.
    """
    scale = samples * width_px / (high_m[0] - low_m[0])
    rows = max(1, round((high_m[1] - low_m[1]) * scale / samples)) * samples
    image = np.zeros((rows, samples * width_px, 4), np.float32)
    nearest = np.full(image.shape[:2], -np.inf)
    _paint(
        np.ascontiguousarray(corners_m, float), np.ascontiguousarray(rgb, float),
        float(low_m[0]), float(low_m[1]), scale, image, nearest,
    )  # fmt: skip
    mean = image.reshape(rows // samples, samples, width_px, samples, 4).mean(axis=(1, 3))
    # Colours were summed over covered samples only: divide them by the share that is covered.
    covered = mean[:, :, 3:]
    mean[:, :, :3] /= np.where(covered > 0, covered, 1.0)
    return mean


@numba.njit(cache=True)
def _paint(corners_m, rgb, left_m, bottom_m, scale, image, nearest):
    rows, columns = nearest.shape
    for t in range(len(corners_m)):
        x = (corners_m[t, :, 0] - left_m) * scale
        y = (corners_m[t, :, 1] - bottom_m) * scale
        depth = corners_m[t, :, 2]
        doubled_area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        if doubled_area == 0.0:
            continue  # seen exactly from the side
        for row in range(max(0, int(y.min())), min(rows, int(y.max()) + 1)):
            for column in range(max(0, int(x.min())), min(columns, int(x.max()) + 1)):
                px, py = column + 0.5 - x[0], row + 0.5 - y[0]
                b = (px * (y[2] - y[0]) - (x[2] - x[0]) * py) / doubled_area
                c = ((x[1] - x[0]) * py - px * (y[1] - y[0])) / doubled_area
                if b < 0.0 or c < 0.0 or b + c > 1.0:
                    continue
                near = depth[0] + b * (depth[1] - depth[0]) + c * (depth[2] - depth[0])
                if near > nearest[row, column]:
                    nearest[row, column] = near
                    image[row, column, 0] = rgb[t, 0]
                    image[row, column, 1] = rgb[t, 1]
                    image[row, column, 2] = rgb[t, 2]
                    image[row, column, 3] = 1.0
