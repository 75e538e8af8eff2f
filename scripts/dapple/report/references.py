"""What a run builds on, as citations and as BibTeX."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Reference:
    """An article, or a program (without a journal)."""

    author: str
    year: int
    title: str
    journal: str = ""
    place: str = ""
    doi: str = ""

    def cited(self) -> str:
        """As it stands in a list of references."""
        who = self.author.replace(" and others", " et al.").replace(" and ", ", ")
        where = f" {self.journal} {self.place}.".replace(" .", ".") if self.journal else ""
        doi = f" doi:{self.doi}" if self.doi else ""
        return f"{who} ({self.year}). {self.title}.{where}{doi}"

    def bibtex(self, key: str) -> str:
        """An entry of a BibTeX file."""
        volume, _, pages = self.place.partition(", ")
        fields = {
            "author": self.author,
            "year": str(self.year),
            "title": f"{{{self.title}}}",
            "journal": self.journal,
            "volume": volume,
            "pages": pages.replace("–", "--"),
            "doi": self.doi,
        }
        kept = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items() if value)
        return f"@{'article' if self.journal else 'software'}{{{key},\n{kept}\n}}"


REFERENCES = {
    "frey2025": Reference(
        "Frey, J. and Schindler, Z. and McClatchy, P. and Morhart, C. and Larysch, E. and "
        "Seifert, T.",
        2025,
        "The 3D reconstruction of wood and leaves from terrestrial laser scanning – a case study "
        "on PAR measurements below a solitary Malus domestica tree",
        "Silva Fennica",
        "59, 24027",
        "10.14214/sf.24027",
    ),
    "zande2008": Reference(
        "Van der Zande, D. and Jonckheere, I. and Stuckens, J. and Verstraeten, W. W. and "
        "Coppin, P.",
        2008,
        "Sampling design of ground-based lidar measurements of forest canopy structure and its "
        "effect on shadowing",
        "Canadian Journal of Remote Sensing",
        "34, 526–538",
    ),
    "pimont2018": Reference(
        "Pimont, F. and Allard, D. and Soma, M. and Dupuy, J.-L.",
        2018,
        "Estimators and confidence intervals for plant area density at voxel scale with T-LiDAR",
        "Remote Sensing of Environment",
        "215, 343–370",
        "10.1016/j.rse.2018.06.024",
    ),
    "perez1993": Reference(
        "Perez, R. and Seals, R. and Michalsky, J.",
        1993,
        "All-weather model for sky luminance distribution – preliminary configuration and "
        "validation",
        "Solar Energy",
        "50, 235–245",
        "10.1016/0038-092X(93)90017-I",
    ),
    "anderson2023": Reference(
        "Anderson, K. S. and Hansen, C. W. and Holmgren, W. F. and Jensen, A. R. and "
        "Mikofski, M. A. and Driesse, A.",
        2023,
        "pvlib python: 2023 project update",
        "Journal of Open Source Software",
        "8, 5994",
        "10.21105/joss.05994",
    ),
    "jakob2022": Reference(
        "Jakob, W. and Speierer, S. and Roussel, N. and Nimier-David, M. and Vicini, D. and "
        "Zeltner, T. and Nicolet, B. and Crespo, M. and Leroy, V. and Zhang, Z.",
        2022,
        "Mitsuba 3 renderer",
    ),
    "feret2017": Reference(
        "Féret, J.-B. and Gitelson, A. A. and Noble, S. D. and Jacquemoud, S.",
        2017,
        "PROSPECT-D: Towards modeling leaf optical properties through a complete lifecycle",
        "Remote Sensing of Environment",
        "193, 204–215",
        "10.1016/j.rse.2017.03.004",
    ),
    "qi2019": Reference(
        "Qi, J. and Xie, D. and Yin, T. and Yan, G. and Gastellu-Etchegorry, J.-P. and Li, L. and "
        "Zhang, W. and Mu, X. and Norford, L. K.",
        2019,
        "LESS: LargE-Scale remote sensing data and image simulation framework over heterogeneous "
        "3D scenes",
        "Remote Sensing of Environment",
        "221, 695–706",
        "10.1016/j.rse.2018.11.036",
    ),
    "bates2015": Reference(
        "Bates, D. and Mächler, M. and Bolker, B. and Walker, S.",
        2015,
        "Fitting linear mixed-effects models using lme4",
        "Journal of Statistical Software",
        "67, 1–48",
        "10.18637/jss.v067.i01",
    ),
    "molder2021": Reference(
        "Mölder, F. and Jablonski, K. P. and Letcher, B. and others",
        2021,
        "Sustainable data analysis with Snakemake",
        "F1000Research",
        "10, 33",
        "10.12688/f1000research.29032.2",
    ),
}
