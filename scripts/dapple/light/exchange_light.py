"""Light at the sensors of an exchanged scene, by Mitsuba's integrators, band by band."""

from functools import partial

import pandas as pd

from dapple.light.timestep import Rays, timestep
from dapple.optics.responses import COSINE, Response
from dapple.progress import followed
from dapple.scene import mitsuba_scene
from dapple.scene.exchange import LitScene
from dapple.scene.facing import facing_of
from dapple.scene.sensors import POSITION
from dapple.streams import stream_seed


def light(
    lit: LitScene,
    rays: Rays,
    *,
    sun_diameter_deg: float,
    variant: str,
    seed: int,
    response: Response = COSINE,
) -> pd.DataFrame:
    """What every sensor receives in every band.

    Returns
    -------
    pandas.DataFrame
        `sensor`, `band`, `irradiance` and of it `direct`, `sky`, `scattered`; `standard_error`, all
        in the unit of the sky [µmol m⁻² s⁻¹ where the sky says so]; `open_sky`, the irradiance of
        the level without a plant.
    """
    zenith, azimuth, beam = lit.sky.beam()
    sky = lit.sky.without_sun()
    diffuse, whole = sky.horizontal(), lit.sky.horizontal()
    places = lit.sensors[POSITION].to_numpy(float)
    parts = []
    for band, name in enumerate(followed(list(lit.bands_nm), "bands")):
        scene = mitsuba_scene.build(lit.scene, lit.optics.of_band(band), variant=variant)
        found = timestep(
            scene,
            places,
            sun_zenith_deg=zenith,
            sun_azimuth_deg=azimuth,
            beam_normal=beam[band : band + 1],
            diffuse_horizontal=diffuse[band : band + 1],
            sky=partial(sky.radiance_at, band),
            sun_diameter_deg=sun_diameter_deg,
            rays=rays,
            aperture_m=lit.aperture_m,
            response=response,
            facing=facing_of(lit.sensors),
            seed=stream_seed(seed, band),
        )
        values = {
            "irradiance" if key == "total" else key: found[key][:, 0]
            for key in ("total", "direct", "sky", "scattered", "standard_error")
        }
        table = pd.DataFrame({"sensor": lit.sensors["sensor"], "band": name, **values})
        parts.append(table.assign(open_sky=whole[band]))
    return pd.concat(parts, ignore_index=True)
