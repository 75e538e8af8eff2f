"""Shots that cross a grid tell its plant area density; occluded is not empty."""

import numba
import numpy as np
import pytest

from dapple.errors import InputError, MissingMissesError
from dapple.formats import voxel_grids as files
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.structure import summary
from dapple.structure.returns import kinds_by_place
from dapple.structure.voxel_sums import Grid, accumulate
from dapple.structure.voxels import estimate, plant_area_density


def shots_of(origin, direction, ranges):
    """Shots from lists of ranges, one list a shot."""
    n = len(ranges)
    direction = np.broadcast_to(np.asarray(direction, float), (n, 3))
    count = [len(r) for r in ranges]
    values = np.concatenate([np.asarray(r, float) for r in ranges])
    blank = np.zeros(len(values), np.float32)
    return Shots(
        np.broadcast_to(np.asarray(origin, float), (n, 3)).copy(),
        direction / np.linalg.norm(direction, axis=1, keepdims=True),
        np.zeros(n, np.uint16),
        np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        values,
        blank,
        blank,
        np.array([1000.0, 2000.0, 0.0]),
    )


def column(n):
    return Grid(np.zeros(3), (1, 1, n), 1.0)


def in_column(dataset, name):
    return dataset[name].to_numpy()[0, 0]


TWO_SHOTS = shots_of([0.5, 0.5, -1], [0, 0, 1], [[1.5, 2.25, 2.75], []])


def test_two_shots_worked_by_hand():
    """A shot with three echoes and a miss, straight up through four voxels."""
    sums = accumulate(TWO_SHOTS, column(4), max_pad_m2_m3=10.0)
    result = estimate(sums, min_shots=1)
    assert in_column(result, "n_shots").tolist() == [2, 2, 1, 1]
    assert in_column(result, "path_length_m").tolist() == pytest.approx([2, 2, 1, 1])
    for name, expected in {
        "entering": [2, 1.6666667, 1, 1],
        "intercepted": [0.3333333, 0.6666667, 0, 0],
    }.items():
        assert in_column(result, name) == pytest.approx(expected, abs=1e-7)
    attenuation = {
        "fpl_biased": [0.1818182, 0.5, 0, 0],
        "fpl": [0.1322314, 0.34375, 0, 0],
        "ppl": [0.1823216, 0.5108256, 0, 0],
        "transmittance": -np.log([0.8333333, 0.6, 1, 1]),
    }
    for name, expected in attenuation.items():
        found = 0.5 * in_column(result, f"pad_{name}_m2_m3")
        assert found == pytest.approx(expected, abs=1e-7), name
    assert in_column(result, "plant_area_density_m2_m3")[0] == pytest.approx(2 * 0.1322314)


def test_beams_are_weighted_by_their_section_at_the_voxel_s_centre():
    sums = accumulate(TWO_SHOTS, column(4), beam_divergence_mrad=2.0, beam_diameter_m=0.01)
    section = np.pi * (np.tan(0.001) * np.array([1.5, 2.5, 3.5, 4.5]) + 0.005) ** 2
    result = estimate(sums, min_shots=1)
    expected = section * [2, 5 / 3, 1, 1]
    assert in_column(result, "entering") == pytest.approx(expected, rel=1e-12)
    # In a voxel all sections are the same here, so that they cancel.
    assert 0.5 * in_column(result, "pad_ppl_m2_m3")[:2] == pytest.approx([0.1823216, 0.5108256])


def test_a_divergent_beam_without_width_at_exit_has_a_section():
    sums = accumulate(TWO_SHOTS, column(4), beam_divergence_mrad=2.0)
    expected = np.pi * (np.tan(0.001) * 1.5) ** 2 * 2
    assert in_column(estimate(sums), "entering")[0] == pytest.approx(expected, rel=1e-12)


def test_wood_and_noise_weaken_the_beam_but_are_no_leaf():
    for kind in (1, 2):
        result = plant_area_density(
            TWO_SHOTS, column(4), kinds=np.array([kind, 0, kind], np.uint8), min_shots=1
        )
        assert in_column(result, "entering") == pytest.approx([2, 5 / 3, 1, 1])
        assert in_column(result, "intercepted") == pytest.approx([0, 1 / 3, 0, 0])
        assert in_column(result, "n_hits").tolist() == [0, 1, 0, 0]
        # Free paths: a hit at 0.25, wood at 0.75 that saw no leaf before, the miss's whole metre.
        expected = (1 / 3) / (0.25 / 3 + 0.75 / 3 + 1)
        assert 0.5 * in_column(result, "pad_fpl_biased_m2_m3")[1] == pytest.approx(expected)
        assert in_column(result, "pad_ppl_m2_m3")[0] == 0


def test_what_stops_at_wood_counts_up_to_the_wood():
    """Half of the shots end at wood half-way: the leaves before it decide, nothing behind."""
    rng = np.random.default_rng(3)
    leaf = rng.exponential(1.0, 40_000)  # attenuation 1 per metre
    ends = np.where(np.arange(40_000) % 2, 0.5, np.inf)
    first = np.minimum(leaf, ends)
    shots = shots_of([0.5, 0.5, 0], [0, 0, 1], [[r] if r < np.inf else [] for r in first] + [[]])
    kinds = (leaf > ends)[np.isfinite(first)].astype(np.uint8)
    result = plant_area_density(shots, column(1), kinds=kinds)
    # 20,000 hits: a relative standard error of about 0.7 %.
    assert in_column(result, "pad_fpl_m2_m3")[0] == pytest.approx(2.0, rel=0.03)
    # For a hit the others know the whole voxel's path, not the wood that stood behind: too low.
    for name in ("transmittance", "ppl"):
        assert 1.5 < in_column(result, f"pad_{name}_m2_m3")[0] < 1.9, name


def test_echoes_before_the_grid_weaken_the_beam_and_those_behind_do_not():
    shots = shots_of([0.5, 0.5, -1], [0, 0, 1], [[0.5, 9.0], [0.2, 0.4], []])
    result = plant_area_density(shots, column(2), min_shots=1)
    assert in_column(result, "entering") == pytest.approx([1.5, 1.5])
    assert in_column(result, "n_shots").tolist() == [2, 2]
    assert in_column(result, "intercepted").tolist() == [0, 0]


def test_a_scanner_inside_the_grid_looks_both_ways():
    shots = shots_of([0.5, 0.5, 1.25], np.array([[0, 0, 1.0], [0, 0, -1.0]]), [[], []])
    result = plant_area_density(shots, column(3), min_shots=1)
    assert in_column(result, "path_length_m") == pytest.approx([1, 1, 1])
    assert in_column(result, "n_shots").tolist() == [1, 2, 1]


def test_an_echo_on_a_facet_belongs_to_the_voxel_that_its_beam_enters_there():
    for origin, direction, voxel in (([0.5, 0.5, -1], 1, 1), ([0.5, 0.5, 3], -1, 0)):
        shots = shots_of(origin, [0, 0, direction], [[2.0], []])
        result = plant_area_density(shots, column(2), min_shots=1)
        assert in_column(result, "intercepted")[voxel] == 1
        assert in_column(result, "intercepted").sum() == 1
        before = 1 - voxel
        assert in_column(result, "path_length_m")[before] == pytest.approx(2)
        assert in_column(result, "pad_fpl_m2_m3")[before] == 0


def test_chords_add_up_to_the_way_through_the_grid():
    """Near-diagonal rays too, which cross nx + ny + nz voxels."""
    rng = np.random.default_rng(6)
    grid = Grid(np.array([-1.0, 2.0, 0.5]), (7, 5, 9), 0.2)
    low, high = grid.corner_m, grid.corner_m + 0.2 * np.array(grid.shape)
    start = low + (high - low) * rng.random((100, 3)) - 5 * (rng.random((100, 3)) < 0.4)
    end = low + (high - low) * rng.random((100, 3))
    start[0], end[0] = low - 1e-3, high + 1e-3
    direction = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    with np.errstate(divide="ignore"):
        a, b = (low - start) / direction, (high - start) / direction
    way = np.minimum(a, b).max(axis=1).clip(0), np.maximum(a, b).min(axis=1)
    for i in range(100):
        sums = accumulate(shots_of(start[i], direction[i], [[]]), grid)
        assert sums.visits[:, 1].sum() == pytest.approx(way[1][i] - way[0][i], rel=1e-9)
    crossed = accumulate(shots_of(start[0] + [0, 0.02, 0.013], direction[0], [[]]), grid)
    assert np.count_nonzero(crossed.visits[:, 0]) > np.sqrt(7**2 + 5**2 + 9**2)


def test_rays_along_edges_and_facets_are_counted_once():
    grid = Grid(np.zeros(3), (4, 4, 4), 1.0)
    diagonal = accumulate(shots_of([-1, -1, -1], [1, 1, 1], [[]]), grid)
    assert np.flatnonzero(diagonal.visits[:, 0]).tolist() == [0, 21, 42, 63]
    assert diagonal.visits[:, 1].sum() == pytest.approx(4 * np.sqrt(3))
    along = accumulate(shots_of([2, -1, 1], [0, 1, 0], [[]]), grid)
    assert np.flatnonzero(along.visits[:, 0]).tolist() == [33, 37, 41, 45]
    beside = accumulate(shots_of([4, -1, 1], [0, 1, 0], [[]]), grid)
    assert beside.visits[:, 0].sum() == 0


def test_no_echo_is_lost_between_voxels():
    rng = np.random.default_rng(9)
    direction = rng.normal(size=(3000, 3)) * [1, 1, 0.2]
    grid = Grid(np.array([-2.0, -2.0, -2.0]), (20, 20, 20), 0.2)
    ranges = [np.round(np.sort(1.5 * rng.random(3)), 1) for _ in range(2999)] + [[]]
    sums = accumulate(shots_of([0.0, 0.0, 0.0], direction, ranges), grid)
    assert sums.hits[:, 0].sum() == 3 * 2999
    assert sums.hits[:, 2].sum() == pytest.approx(2999)


def test_voxels_behind_leaves_are_unknown_not_empty():
    shots = shots_of([0.5, 0.5, -1], [0, 0, 1], [[1.5]] * 20)
    with pytest.raises(MissingMissesError, match="no miss"):
        plant_area_density(shots, column(2))
    result = plant_area_density(shots, column(2), allow_missing_misses=True)
    density = in_column(result, "plant_area_density_m2_m3")
    assert density[0] > 0
    assert np.isnan(density[1])
    assert in_column(result, "flag").tolist() == [0, 1]


def test_few_shots_leave_a_voxel_unknown_and_dense_ones_are_capped():
    shots = shots_of([0.5, 0.5, -1], [0, 0, 1], [[1.01]] * 30 + [[]] * 4)
    result = plant_area_density(shots, column(2), min_shots=5, max_pad_m2_m3=3.0)
    assert in_column(result, "plant_area_density_m2_m3")[0] == 3.0
    assert np.isnan(in_column(result, "pad_ppl_m2_m3")[1])
    assert np.isnan(in_column(result, "standard_error_m2_m3")[1])
    assert in_column(result, "flag").tolist() == [4, 2]
    facts = summary.of_voxels(result, truth={"leaf_area_m2": 2.5})
    assert facts["leaf_area_m2"] == pytest.approx(3.0)
    assert (facts["n_unknown"], facts["n_capped"], facts["n_not_reached"]) == (1, 1, 0)
    assert facts["true_leaf_area_m2"] == 2.5


def turbid(pad, distribution_g, n, rng):
    """Shots in all directions from within a turbid cube of 4 m; what leaves it is a miss."""
    origin = np.array([0.1, -0.2, 0.3])
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    zenith = np.arccos(np.abs(direction[:, 2]))
    free = rng.exponential(1 / (pad * distribution_g(zenith)))
    side = np.abs(origin + free[:, None] * direction).max(axis=1)
    return shots_of(
        origin, direction, [[r] if s < 2 else [] for r, s in zip(free, side, strict=True)]
    )


@pytest.fixture
def threads():
    before = numba.get_num_threads()
    yield numba.set_num_threads
    numba.set_num_threads(before)


def test_neither_threads_nor_memory_for_chunks_change_a_byte(threads):
    shots = turbid(0.6, lambda z: np.full(len(z), 0.5), 20_000, np.random.default_rng(1))
    grid = Grid(np.full(3, -2.0), (20, 20, 20), 0.2)
    threads(1)
    alone = plant_area_density(shots, grid)
    threads(numba.config.NUMBA_NUM_THREADS)
    together = plant_area_density([shots], grid)
    for name in alone.data_vars:
        assert together[name].to_numpy().tobytes() == alone[name].to_numpy().tobytes(), name


def test_chunks_that_come_once_tell_as_much_as_chunks_that_are_read_twice():
    rng = np.random.default_rng(2)
    shots = turbid(0.6, lambda z: np.full(len(z), 0.5), 2_000, rng)
    # Returns on facets and corners of voxels belong to one side as much as to the other.
    on_corner = shots_of([0.0, 0.0, -2.5], [0, 0, 1], [[0.7], [1.1], [2.5, 2.9], []])
    grid = Grid(np.full(3, -2.0), (10, 10, 10), 0.4)
    for size_m in (0.1, 0.08, 0.4):
        twice = plant_area_density([shots, on_corner], grid, contact_voxel_m=size_m)
        once = plant_area_density(iter([shots, on_corner]), grid, contact_voxel_m=size_m)
        for name in twice.data_vars:
            assert once[name].to_numpy().tobytes() == twice[name].to_numpy().tobytes(), name


def test_chunks_add_up():
    ranges = [[1.2, 1.9], [], [1.4], [2.7], []]
    whole = shots_of([0.5, 0.5, -1], [0, 0, 1], ranges)
    parts = [shots_of([0.5, 0.5, -1], [0, 0, 1], ranges[a:b]) for a, b in ((0, 2), (2, 5))]
    kinds = np.array([0, 1, 0, 0], np.uint8)
    one = plant_area_density(whole, column(2), kinds=kinds, min_shots=1)
    two = plant_area_density(iter(parts), column(2), kinds=kinds, min_shots=1)
    for name in one.data_vars:
        assert two[name].to_numpy() == pytest.approx(one[name].to_numpy(), nan_ok=True), name


def test_the_grid_lies_at_multiples_of_its_size():
    grid = Grid.around([[-0.31, 0.0, 0.25], [0.6, 20.0, 0.26]], 0.2)
    assert grid.corner_m == pytest.approx([-0.4, 0.0, 0.2])
    assert grid.shape == (5, 100, 1)
    assert grid.centres_m["x"] == pytest.approx([-0.3, -0.1, 0.1, 0.3, 0.5])


def test_returns_are_what_the_classified_cloud_is_where_they_lie():
    shots = shots_of([0.0, 0.0, 0.0], [1, 0, 0], [[0.51, 1.01, 1.51], [3.0]])
    points = np.array([[0.52, 0.01, 0.01], [1.02, 0.0, 0.0], [1.03, 0.0, 0.0], [1.04, 0.0, 0.0]])
    kinds = kinds_by_place(points, np.array([4, 0, 0, 4]), voxel_size_m=0.05)
    assert kinds(shots).tolist() == [0, 1, 2, 2]


def test_an_echo_that_was_filtered_out_counts_beside_the_plant_as_the_plant_and_far_away_as_noise():
    leaf, wood = [0.52, 0.01, 0.01], [1.52, 0.01, 0.01]
    points = np.array([leaf, wood, wood])
    beside = [[0.54, 0.06, -0.04], [0.46, 0.01, 0.01], [1.56, 0.06, 0.06]]
    far = [[0.61, 0.01, 0.01], [0.52, 0.11, 0.01], [1.0, 0.0, 0.0], [9.0, 9.0, 9.0]]
    echoes = np.array(beside + far)
    ranges_m = np.linalg.norm(echoes, axis=1)
    shots = shots_of([0.0, 0.0, 0.0], echoes / ranges_m[:, None], [[r] for r in ranges_m])
    told = {"points_m": points, "classes": np.array([4, 0, 0]), "voxel_size_m": 0.05}
    assert kinds_by_place(**told)(shots).tolist() == [0, 0, 1, 2, 2, 2, 2]
    assert kinds_by_place(**told, beside=False)(shots).tolist() == [2] * 7


@pytest.mark.parametrize(
    ("ranges", "kinds", "found"),
    [
        ([[2.0, 1.0], []], None, "ascending"),
        ([[np.nan], []], None, "not finite"),
        ([[1.0], []], np.array([0, 0], np.uint8), "kinds"),
        ([[1.0], []], np.array([7], np.uint8), "kinds"),
    ],
)
def test_shots_that_cannot_be_followed_are_refused(ranges, kinds, found):
    with pytest.raises(InputError, match=found):
        plant_area_density(shots_of([0, 0, 0], [0, 0, 1], ranges), column(1), kinds=kinds)


def test_no_shots_at_all_are_an_error():
    with pytest.raises(InputError, match="at least one shot"):
        plant_area_density([], column(1))


def test_an_unknown_estimator_is_refused():
    with pytest.raises(InputError, match="contact_frequency"):
        plant_area_density(TWO_SHOTS, column(1), estimator="fpk")
    with pytest.raises(InputError, match="contact_voxel_m"):
        plant_area_density(TWO_SHOTS, column(1), estimator="contact_frequency", contact_voxel_m=0.0)


@pytest.fixture
def dataset():
    return plant_area_density(TWO_SHOTS, Grid(np.array([0.0, 0, -1]), (1, 1, 3), 1.0), min_shots=2)


def test_netcdf_keeps_values_units_and_settings(tmp_path, dataset):
    files.write(tmp_path / "voxels.nc", dataset)
    again = files.read(tmp_path / "voxels.nc")
    for name in dataset.data_vars:
        expected = dataset[name].to_numpy()
        assert again[name].to_numpy() == pytest.approx(expected, rel=1e-6, nan_ok=True), name
        assert again[name].attrs["units"] == dataset[name].attrs["units"]
    assert again["z"].to_numpy().tolist() == [-0.5, 0.5, 1.5]
    assert again.attrs["voxel_size_m"] == 1.0
    assert again.attrs["origin_m"].tolist() == [1000, 2000, 0]
    assert again.attrs["leaf_angle_distribution"] == "spherical"
    assert again["flag"].dtype == np.uint8
    files.write(tmp_path / "again.nc", dataset)
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "voxels.nc").read_bytes()


def test_amapvox_s_reader_finds_what_it_expects(tmp_path, dataset):
    """readVoxelSpace: a first line, `#key:value` with one colon, then one table with blanks."""
    files.write_vox(tmp_path / "voxels.vox", dataset)
    first, *rest = (tmp_path / "voxels.vox").read_text().splitlines()
    assert first == "VOXEL SPACE"
    header = [line for line in rest if line.startswith("#")]
    assert all(line.count(":") == 1 and line.count("#") == 1 for line in header)
    values = dict(line[1:].split(":") for line in header)
    assert values["min_corner"] == "(0, 0, -1)"
    assert values["max_corner"] == "(1, 1, 2)"
    assert values["split"] == "(1, 1, 3)"
    assert values["res"] == "(1, 1, 1)"
    names, *lines = rest[len(header) :]
    assert names.startswith("i j k ground_distance nbEchos nbSampling")
    assert len(lines) == 3
    assert all(len(line.split(" ")) == len(names.split(" ")) for line in lines)
    assert [line.split(" ")[:3] for line in lines] == [["0", "0", str(k)] for k in range(3)]
    again = files.read_vox(tmp_path / "voxels.vox")
    for name, ours in (
        ("plant_area_density_m2_m3", "plant_area_density_m2_m3"),
        ("nbSampling", "n_shots"),
        ("bsIntercepted", "intercepted"),
        ("lgTotal", "path_length_m"),
    ):
        expected = dataset[ours].to_numpy().astype(float)
        assert again[name].to_numpy() == pytest.approx(expected, rel=1e-6, nan_ok=True)
    assert again["z"].to_numpy() == pytest.approx([-0.5, 0.5, 1.5])
    attenuation = again["attenuation_PPL_MLE"].to_numpy()[0, 0]
    assert attenuation == pytest.approx([0, 0.1823216, 0.5108256], abs=1e-6)
    transmitted = again["transmittance"].to_numpy()[0, 0]
    assert transmitted == pytest.approx([1, 0.8333333, 0.6], abs=1e-6)


def test_damaged_voxel_files_are_refused(tmp_path, dataset):
    path = tmp_path / "voxels.nc"
    with pytest.raises(InputError, match="no file"):
        files.read(path)
    files.write(path, dataset)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(InputError, match="unreadable"):
        files.read(path)
    files.write(path, dataset.drop_vars("plant_area_density_m2_m3"))
    with pytest.raises(InputError, match="found variables"):
        files.read(path)
    files.write_vox(tmp_path / "voxels.vox", dataset)
    text = (tmp_path / "voxels.vox").read_text()
    (tmp_path / "voxels.vox").write_text(text[: text.rstrip().rindex("\n") + 1])
    with pytest.raises(InputError, match="found 2 voxels"):
        files.read_vox(tmp_path / "voxels.vox")
    (tmp_path / "voxels.vox").write_text("ply\n")
    with pytest.raises(InputError, match="VOXEL SPACE"):
        files.read_vox(tmp_path / "voxels.vox")


def test_polygons_are_summed_up():
    triangle = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 2, 3.0]]), np.array([[0, 1, 2]]), np.array([0])
    )
    facts = summary.of_meshes(triangle, triangle, {"leaf_area_m2": 1.5, "height_m": 3})
    assert facts == {
        "leaf_area_m2": pytest.approx(np.sqrt(13) / 2),
        "wood_area_m2": pytest.approx(np.sqrt(13) / 2),
        "n_elements": 1,
        "n_wood_elements": 1,
        "volume_m3": pytest.approx(6.0),
        "true_leaf_area_m2": 1.5,
    }
