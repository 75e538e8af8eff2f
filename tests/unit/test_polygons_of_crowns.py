"""Crowns keep their outlines and chlorophyll, in any format, and bad files say what is wrong."""

import json

import geopandas
import numpy as np
import pytest
import shapely

from dapple.errors import InputError
from dapple.formats import vectors

CORNER = np.array([612_000.0, 5_324_000.0])
SQUARE = CORNER + np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
SECOND = SQUARE + 5


@pytest.fixture
def crowns():
    return vectors.of_rings([SQUARE, SECOND], [3, 8], [31.5, 52.25], "EPSG:25832")


def frame(polygons=None, crs="EPSG:25832", **columns):
    polygons = [shapely.Polygon(SQUARE), shapely.Polygon(SECOND)] if polygons is None else polygons
    return geopandas.GeoDataFrame(columns, geometry=polygons, crs=crs)


def changed(path, crowns, change):
    vectors.write(path, crowns)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return path


def test_a_file_gives_back_what_was_written(crowns, tmp_path):
    vectors.write(tmp_path / "crowns.geojson", crowns)
    again = vectors.read(tmp_path / "crowns.geojson")
    for one, other in zip(again.outlines(), crowns.outlines(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert again.names == ("3", "8")
    assert again.lcc_ug_cm2.tolist() == [31.5, 52.25]
    assert again.crs == "EPSG:25832"


@pytest.mark.parametrize("name", ["crowns.gpkg", "crowns.shp", "crowns.geojson"])
def test_any_vector_format_is_brought_to_the_system_of_the_images(tmp_path, name):
    path = tmp_path / name
    there = frame(tree=["a", "b"], lcc_ug_cm2=[31.5, 52.25]).to_crs("EPSG:3857")
    there.to_file(path)
    read = vectors.read(path, crs="EPSG:25832")
    assert read.names == ("a", "b")
    assert read.lcc_ug_cm2.tolist() == [31.5, 52.25]
    assert shapely.Polygon(read.outlines()[0]).symmetric_difference(
        shapely.Polygon(SQUARE)
    ).area == pytest.approx(0.0, abs=1e-3)


def test_degrees_are_brought_to_metres_where_a_system_is_given(tmp_path):
    path = tmp_path / "crowns.geojson"
    frame().to_crs("EPSG:4326").to_file(path)
    assert vectors.read(path, crs="EPSG:25832").outlines()[0].min(axis=0) == pytest.approx(
        CORNER, abs=0.02
    )
    with pytest.raises(InputError, match="EPSG:4326; expected a projected system"):
        vectors.read(path)


def test_crowns_without_chlorophyll_are_crowns_and_some_may_lack_it(tmp_path):
    path = tmp_path / "crowns.gpkg"
    frame().to_file(path)
    read = vectors.read(path)
    assert read.names == ("1", "2")
    assert np.isnan(read.lcc_ug_cm2).all()
    assert "not held against trees" in read.findings[0].found
    frame(lcc_ug_cm2=[None, 40.0]).to_file(path)
    assert np.isnan(vectors.read(path).lcc_ug_cm2[0])
    assert vectors.read(path).lcc_ug_cm2[1] == 40.0
    frame(lcc_ug_cm2=["39,5", ""]).to_file(path)
    assert vectors.read(path).lcc_ug_cm2[0] == 39.5


def test_columns_are_found_by_usual_names_or_keys(tmp_path):
    path = tmp_path / "crowns.gpkg"
    frame(Baum=["x", "y"], SPAD_converted=[40.0, 50.0]).to_file(path)
    columns = {"tree_column": "Baum", "lcc_column": "spad_converted"}
    read = vectors.read(path, **columns)
    assert read.names == ("x", "y")
    assert read.lcc_ug_cm2.tolist() == [40.0, 50.0]
    with pytest.raises(InputError, match="Correct `crowns_tree_column`"):
        vectors.read(path, tree_column="tree")


def test_shapes_of_many_kinds_become_polygons_and_what_is_none_is_left_out_and_said(tmp_path):
    bowtie = shapely.Polygon([(0, 0), (5, 5), (5, 0), (0, 5)])
    shapes = [
        bowtie,
        shapely.GeometryCollection([shapely.Point(0, 0), shapely.box(0, 0, 1, 1)]),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 2, 3, 3)]),
        shapely.force_3d(shapely.box(0, 0, 1, 1)),
        shapely.Point(1, 1),
        None,
        shapely.Polygon(),
    ]
    path = tmp_path / "crowns.geojson"
    frame(shapes).to_file(path)
    read = vectors.read(path)
    areas = [shapely.geometry.shape(geometry).area for geometry in read.geometries]
    assert areas == pytest.approx([12.5, 1.0, 2.0, 1.0])
    said = " ".join(map(str, read.findings))
    assert "cross themselves in 1 features" in said
    assert "3 of 7 features without a polygon" in said


def test_crowns_beyond_the_images_are_left_out_and_said_and_all_of_them_are_refused(crowns):
    west, south = CORNER
    kept = vectors.within(crowns, (west - 1, south - 1, west + 3, south + 3), "a.gpkg")
    assert kept.names == ("3",)
    assert "1 of 2 crowns beyond the images" in kept.findings[-1].found
    with pytest.raises(InputError, match="crowns under the images"):
        vectors.within(crowns, (0.0, 0.0, 10.0, 10.0), "a.gpkg")


def test_a_tree_that_is_there_twice_is_said(tmp_path):
    path = tmp_path / "crowns.gpkg"
    frame(tree=["a", "a"], lcc=[30.0, 40.0]).to_file(path)
    assert "tree a more than once" in vectors.read(path).findings[0].found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("crs"), "no projected system"),
        (lambda c: c["features"].clear(), "no features|nothing that GDAL reads"),
        (lambda c: c["features"][0]["properties"].update(lcc_ug_cm2=-3), "-3(.0)? in feature 1"),
        (lambda c: c["features"][0]["properties"].update(lcc_ug_cm2=0), "0(.0)? in feature 1"),
        (
            lambda c: [f.update(geometry={"type": "Point", "coordinates": [1, 2]})
                       for f in c["features"]],
            "no polygon with an area",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(crowns, tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        vectors.read(changed(tmp_path / "a.geojson", crowns, change))


def test_files_that_are_no_vectors_are_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        vectors.read(tmp_path / "none.gpkg")
    (tmp_path / "a.gpkg").write_text("crowns")
    with pytest.raises(InputError, match="nothing that GDAL reads"):
        vectors.read(tmp_path / "a.gpkg")
    frame(tree=["a", "b"]).to_file(tmp_path / "a.shp")
    (tmp_path / "a.dbf").unlink()
    with pytest.raises(InputError, match=r"a Shapefile without its \.dbf"):
        vectors.read(tmp_path / "a.shp")


def test_several_layers_need_a_name(tmp_path):
    path = tmp_path / "crowns.gpkg"
    for layer in ("north", "south"):
        frame().to_file(path, layer=layer)
    with pytest.raises(InputError, match="layers north, south"):
        vectors.read(path)
    assert len(vectors.read(path, layer="south").names) == 2


def test_another_coordinate_system_is_refused(crowns):
    vectors.require_crs(crowns, "EPSG:25832", "crowns.geojson")
    with pytest.raises(InputError, match="crowns in EPSG:25832; expected EPSG:25833"):
        vectors.require_crs(crowns, "EPSG:25833", "crowns.geojson")


def test_a_feature_that_gdal_cannot_parse_is_a_message(tmp_path):
    path = tmp_path / "crowns.gml"
    path.write_text(
        '<ogr:FeatureCollection xmlns:ogr="http://ogr.maptools.org/" '
        'xmlns:gml="http://www.opengis.net/gml/3.2"><ogr:featureMember><ogr:c gml:id="c.0">'
        '<ogr:shape><gml:Polygon srsName="urn:ogc:def:crs:EPSG::25832" srsDimension="3">'
        "<gml:exterior><gml:LinearRing><gml:posList>1 1 3 1</gml:posList></gml:LinearRing>"
        "</gml:exterior></gml:Polygon></ogr:shape></ogr:c></ogr:featureMember>"
        "</ogr:FeatureCollection>"
    )
    with pytest.raises(InputError, match=r"crowns\.gml"):
        vectors.read(path)


@pytest.mark.parametrize(
    ("tree", "lcc"),
    [
        ("Tree_ID", "Cab"),
        ("treeID", "LCC [ug cm-2]"),
        ("TREE_NO", "Chl_ug"),
        ("Baum", "chl_a_b"),
        ("tag", "chlorophyll_content"),
        ("crown_id", "lcc_mean"),
    ],
)
def test_columns_are_known_by_what_people_call_them(tmp_path, tree, lcc):
    squares = [shapely.box(5e5 + k, 5.3e6, 5e5 + k + 0.9, 5.3e6 + 1) for k in range(2)]
    columns = {tree: [7.0, 8.0], lcc: [30.0, -9999.0], "SPAD": [40.0, 41.0], "lcc_sd": [1.0, 2.0]}
    frame = geopandas.GeoDataFrame(columns, geometry=squares, crs="EPSG:25832")
    frame.to_file(tmp_path / "crowns.gpkg")
    read = vectors.read(tmp_path / "crowns.gpkg")
    assert read.names == ("7", "8")
    assert read.lcc_ug_cm2 == pytest.approx([30.0, np.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"chl_upper": [30.0], "chl_lower": [40.0]}, "`crowns_lcc_column`"),
        ({"chl_mg_m2": [300.0]}, "10 mg m⁻² are 1 µg"),
    ],
)
def test_chlorophyll_in_several_columns_or_other_units_is_not_guessed(tmp_path, columns, message):
    frame = geopandas.GeoDataFrame(
        columns, geometry=[shapely.box(5e5, 5.3e6, 5e5 + 1, 5.3e6 + 1)], crs="EPSG:25832"
    )
    frame.to_file(tmp_path / "crowns.gpkg")
    with pytest.raises(InputError, match=message):
        vectors.read(tmp_path / "crowns.gpkg")
