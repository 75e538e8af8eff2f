"""What a virtual scanner is like: beam, detector, and how bright it sees each surface."""

from dataclasses import dataclass

from dapple.errors import InputError


@dataclass(frozen=True)
class Scanner:
    """What the scanner is like and how it sees surfaces.

    Divergence, field of view, shortest range and noise of range (its accuracy of 5 mm) are the
    maker's figures for the VZ-400i; the other defaults are plausible choices.

    Attributes
    ----------
    angular_step_deg : float
        Step of azimuth and zenith angle; Frey et al. (2025) scanned with 0.04°.
    zenith_min_deg, zenith_max_deg : float
        Field of view, 100° from 30° off the zenith.
    beam_divergence_mrad : float
        Full angle between the 1/e² edges.
    exit_aperture_m : float
        1/e² diameter of the beam where it leaves the scanner.
    sub_rays : int
        Rays of equal energy that make up one beam.
    min_range_m, max_range_m : float
        Echoes outside are not recorded.
    range_noise_m : float
        Standard deviation of one echo's range.
    min_separation_m : float
        Echoes closer than this merge into one. A pulse of 3 ns is 0.45 m long in range; the
        echoes of two targets stop touching when they are a little less than twice that apart.
    max_returns : int
        The nearest ones of a shot are kept.
    min_energy : float
        Weakest echo that is detected, as a share of what a white plate returns.
    noise_points_per_shot : float
        Chance that a shot has a return without a target, anywhere along the beam up to where
        it leaves the window.
    leaf_reflectance_db, wood_reflectance_db, ground_reflectance_db : (float, float)
        Mean and standard deviation over elements at normal incidence, relative to a white
        plate. At 1550 nm leaves are darker than bark because of their water, which is why
        Frey et al. (2025) could part them at -5.4 dB.
    reflectance_noise_db : float
        Standard deviation of one echo within an element (texture, speckle).
    incidence_exponent : float
        Reflectance falls with the cosine of incidence to this power: 1 is a Lambertian
        surface, 0 a full correction.
    clean_deviation, clean_deviation_sd : float
        Pulse shape deviation of an echo from one plane target.
    pulse_length_m : float
        Full width at half maximum of the pulse, in range (3 ns).
    noise_reflectance_db : (float, float)
        Mean and standard deviation for returns without a target.
    noise_deviation : float
        Mean (exponential) of their pulse shape deviation.
    """

    angular_step_deg: float = 0.04
    zenith_min_deg: float = 30.0
    zenith_max_deg: float = 130.0
    beam_divergence_mrad: float = 0.35
    exit_aperture_m: float = 0.007
    sub_rays: int = 7
    min_range_m: float = 0.5
    max_range_m: float = 250.0
    range_noise_m: float = 0.005
    min_separation_m: float = 0.8
    max_returns: int = 5
    min_energy: float = 0.01
    noise_points_per_shot: float = 0.001
    leaf_reflectance_db: tuple[float, float] = (-8.0, 1.5)
    wood_reflectance_db: tuple[float, float] = (-2.5, 1.1)
    ground_reflectance_db: tuple[float, float] = (-7.0, 0.5)
    reflectance_noise_db: float = 1.0
    incidence_exponent: float = 0.5
    clean_deviation: float = 3.0
    clean_deviation_sd: float = 2.0
    pulse_length_m: float = 0.45
    noise_reflectance_db: tuple[float, float] = (-16.0, 3.0)
    noise_deviation: float = 40.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("angular_step_deg", 1e-4, 45.0),
            ("zenith_min_deg", 0.0, self.zenith_max_deg),
            ("zenith_max_deg", self.zenith_min_deg, 180.0),
            ("sub_rays", 1, 64),
            ("max_returns", 1, 255),
            ("noise_points_per_shot", 0.0, 1.0),
            ("max_range_m", self.min_range_m, 1e4),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    f"scan.{name}",
                    str(getattr(self, name)),
                    f"{low} to {high}",
                    "Correct the configuration.",
                )
