"""Crowns, sub-crowns, layers; pulses; and a whole scene from a turbid forest."""

import numpy as np
import pytest

from dapple.cloud import crowns, pulses
from dapple.errors import InputError
from dapple.formats.clouds import Cloud
from dapple.formats.rasters import Raster
from dapple.structure import crown_scene

PIXEL = 0.25
CROWNS = {
    "pixel_m": PIXEL, "min_height_m": 2.0, "smoothing_m": 0.3, "min_distance_m": 1.0,
    "min_area_m2": 1.5,
}  # fmt: skip


def cones(places, radius_m=2.0, height_m=10.0, size=80):
    """Cones on level ground, on a map of `size` pixels."""
    y, x = (np.mgrid[:size, :size] + 0.5) * PIXEL
    height = np.zeros((size, size))
    for px, py in places:
        r = np.hypot(x - px, y - py)
        height = np.maximum(height, np.where(r < radius_m, height_m * (1 - r / (2 * radius_m)), 0))
    return height


def test_every_cone_is_one_crown_even_where_they_touch():
    places = [(4, 4), (7.4, 4), (4, 14), (14, 14), (12, 6)]
    labels = crowns.crowns(cones(places), **CROWNS)
    found = [labels[int(y / PIXEL), int(x / PIXEL)] for x, y in places]
    assert sorted(found) == [1, 2, 3, 4, 5]
    areas = np.bincount(labels.ravel())[1:] * PIXEL**2
    np.testing.assert_allclose(areas, np.pi * 4, rtol=0.08)


def test_a_branch_beside_a_top_is_no_tree_of_its_own():
    height = cones([(10, 10)], radius_m=3)
    height[36:38, 30:32] += 2.5
    assert crowns.crowns(height, **CROWNS).max() == 1


def test_grass_and_unknown_pixels_belong_to_no_crown():
    height = cones([(10, 10)])
    height[:20] = 1.5
    height[40, 40] = np.nan
    labels = crowns.crowns(height, **CROWNS)
    assert not labels[:20].any()
    assert labels[40, 40] == 0


def test_a_meadow_has_no_crowns_and_says_so():
    with pytest.raises(InputError, match=r"heights up to 1.0 m.*min_height_m"):
        crowns.crowns(np.ones((20, 20)), **CROWNS)


def test_sub_crowns_share_the_crown_evenly_and_stay_in_it():
    labels = crowns.crowns(cones([(6, 6), (14, 14)], radius_m=3), **CROWNS)
    sub, crown = crowns.sub_crowns(labels, pixel_m=PIXEL, area_m2=2.0, seed=1)
    assert ((sub > 0) == (labels > 0)).all()
    assert (crown[sub[sub > 0] - 1] == labels[sub > 0]).all()
    assert np.bincount(crown)[1:].tolist() == [14, 14]
    areas = np.bincount(sub.ravel())[1:] * PIXEL**2
    assert areas.min() > 0.8
    assert areas.max() < 4.0
    again, _ = crowns.sub_crowns(labels, pixel_m=PIXEL, area_m2=2.0, seed=1)
    np.testing.assert_array_equal(sub, again)


def test_layers_have_equal_depth_from_base_to_top():
    height = np.concatenate([np.linspace(4, 10, 100), [0.6]])
    limits = crowns.layer_limits(height, np.ones(101, int), n_layers=3, base_share=0.02)
    np.testing.assert_allclose(limits, [[6, 8]], atol=0.1)
    layer = crowns.layer_of(np.array([1.0, 5, 7, 9, 30]), np.ones(5, int), limits)
    assert layer.tolist() == [0, 0, 1, 2, 2]


def test_returns_of_one_time_are_one_pulse_whatever_their_order():
    time = np.array([2.0, 1.0, 1.0, 3.0, 1.0])
    number, total = np.array([1, 3, 1, 1, 2]), np.array([1, 3, 3, 1, 3])
    cloud = Cloud(
        np.zeros((5, 3)),
        attributes={"GpsTime": time, "ReturnNumber": number, "NumberOfReturns": total},
    )
    order, first = pulses.group(cloud)
    assert first.tolist() == [0, 3, 4, 5]
    assert order.tolist() == [2, 4, 1, 0, 3]


def test_pulses_that_share_a_coarse_time_are_told_apart_by_their_order():
    number, total = np.array([1, 2, 1, 1, 2]), np.array([2, 2, 1, 2, 2])
    cloud = Cloud(
        np.zeros((5, 3)),
        attributes={"GpsTime": np.ones(5), "ReturnNumber": number, "NumberOfReturns": total},
    )
    assert pulses.group(cloud)[1].tolist() == [0, 2, 3, 5]


def test_a_cloud_without_returns_has_one_pulse_a_point_from_above():
    found = pulses.assemble(Cloud(np.random.default_rng(1).random((9, 3))), window_s=0.5)
    assert len(found) == 9
    assert found.facts["returns"] == "single"
    np.testing.assert_array_equal(found.direction, np.tile([0, 0, -1.0], (9, 1)))


def flight(n=4000, seed=1, density=1.0):
    """Pulses from a line 60 m up through a turbid box (8 m wide, 3 m deep) to the ground."""
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 4, n))
    sensor = np.column_stack([2 + 1.5 * time, np.full(n, 6.0), np.full(n, 60.0)])
    target = np.column_stack([rng.uniform(0, 12, (n, 2)), np.zeros(n)])
    down = target - sensor
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    enter, leave = ((60 - z) / -down[:, 2] for z in (8.0, 5.0))
    inside = np.ones(n, bool)
    for s in (enter, leave):
        at = sensor + s[:, None] * down
        inside &= ((at[:, :2] > 2) & (at[:, :2] < 10)).all(axis=1)
    # Many small leaves take what Beer's law says: one return from each third, then the ground.
    left = np.exp(-0.5 * density * np.outer(leave - enter, np.arange(4) / 3))
    passed = np.where(inside, left[:, 3], 1.0)
    xyz, share, number, total, pulse = [], [], [], [], []
    for i in range(n):
        places = [60 / -down[i, 2]]
        light = [passed[i] * 0.6]  # darker ground
        if inside[i]:
            steps = (np.arange(3) + rng.random(3)) / 3
            places = [*(enter[i] + steps * (leave[i] - enter[i])), *places]
            light = [*-np.diff(left[i]), *light]
        xyz += [sensor[i] + s * down[i] for s in places]
        share += [v * (60 / s) ** 2 for v, s in zip(light, places, strict=True)]
        number += range(1, len(places) + 1)
        total += [len(places)] * len(places)
        pulse += [i] * len(places)
    return Cloud(
        np.array(xyz),
        np.array([500_000.0, 5_300_000.0, 0.0]),
        {
            "GpsTime": time[pulse],
            "ReturnNumber": np.array(number),
            "NumberOfReturns": np.array(total),
            "Intensity": np.array(share) * 20_000,
        },
    ), sensor


def test_the_sensor_is_where_the_pulses_diverge():
    cloud, sensor = flight()
    found = pulses.assemble(cloud, window_s=0.5)
    start = cloud.xyz_m[found.point[found.first[:-1]]]
    seen = start - found.range_m[found.first[:-1], None] * found.direction
    assert np.abs(seen - sensor).max() < 0.01
    assert found.facts["directions"]["from_sensor"] == 1.0


def test_ground_and_canopy_are_weighed_by_what_pulses_that_met_both_tell():
    cloud, _ = flight()
    found = pulses.assemble(cloud, window_s=0.5)
    share, facts = pulses.energies(
        found, cloud.attributes["Intensity"], cloud.xyz_m[:, 2] < 1,
        range_exponent=2.0, ground_factor=None,
    )  # fmt: skip
    assert facts["ground_to_canopy_intensity"] == pytest.approx(0.6, rel=1e-3)
    sums = np.add.reduceat(share, found.first[:-1])
    np.testing.assert_allclose(sums, 1)


def test_without_intensity_returns_share_evenly():
    cloud, _ = flight(n=200)
    found = pulses.assemble(cloud, window_s=0.5)
    share, facts = pulses.energies(
        found, None, cloud.xyz_m[:, 2] < 1, range_exponent=2.0, ground_factor=None
    )
    counts = np.diff(found.first)
    np.testing.assert_allclose(share, np.repeat(1 / counts, counts))
    assert facts["intensity"] == "none"


def raster(values, bands):
    values = np.asarray(values, np.float32)
    return Raster(values, 500_000.0, 5_300_012.0, 0.25, "EPSG:25832", bands)


def scene(cloud, wood_share=0.0):
    inside = np.zeros((48, 48))
    inside[8:40, 8:40] = 1
    labels = raster([np.where(inside, 1, np.nan)] * 2, ("crown", "sub_crown"))
    return crown_scene.fill(
        cloud, labels, raster(np.zeros((1, 48, 48)), ("elevation_m",)),
        n_layers=3, base_share=0.0, min_height_m=0.5, voxel_m=0.2, alpha_m=0.8, alpha_spacings=0.0,
        clumping_index=1.0, wood_share=wood_share, facet_area_m2=0.01, seed=1,
        pulse_options={
            "window_s": 0.5, "range_exponent": 2.0, "ground_to_canopy_intensity": 0.0,
            "projection": 0.5, "max_density_m2_m3": 8.0,
        },
    )  # fmt: skip


def test_a_turbid_crown_gets_its_plant_area_back_as_facets():
    found = scene(flight(n=12_000)[0])
    # Slanting pulses that cross a side of the box were given no leaves: its rim is thinner.
    assert found.facts["leaf_area_m2"] == pytest.approx(1.0 * 8 * 8 * 3, rel=0.1)
    assert found.leaves.area_m2 == pytest.approx(found.facts["leaf_area_m2"], abs=0.01)
    assert found.table.n_facets.sum() == found.leaves.n_elements
    np.testing.assert_allclose(found.table.plant_area_density_m2_m3, 1.0, rtol=0.15)
    assert found.facts["plant_area_index"] == found.facts["leaf_area_m2"] / 12.0**2
    z = found.leaves.vertices_m[:, 2]
    assert z.min() > 4.9 - 0.1
    assert z.max() < 8.1 + 0.1


def test_the_same_cloud_gives_the_same_scene():
    cloud = flight(n=3000)[0]
    one, two = scene(cloud), scene(cloud)
    np.testing.assert_array_equal(one.leaves.vertices_m, two.leaves.vertices_m)


def test_a_crown_of_two_points_encloses_nothing_and_says_so():
    cloud = Cloud(
        np.array([[5.0, 5, 6], [5, 6, 6], [1, 1, 0], [1, 2, 0]]),
        np.array([500_000.0, 5_300_000.0, 0.0]),
    )
    with pytest.raises(InputError, match=r"2 points in crowns, which enclose no space"):
        scene(cloud)


def test_outlines_run_between_crowns_and_around_them_but_not_along_the_map():
    labels = np.ones((6, 6), int)
    labels[:, 3:] = 2
    edge = crowns.outlines(labels)
    assert edge[:, 2:4].all()
    assert not edge[:, [0, 1, 4, 5]].any()


def test_a_share_of_the_facets_is_wood_and_none_is_lost():
    cloud = flight(n=3000)[0]
    pure, mixed = scene(cloud), scene(cloud, wood_share=0.15)
    assert pure.wood.n_elements == 0
    n = pure.leaves.n_elements
    assert mixed.leaves.n_elements + mixed.wood.n_elements == n
    # A binomial draw: four standard deviations.
    assert mixed.wood.n_elements == pytest.approx(0.15 * n, abs=4 * np.sqrt(0.15 * 0.85 * n))
