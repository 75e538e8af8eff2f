"""Each row of the page on input is true: the format is built, and what the page writes reads it."""

import re

import numpy as np
import pandas as pd
import pytest
import rasterio
import yaml
from rasterio.transform import from_origin
from tests.unit.weather import FREIBURG

from dapple.code_use import SCRIPTS
from dapple.config.settings import validate
from dapple.formats import user_rasters
from dapple.optics.cameras import CAMERAS, camera
from dapple.sky import radiation_table
from dapple.stats import measured

PAGE = SCRIPTS.parent / "docs" / "input.md"
ROW = re.compile(r"^\| (?P<have>[^|]+?) \| `(?P<write>(?:radiation|measured|chlorophyll): .+)` \|$")
ROWS = {m["have"]: m["write"] for line in PAGE.read_text().splitlines() if (m := ROW.match(line))}
HOUR = pd.Timestamp("2023-08-10 10:00", tz="UTC")
"""Of the first value, as the format's stamp means it."""

TABLES = {
    "Campbell TOA5": '"TOA5","a","CR1000","1","x","y","z","T"\n"TIMESTAMP","RECORD","SlrW_Avg"\n'
    '"TS","RN","W/m^2"\n"","","Avg"\n"2023-08-10 11:00:00",1,500\n"2023-08-10 11:10:00",2,510\n'
    '"2023-08-10 11:20:00",3,"NAN"\n',
    "DWD ten-minute radiation": "STATIONS_ID;MESS_DATUM;QN;DS_10;GS_10;SD_10;LS_10;eor\n"
    "1443;202308101000;3;6;30;0.1;-999;eor\n1443;202308101010;3;-999;-999;0.1;-999;eor\n",
    "DWD hourly radiation": "STATIONS_ID;MESS_DATUM;QN_592;ATMO_LBERG;FD_LBERG;FG_LBERG;SD_LBERG;"
    "ZENIT;MESS_DATUM_WOZ;eor\n1443;2023081010:00;1;100;36;180;60;40;2023081010:30;eor\n",
    "BSRN from PANGAEA": "/* DATA DESCRIPTION:\n*/\nDate/Time\tSWD [W/m**2]\tDIF [W/m**2]\n"
    "2023-08-10T10:00\t500\t100\n2023-08-10T10:01\t501\t100\n",
    "NSRDB": "Source,Location ID,Time Zone\nNSRDB,1,-5\nYear,Month,Day,Hour,Minute,GHI,DHI\n"
    "2023,8,10,5,0,500,100\n2023,8,10,5,30,510,100\n",
    "PVGIS hourly, slope 0": "Latitude (decimal degrees):\t48\nSlope: 0 deg.\ntime,Gb(i),Gd(i)\n"
    "20230810:1000,400,100\n20230810:1100,410,100\n\nGb(i): beam\n",
    "PVGIS hourly as JSON, slope 0": '{"inputs": {"mounting_system": {"fixed": {"slope": {"value": '
    '0}}}}, "outputs": {"hourly": [{"time": "20230810:1000", "Gb(i)": 400.0, "Gd(i)": 100.0}, '
    '{"time": "20230810:1100", "Gb(i)": 410.0, "Gd(i)": 100.0}]}}',
    "FLUXNET or ICOS": "TIMESTAMP_START,TIMESTAMP_END,SW_IN\n202308101100,202308101130,500\n"
    "202308101130,202308101200,-9999\n",
    "CAMS radiation service": "# Coding: utf-8\n# Observation period;GHI;DHI\n"
    "2023-08-10T10:00:00.0/2023-08-10T10:15:00.0;125;25\n",
    "Solcast": "Ghi,Dhi,PeriodEnd,PeriodStart,Period\n"
    "500,100,2023-08-10T10:00:00Z,2023-08-10T09:30:00Z,PT30M\n",
    "Open-Meteo": "latitude,longitude,elevation,utc_offset_seconds,timezone\n48,8,1,0,GMT\n\n"
    "time,shortwave_radiation (W/m²)\n2023-08-10T10:00,500\n2023-08-10T11:00,510\n",
    "Open-Meteo as JSON": '{"utc_offset_seconds": 7200, "hourly": {"time": ["2023-08-10T12:00", '
    '"2023-08-10T13:00"], "shortwave_radiation": [500, 510]}}',
    "KNMI hourly": "# BRON: KNMI\n# Q : Globale straling (in J/cm2) per uurvak\n#\n"
    "# STN,YYYYMMDD,   HH,    T,    Q\n#\n  260,20230810,   10,  180,  180\n"
    "  260,20230810,   24,  190,     \n",
    "SURFRAD": " Boulder\n  40.125 -105.237 1689 m version 1\n"
    + "".join(
        f" 2023 222  8 10 10 {minute:2d} 10.000  45.00  {power}.0 {flag}  120.0 0  700.0 0  100.0 0"
        + " -9999.9 0" * 16
        + "\n"
        for minute, power, flag in ((0, 500, 0), (1, 999, 1))
    ),
    "MIDC of NREL": "DATE (MM/DD/YYYY),MST,Global Horizontal [W/m^2],Direct Normal [W/m^2],"
    "Diffuse Horizontal [W/m^2]\n08/10/2023,03:00,500.0,700.0,100.0\n"
    "08/10/2023,03:01,501.0,700.0,100.0\n",
    "METER ZL6 or Decagon Em50": "z6-1,Port 1,Port 2\n2 records,ATMOS 41,ATMOS 41\n"
    "Timestamps,W/m² Solar Radiation,mm Rain\n2023-08-10 11:00:00,500,0\n"
    "2023-08-10 11:15:00,510,0\n",
    "Davis WeatherLink, text": "\t\tTemp\tSolar\tHi Solar\nDate\tTime\tOut\tRad.\tRad.\n"
    "08/10/23\t11:00a\t20.1\t500\t520\n08/10/23\t11:30a\t20.1\t510\t530\n",
    "NASA POWER hourly": "-BEGIN HEADER-\nNASA/POWER CERES/MERRA2 Native Resolution Hourly Data\n"
    "Dates (month/day/year): 08/10/2023 through 08/10/2023 in UTC\n"
    "ALLSKY_SFC_SW_DWN      CERES SYN1deg All Sky Surface Shortwave (Wh/m^2)\n-END HEADER-\n"
    "YEAR,MO,DY,HR,ALLSKY_SFC_SW_DWN\n2023,8,10,10,500\n2023,8,10,11,-999\n",
    "ERA5 hourly series": "valid_time,ssrd,latitude,longitude\n"
    "2023-08-10 10:00:00,1800000,48,8\n2023-08-10 11:00:00,1836000,48,8\n",
    # The sun is 37.8° from the zenith over Freiburg at this time.
    "diffuse and direct normal radiation, without global": "time_utc,dhi,dni\n"
    "2023-08-10 10:00,100,506.0\n2023-08-10 10:10,100,500\n",
    "diffuse and direct radiation on the horizontal": "time_utc,diffuse,direct\n"
    "2023-08-10 10:00,100,400\n2023-08-10 10:10,100,410\n",
    "illuminance above the trees in lux": "time_utc,global [lux]\n2023-08-10 10:00,55000\n"
    "2023-08-10 10:10,55100\n",
    "CSV of a spreadsheet, day and clock apart": "Datum;Uhrzeit;Globalstrahlung [W/m²]\n"
    "10.08.2023;12:00;500,0\n10.08.2023;12:10;1.001,5\n",
    "rows with the start and the end of an interval": "Beginn;Ende;Globalstrahlung [W/m²]\n"
    "10.08.2023 12:00;10.08.2023 12:10;500,0\n10.08.2023 12:10;10.08.2023 12:20;1.001,5\n",
}
TABLES["EnergyPlus weather, EPW"] = (
    "LOCATION,Freiburg,-,DEU,TMY3,108030,48.00,7.85,1.0,308.0\n"
    "DESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\nGROUND TEMPERATURES,0\n"
    "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,a\nCOMMENTS 2,b\n"
    "DATA PERIODS,1,1,Data,Sunday, 1/ 1,12/31\n"
    "2023,8,10,11,0,?9,20,10,50,98000,900,1340,300,500,700,100" + ",0" * 19 + "\n"
    "2023,8,10,12,60,?9,20,10,50,98000,900,1340,300,9999,700,100" + ",0" * 19 + "\n"
)
TABLES["TMY3 of NREL"] = (
    '723815,"DAGGETT",CA,-8.0,34.867,-116.783,586\n'
    "Date (MM/DD/YYYY),Time (HH:MM),ETR (W/m^2),GHI (W/m^2),GHI source,DNI (W/m^2),DHI (W/m^2)\n"
    "08/10/2023,02:00,900,500,1,700,100\n08/10/2023,24:00,900,0,1,0,0\n"
)
WORKBOOK = "workbook of a spreadsheet, XLSX"
SHEET = pd.DataFrame(
    {
        "Datum": pd.to_datetime(["2023-08-10 12:00:00", "2023-08-10 12:10:00"]),
        "Globalstrahlung [W/m²]": [500.0, 1001.5],
        "Diffus [W/m²]": [100, 101],
    }
)
RECORDS = {
    "HOBO export": ("logger_3_7.csv", '"Plot Title: a"\n"#","Date Time, GMT+02:00","PAR, uE"\n'
                    "1,08/10/23 12:00:00 PM,500\n2,08/10/23 12:01:00 PM,501\n"),
    "records of a lux meter": ("lux.csv", "sensor,time_utc,par [lux]\n3_7,2023-08-10 10:00,27000\n"
                               "3_7,2023-08-10 10:01,27001\n"),
    "a column for each sensor": ("wide.csv", "TIMESTAMP,PAR_3_7_Avg,PAR_3_7_Std,PAR_3_8_Avg\n"
                                 "2023-08-10 10:00,500,3,600\n2023-08-10 10:01,501,3,601\n"),
}  # fmt: skip
IMAGES = {
    "MicaSense RedEdge-MX, 16 bits": ("uint16", 32768),
    "Phantom 4 Multispectral, reflectance": ("float32", 1),
    "bands as Sentinel-2 has them, 0 to 10,000": ("uint16", 10_000),
}


def written(have):
    """The settings of a row on top of the defaults."""
    return validate(yaml.safe_load(ROWS[have].replace("kind: table", "kind: table, path: a.csv")))


def test_every_row_is_tested_and_there_are_twelve_at_least():
    assert set(ROWS) == {*TABLES, *RECORDS, *IMAGES, WORKBOOK}
    assert len(ROWS) >= 12


@pytest.mark.parametrize("have", TABLES)
def test_radiation_is_read_in_its_unit_and_zone(have, tmp_path):
    (tmp_path / "a.csv").write_text(TABLES[have], encoding="utf-8")
    section = written(have).radiation
    own = ("global_column", "diffuse_column", "direct_column", "direct_plane")
    columns = {key: getattr(section, key) for key in own}
    declared = section.model_dump(include=set(radiation_table.Declared.__dataclass_fields__))
    found = radiation_table.read(tmp_path / "a.csv", site=FREIBURG, **columns, **declared)
    assert found.table.index[0] == HOUR
    assert found.table["global_w_m2"].iloc[0] == pytest.approx(500.0, abs=0.5)


def test_a_workbook_is_read_as_the_table_it_holds(tmp_path):
    SHEET.to_excel(tmp_path / "a.xlsx", index=False)
    section = written(WORKBOOK).radiation
    declared = section.model_dump(include=set(radiation_table.Declared.__dataclass_fields__))
    found = radiation_table.read(tmp_path / "a.xlsx", site=FREIBURG, **declared).table
    assert found.index[0] == HOUR
    assert found.to_numpy().tolist() == [[500.0, 100.0], [1001.5, 101.0]]


@pytest.mark.parametrize("have", RECORDS)
def test_records_are_read_by_sensor(have, tmp_path):
    name, text = RECORDS[have]
    (tmp_path / name).write_text(text, encoding="utf-8")
    places = pd.DataFrame({"sensor": ["3_7", "3_8"], "x_m": 0.0, "y_m": 0.0, "z_m": 0.0})
    found = measured.read(tmp_path / name, sensors=places, **written(have).measured.table()).table
    assert found["time"].iloc[0] == HOUR
    assert found["par_umol_m2_s"].iloc[0] == pytest.approx(500.0)


@pytest.mark.parametrize("have", IMAGES)
def test_images_are_read_as_reflectance(have, tmp_path):
    kind, most = IMAGES[have]
    section = written(have).chlorophyll
    bands = camera(section.camera_bands).bands
    values = np.linspace(0.03, 0.45, len(bands))[:, None, None] * np.ones((1, 40, 40))
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", count=len(bands), height=40, width=40, dtype=kind,
        crs="EPSG:25832", transform=from_origin(5e5, 5.3e6, 0.1, 0.1),
    ) as file:  # fmt: skip
        file.write((values * most).astype(kind))
    found = user_rasters.read(tmp_path / "a.tif", bands, scale=section.user.scale)
    assert len(CAMERAS[section.camera]) == len(bands)
    assert np.nanmedian(found.raster.values, axis=(1, 2)) == pytest.approx(
        values[:, 0, 0], abs=1e-3
    )
