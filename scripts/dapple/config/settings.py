"""The whole configuration of a run: its sections, one file each, and how it is validated.

The default configuration and its documentation are made from these classes: `make docs` writes
them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Ge
from pydantic import Field, ValidationError

from dapple.config import checks, inferred, old_keys
from dapple.config.advice import Advice
from dapple.config.base import Section, Some, key
from dapple.config.chlorophyll import Chlorophyll
from dapple.config.classify import Classify
from dapple.config.clean import Clean
from dapple.config.cloud import CloudInput
from dapple.config.corrections import Corrections
from dapple.config.download import Download
from dapple.config.exchange import Exchange
from dapple.config.explain import explain
from dapple.config.figures import Figures
from dapple.config.leaves import Leaves
from dapple.config.light import Light
from dapple.config.measured import Measured
from dapple.config.optics import Optics
from dapple.config.plant import Plant
from dapple.config.polygons import Polygons
from dapple.config.radiation import Radiation
from dapple.config.registration import Registration
from dapple.config.rescan import Rescan
from dapple.config.scan import Scan
from dapple.config.scan_frame import ScanFrame
from dapple.config.sensors import Sensors
from dapple.config.site import Site
from dapple.config.stability import Stability
from dapple.config.statistics import Statistics
from dapple.config.surfels import Surfels
from dapple.config.survey import Survey
from dapple.config.time import Time
from dapple.config.tools import Tools
from dapple.config.tradeoff import Tradeoff
from dapple.config.tree import Tree
from dapple.config.voxels import Voxels


class Settings(Section):
    """The whole configuration of a run."""

    experiment: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_+.-]*$")] = key(
        "virtual-apple", "name of the run: results go to results/{experiment}"
    )
    study: Literal["light", "survey", "chlorophyll", "stability"] = key(
        "light",
        "light under a tree, scanning designs, chlorophyll from images, or where methods fail",
    )
    seed: Annotated[int, Ge(0)] = key(1, "every random number of the run derives from it")
    data_dir: str = key("../shared/data", "folder of real data; only real experiments read it")
    download: Download = Download()
    source: Literal["auto", "virtual", "wood", "cloud"] = key(
        "auto",
        "a virtual tree and scan, real wood with virtual leaves, or a point cloud; auto: as "
        "cloud.path or wood_path tell",
    )
    reconstructions: Some[str] = key(
        ("polygons", "surfels", "voxels_0.2", "voxels_1.0", "truth"),
        "what light is computed for; of this default those that the source has",
    )
    ground_z_m: float | None = key(
        None, "height of flat ground; none: found in the cloud, else 0 of the tree's frame"
    )
    wood_path: str = key(
        "", "OBJ of wood polygons in LESS axes (source: wood), relative to data_dir"
    )
    plant: Plant = Plant()
    leaves: Leaves = Leaves()
    scan: Scan = Scan()
    cloud: CloudInput = CloudInput()
    tree: Tree = Tree()
    scan_frame: ScanFrame = ScanFrame()
    clean: Clean = Clean()
    classify: Classify = Classify()
    polygons: Polygons = Polygons()
    surfels: Surfels = Surfels()
    voxels: Voxels = Voxels()
    corrections: Corrections = Corrections()
    rescan: Rescan = Rescan()
    site: Site = Site()
    time: Time = Time()
    radiation: Radiation = Radiation()
    optics: Optics = Optics()
    sensors: Sensors = Sensors()
    measured: Measured = Measured()
    registration: Registration = Registration()
    light: Light = Light()
    advice: Advice = Advice()
    tradeoff: Tradeoff = Tradeoff()
    exchange: Exchange = Exchange()
    statistics: Statistics = Statistics()
    figures: Figures = Figures()
    survey: Survey = Survey()
    chlorophyll: Chlorophyll = Chlorophyll()
    stability: Stability = Stability()
    tools: Tools = Tools()

    @property
    def has_shots(self) -> bool:
        """Whether the run makes shots: always of a virtual scan; of a cloud where they are known.

        `cloud.shots: auto` makes them where something asks for them, or the format always has them.
        """
        if self.source != "cloud" or self.cloud.shots != "auto":
            return self.source != "cloud" or self.cloud.shots != "none"
        asked = any(name.startswith("voxels_") for name in self.reconstructions)
        asked = asked or self.corrections.occlusion or self.corrections.clumping
        return asked or self.cloud.path.lower().endswith(".ptx")


def validate(config: dict[str, Any], where: str = "configuration") -> Settings:
    """Turn a merged configuration into typed settings.

    Raises
    ------
    InputError
        A key that does not exist (the nearest valid one is named), a value of the wrong type or out
        of its range, or values that contradict each other.
    """
    try:
        written = Settings.model_validate(old_keys.renewed(config, where))
    except ValidationError as error:
        raise explain(error, Settings, where) from None
    settings = inferred.resolved(written)
    checks.check(settings, where)
    return settings
