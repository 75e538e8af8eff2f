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
    "wavelength_nm": (400.0, 500.0, 550.0, 600.0, 680.0, 700.0),
    "reflectance": (0.03, 0.05, 0.10, 0.07, 0.05, 0.12),
}
"""Assumed, typical of green grass in summer: dark in blue and red, a green peak, the red edge."""

CONIFER_BARK = {
    "wavelength_nm": (400.0, 450.0, 560.0, 650.0, 730.0, 840.0, 900.0),
    "reflectance": (0.06, 0.07, 0.11, 0.16, 0.23, 0.31, 0.34),
}
"""Assumed: rough bark of conifers, browner and brighter towards the infrared."""

LITTER = {
    "wavelength_nm": (400.0, 450.0, 560.0, 650.0, 730.0, 840.0, 900.0),
    "reflectance": (0.05, 0.06, 0.11, 0.17, 0.23, 0.31, 0.34),
}
"""Assumed: dry litter of needles, without the green peak and the red edge of living leaves."""
