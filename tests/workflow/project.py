"""A copy of the project in a folder of its own: to run, to edit, to break."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARTS = ("Snakefile", "rules", "scripts", "config", "profiles", "envs", "docs")
SMALL = "config/virtual-apple-small.yaml"
LIMIT_S = 1800
"""Time that a run gets: many times what it takes [s]."""
# As it was before a test could change it.
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


@dataclass
class Project:
    """A copy of the project in a folder of its own, with its results."""

    folder: Path
    configfile: str = SMALL
    overrides: tuple[str, ...] = ()
    experiment: str = field(default="virtual-apple-small")

    def snakemake(self, *arguments, cores=2, config=(), environment=None, umask=-1):
        """Run Snakemake to its end and return the finished process, its output as text."""
        command = [sys.executable, "-m", "snakemake", *map(str, arguments)]
        command += ["--cores", str(cores), "--nocolor", "--configfile", self.configfile]
        if overrides := (*self.overrides, *config):
            command += ["--config", *overrides]
        return subprocess.run(
            command,
            cwd=self.folder,
            env=ENVIRONMENT | (environment or {}),
            umask=umask,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LIMIT_S,
        )

    def run(self, *arguments, **settings):
        """Run Snakemake, which has to succeed."""
        done = self.snakemake(*arguments, **settings)
        assert done.returncode == 0, f"{done.args}\n{done.stdout[-8000:]}"
        return done.stdout

    def planned(self, *arguments, **settings):
        """The rules that a run would run, from a dry run."""
        lines = self.run("--dry-run", "--quiet", "rules", *arguments, **settings)
        return jobs(lines)

    def result(self, path):
        """The path of a result of this experiment."""
        return self.folder / "results" / self.experiment / path

    def clone(self, folder):
        """The same project with the same results in another folder, to be edited."""
        # Times and metadata go along: Snakemake finds nothing to do in the copy.
        shutil.copytree(self.folder, folder, symlinks=True, copy_function=shutil.copy2)
        return Project(folder, self.configfile, self.overrides, self.experiment)


def jobs(output):
    """Rule names from the job table of Snakemake, without `all`."""
    lines = iter(output.splitlines())
    for line in lines:
        if line.split() == ["job", "count"]:
            next(lines)
            break
    names = set()
    for line in lines:
        words = line.split()
        if len(words) != 2 or words[0] == "total":
            break
        names.add(words[0])
    return names - {"all"}


def copy_of_project(folder, configfile=SMALL, overrides=(), experiment="virtual-apple-small"):
    """The project as it stands here, without results, in a folder of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, folder / part, copy_function=shutil.copy2)
        else:
            shutil.copy2(source, folder / part)
    if (ROOT / ".tools").is_dir():
        (folder / ".tools").symlink_to(ROOT / ".tools")
    return Project(folder, configfile, tuple(overrides), experiment)
