"""What penumbra, clumping, diffuse light and scattering each add on the published apple tree.

    python benchmarks/contributions.py [--folder results/apple] [--docs docs]

Needs a finished run of config/apple.yaml. Every row leaves one thing out of the full model and is
compared with the records that the registration has not seen (docs/data/apple_contributions.csv).
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from published_apple import Run

from dapple.scene import traced
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.open_sky import open_sky_par
from dapple.streams import stream_seed
from dapple.virtual.leaves import along_wood

PARTS = ("direct", "sky", "scattered")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("results/apple"))
    parser.add_argument("--step", type=float, default=1.0, help="minutes between times")
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    options = parser.parse_args()
    run = Run(options.folder, options.step)
    found = run.registration
    shift_m, gain = (found["east_m"], found["north_m"]), found["gain"]
    reporting = [n for n in run.sensors["sensor"] if n not in found["fitting_sensors"]]
    loaded = [traced.load(scene) for scene in run.scenes("polygons")]
    sky, isotropic = run.sky(gain=gain), run.sky(gain=gain, model="isotropic")
    clear = with_diffuse_share_of(sky, run.sky(kind="clear_sky"))

    def score(placements, parts=PARTS) -> dict[str, float]:
        light = np.mean([sum(getattr(p, part) for part in parts) for p in placements], axis=0)
        return run.score(light, reporting)

    full = run.light(loaded, sky, shift_m)
    open_sky = open_sky_par(sky).to_numpy()
    rows = {
        "full model": score(full),
        "one placement of the leaves": score(full[:1]),
        "no gain of the site": score(run.light(loaded, run.sky(), shift_m)),
        "leaves that do not sway": score(run.light(loaded, sky, shift_m, entrance_m=0.0)),
        "a point for the sun, no sway": score(
            run.light(loaded, sky, shift_m, entrance_m=0.0, sun="point")
        ),
        "leaves clumped on shoots": score(run.light(clumped(run), sky, shift_m)),
        "an isotropic sky": score(run.light(loaded, isotropic, shift_m)),
        "diffuse share of the clear-sky model": score(run.light(loaded, clear, shift_m)),
        "no scattered light": score(full, ("direct", "sky")),
        "no diffuse light at all": score(full, ("direct",)),
        "no tree": run.score(np.broadcast_to(open_sky, full[0].par.shape), reporting),
    }
    table = pd.DataFrame(rows).T.rename_axis("model").reset_index()
    path = options.docs / "data" / "apple_contributions.csv"
    table.to_csv(path, index=False, float_format="%.5g")
    print(table.to_string(index=False, float_format=lambda value: f"{value:.3f}"))


def with_diffuse_share_of(sky, other):
    """The same total light on the level, split into beam and diffuse as in another sky."""
    changed = sky.copy(deep=True)
    total = open_sky_par(sky)
    share = other["diffuse_horizontal_umol_m2_s"].sum("band") / open_sky_par(other)
    own_diffuse = sky["diffuse_horizontal_umol_m2_s"].sum("band")
    changed["diffuse_horizontal_umol_m2_s"] *= share * total / own_diffuse
    changed["beam_normal_umol_m2_s"] *= (1 - share) * total / (total - own_diffuse)
    return changed


def clumped(run: Run) -> list[traced.TracedScene]:
    """As many leaves with as much area, 128 on a shoot."""
    placing = run.settings.leaves.model_dump(exclude={"placements", "path"}) | {
        "leaves_per_shoot": 128
    }
    scenes = []
    for number in range(run.settings.leaves.placements):
        leaves = along_wood(run.wood, **placing, seed=stream_seed(7, number))
        surfaces = of_kinds(leaf=leaves, wood=run.wood)
        scenes.append(traced.load(Scene(surfaces, None, run.settings.ground_z_m)))
    return scenes


if __name__ == "__main__":
    main()
