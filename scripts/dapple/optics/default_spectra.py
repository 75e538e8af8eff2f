"""What leaves, bark and ground are like where nothing else is configured: the one home of each.

Tables of wavelength [nm] and reflectance are linear between their entries.
"""

LEAF = {
    "n": 1.5,
    "chlorophyll_ug_cm2": 45.0,
    "carotenoids_ug_cm2": 9.0,
    "anthocyanin_ug_cm2": 0.0,
    "brown": 0.0,
    "water_cm": 0.012,
    "dry_matter_g_cm2": 0.006,
}
"""Arguments of PROSPECT for a healthy, mature apple leaf. Assumed, not measured on any tree; in the
PAR band only chlorophyll matters much."""

BARK = {
    "wavelength_nm": tuple(400.0 + 25.0 * k for k in range(13)),
    "reflectance": (
        *(0.089, 0.091, 0.094, 0.097, 0.101, 0.107, 0.112),
        *(0.117, 0.123, 0.128, 0.131, 0.133, 0.178),
    ),
}
"""Mean of the measured reflectance of branches of birch and larch (spectral database of LESS, Qi et
al. 2019). The bark colour that comes with the published apple tree is brighter: red 0.37, green
0.36, blue 0.33 (Frey et al. 2025)."""

MEADOW = {
    "wavelength_nm": tuple(400.0 + 25.0 * k for k in range(13)),
    "reflectance": (
        *(0.032, 0.030, 0.029, 0.030, 0.035, 0.079, 0.093),
        *(0.068, 0.055, 0.047, 0.040, 0.036, 0.089),
    ),
}
"""Computed, not measured: mown grass as PROSAIL has it (Jacquemoud et al. 2009) with the leaves
above, leaf area index 1, leaf angles of a sphere and the soils of prosail half wet; its albedo
under an even sky. A test computes it again."""

CONIFER_BARK = {
    "wavelength_nm": (400.0, 450.0, 560.0, 650.0, 730.0, 840.0, 900.0, 1000.0),
    "reflectance": (0.06, 0.07, 0.11, 0.16, 0.23, 0.31, 0.34, 0.37),
}
"""Assumed: rough bark of conifers, browner and brighter towards the infrared."""

FOREST_SOIL = {
    "wavelength_nm": (400.0, 450.0, 560.0, 650.0, 730.0, 840.0, 900.0, 1000.0),
    "reflectance": (0.05, 0.065, 0.12, 0.19, 0.24, 0.28, 0.29, 0.32),
}
"""Assumed: a brown forest soil when dry, redder than the soils that retrieval mixes."""

LITTER = {
    "wavelength_nm": (400.0, 450.0, 560.0, 650.0, 730.0, 840.0, 900.0, 1000.0),
    "reflectance": (0.05, 0.06, 0.11, 0.17, 0.23, 0.31, 0.34, 0.37),
}
"""Assumed: dry litter of needles, without the green peak and the red edge of living leaves."""
