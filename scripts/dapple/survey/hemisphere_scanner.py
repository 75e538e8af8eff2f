"""What a hemispherical scanner is like, and how many beams it fires."""

from dataclasses import dataclass

from dapple.errors import InputError


@dataclass(frozen=True)
class Hemisphere:
    """What the scanner is like.

    Attributes
    ----------
    zenith_step_deg : float
        Beams leave at the middle of steps from 0° to 90°.
    azimuth_steps_deg : tuple of float
        Coarse to fine steps of one scan of a design with a single position. The finest is fired;
        each coarser one is a multiple of it, and its beams are some of those fired.
    beam_divergence_mrad : float
        Full angle of the cone.
    exit_aperture_m : float
        Diameter of the beam at the scanner.
    sub_rays : int
        Rays of equal energy that make up a beam.
    reflectance : float
        Of leaf and wood at the laser's wavelength.
    min_energy : float
        A return needs this share of the beam's energy reflected within `pulse_m`.
    pulse_m : float
        Targets closer than this in range reflect together.
    max_range_m : float
        Longest range.
    max_returns : int
        Returns that are kept of a beam; 1 keeps the first alone.
    """

    zenith_step_deg: float = 0.25
    azimuth_steps_deg: tuple[float, ...] = (0.5, 0.2, 0.1, 0.04, 0.02)
    beam_divergence_mrad: float = 4.4
    exit_aperture_m: float = 0.01
    sub_rays: int = 7
    reflectance: float = 0.45
    min_energy: float = 0.1
    pulse_m: float = 0.5
    max_range_m: float = 80.0
    max_returns: int = 1

    def __post_init__(self) -> None:
        ratio = [step / min(self.azimuth_steps_deg) for step in self.azimuth_steps_deg]
        if not ratio or any(abs(r - round(r)) > 1e-6 + 1e-5 * r for r in ratio):
            raise InputError(
                "survey.azimuth_steps_deg",
                str(list(self.azimuth_steps_deg)),
                "at least one step, all multiples of the finest",
                "Coarser scans are made of beams of the finest one.",
            )
        if len(ratio) > 16:
            raise InputError(
                "survey.azimuth_steps_deg", f"{len(ratio)} steps", "at most 16", "Leave some out."
            )
        if self.n_zenith < 1 or 360 / max(self.azimuth_steps_deg) < 1:
            raise InputError(
                "survey.azimuth_steps_deg",
                f"steps of {self.zenith_step_deg:g}° and {max(self.azimuth_steps_deg):g}°",
                "steps below 90° and 360°",
                "Such a scan has no beam.",
            )

    @property
    def n_zenith(self) -> int:
        """Beams from the zenith to the horizon."""
        return round(90 / self.zenith_step_deg)

    def n_azimuth(self, n_positions: int) -> int:
        """Finest azimuths of each scan when `n_positions` share the beams."""
        count = int(360 / (min(self.azimuth_steps_deg) * n_positions) + 1e-6)
        if count < max(self.multiples):
            raise InputError(
                "survey.azimuth_steps_deg",
                f"{count} azimuths in each of {n_positions} scans",
                f"at least {max(self.multiples)}",
                "Take finer steps or fewer positions: a scan would have no beam.",
            )
        return count

    @property
    def multiples(self) -> tuple[int, ...]:
        """Each azimuth step as a multiple of the finest."""
        finest = min(self.azimuth_steps_deg)
        return tuple(round(step / finest) for step in self.azimuth_steps_deg)

    def n_beams(self, n_positions: int) -> list[int]:
        """Beams of a whole design, for each azimuth step."""
        n = self.n_azimuth(n_positions)
        return [n_positions * self.n_zenith * -(-n // multiple) for multiple in self.multiples]
