"""Plant area of a scan of eight positions, from its own shots and from files of other writers."""

import numpy as np
import pye57
import pytest

from dapple import steps
from dapple.cloud import shot_sources
from dapple.cloud.clean import clean
from dapple.config.settings import Settings
from dapple.formats import clouds, ground_surface, shots
from dapple.formats.clouds import LEAF, WOOD
from dapple.structure.stem import stem_position
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density
from dapple.virtual import scanner
from dapple.virtual.plants import apple_tree

STEP_DEG = 0.4


@pytest.fixture(scope="module")
def scan():
    """A small tree scanned from eight places around it: every shot, those that met nothing too."""
    sizes = {"height_m": 2.5, "crown_base_m": 0.8, "crown_radius_m": 1.0, "dbh_m": 0.06}
    plant = apple_tree(**dict(Settings().plant) | sizes | {"leaf_area_m2": 5.0}, seed=3)
    options = dict(Settings().scan) | {"angular_step_deg": STEP_DEG}
    places = scanner.positions_around(
        stem_position(plant.wood), n=options.pop("positions"), radius_m=5.0,
        height_m=options.pop("height_m"),
    )  # fmt: skip
    del options["radius_m"]
    meshes = {"leaf": plant.leaves, "wood": plant.wood}
    return scanner.scan(meshes, places, ground_z_m=0.0, seed=3, **options)


def positions(scan):
    """Of each position: its place, and of its shots column, row, direction and returns."""
    direction = scan.direction
    zenith = np.degrees(np.arccos(direction[:, 2]))
    azimuth = np.degrees(np.arctan2(direction[:, 0], direction[:, 1]))
    for number in np.unique(scan.scan):
        mine = np.flatnonzero(scan.scan == number)
        turn = (azimuth[mine] - azimuth[mine[0]] + 180.0) % 360.0 - 180.0
        column = np.rint((turn - turn.min()) / STEP_DEG).astype(int)
        row = np.rint((zenith[mine] - zenith[mine].min()) / STEP_DEG).astype(int)
        yield scan.origin_m[mine[0]], mine, column, row


def write_e57(scan, path):
    """Structured, by pye57: every return a record with column and row, a miss an invalid one."""
    with pye57.E57(str(path), mode="w") as file:
        for place, mine, column, row in positions(scan):
            count = scan.n_returns[mine]
            shot = np.repeat(np.arange(len(mine)), np.maximum(count, 1))
            met = np.repeat(count > 0, np.maximum(count, 1))
            range_m = np.zeros(len(shot))
            range_m[met] = np.concatenate(
                [scan.range_m[scan.first[k] : scan.first[k + 1]] for k in mine]
            )
            xyz = scan.direction[mine][shot] * range_m[:, None]
            data = {f"cartesian{axis}": xyz[:, k].copy() for k, axis in enumerate("XYZ")}
            data["cartesianInvalidState"] = np.where(met, 0, 2).astype(np.int8)
            data |= {"columnIndex": column[shot], "rowIndex": row[shot]}
            file.write_scan_raw(data, translation=place)


def write_ptx(scan, path):
    """PTX: a cell for every column and row, with its first return or 0 0 0."""
    with path.open("w") as file:
        for place, mine, column, row in positions(scan):
            shape = column.max() + 1, row.max() + 1
            cells = np.zeros((*shape, 4))
            met = scan.n_returns[mine] > 0
            first = scan.range_m[scan.first[mine][met]]
            cells[column[met], row[met], :3] = scan.direction[mine][met] * first[:, None]
            cells[column[met], row[met], 3] = 0.5
            pose = np.vstack([np.column_stack([np.eye(3), np.zeros(3)]), [*place, 1.0]])
            axes = ["1 0 0", "0 1 0", "0 0 1"]
            head = [*map(str, shape), " ".join(map(str, place)), *axes]
            head += [" ".join(f"{value:.6f}" for value in line) for line in pose]
            file.write("\n".join(head) + "\n")
            # row 0 is the lowest shot
            np.savetxt(file, cells[:, ::-1].reshape(-1, 4), fmt="%.5f")


def plant_area_m2(chunks, grid):
    density = plant_area_density(chunks, grid)["plant_area_density_m2_m3"]
    return float(density.sum()) * grid.size_m**3


@pytest.mark.parametrize(
    ("name", "write", "tolerance"), [("a.e57", write_e57, 0.02), ("a.ptx", write_ptx, 0.1)]
)
def test_a_file_that_keeps_every_shot_gives_the_plant_area_of_the_scan(
    scan, tmp_path, name, write, tolerance
):
    """PTX keeps one return of a shot, and so loses a little of what lies behind."""
    write(scan, tmp_path / name)
    cloud, source = clouds.read_with_source(tmp_path / name)
    fired, moving = shot_sources.open_shots(
        tmp_path / name, cloud, source, how="auto", positions="", scan_frame={}
    )
    assert not moving
    if name == "a.e57":
        assert cloud.attributes["NumberOfReturns"].max() == scan.n_returns.max() > 1
    read = shots.concatenate([one for one, _ in fired])
    assert len(np.unique(read.scan)) == 8
    grid = Grid.around(np.array([[-1.2, -1.2, 0.4], [1.2, 1.2, 2.6]]), 0.2)
    expected = plant_area_m2(scan, grid)
    assert expected > 3.0
    assert plant_area_m2(read, grid) == pytest.approx(expected, rel=tolerance)


def test_plant_area_hardly_depends_on_whether_weak_echoes_can_be_filtered(scan):
    """A file without reflectance keeps every echo; with it, weak ones are left out."""
    kept = scan.truth != 7
    echoes = {"Reflectance": scan.reflectance_db, "Deviation": scan.deviation}
    classes = np.where(scan.truth == LEAF, LEAF, WOOD).astype(np.uint8)
    area_m2, n_points = {}, {}
    for name, known in (("plain", {}), ("filtered", echoes)):
        attributes = {key: values[kept] for key, values in known.items()}
        attributes["Classification"] = classes[kept]
        cloud = clouds.Cloud(scan.return_xyz_m[kept], np.zeros(3), attributes)
        settings = Settings().clean.model_dump(exclude={"distance_points"})
        cloud, _ = clean(
            cloud, where="scan", ground=ground_surface.flat(0.0),
            pdal=Settings().tools.pdal, cloudcompare=Settings().tools.cloudcompare, **settings,
        )  # fmt: skip
        kinds = steps.return_kinds(cloud, Settings().classify.majority_voxel_m)
        density = steps.voxels(scan, cloud, 0.2, kinds=kinds)["plant_area_density_m2_m3"]
        area_m2[name], n_points[name] = float(density.sum()) * 0.2**3, len(cloud)
    assert n_points["filtered"] < 0.95 * n_points["plain"]
    assert area_m2["filtered"] == pytest.approx(area_m2["plain"], rel=0.02)
