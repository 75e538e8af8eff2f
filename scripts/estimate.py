"""Print how long a run will take here, and with how much memory."""

import sys
from pathlib import Path

from snakemake.api import SnakemakeApi
from snakemake.settings.types import ConfigSettings, OutputSettings, Quietness, ResourceSettings

from dapple.estimate import beginning, planned, telling
from dapple.estimate.beginning import Known
from dapple.workflow import run


def jobs_of(snakefile, settings, cores):
    """What Snakemake would run, and how many jobs a whole run has."""
    output = OutputSettings(dryrun=True, quiet={Quietness.ALL}, enable_file_logging=False)
    with SnakemakeApi(output) as api:
        asked = api.workflow(
            ResourceSettings(cores=cores),
            config_settings=ConfigSettings(config=settings),
            snakefile=Path(snakefile),
        )
        asked.dag().execute_workflow(executor="dryrun")
        dag = asked._workflow.dag
        return planned.planned(dag), planned.total(dag)


def main(snakemake):
    params = snakemake.params
    jobs, total = jobs_of(params.snakefile, params.settings, params.cores)
    known = Known(Path(snakemake.input.speed).parent, params.cores, **params.known)
    lines = [beginning.tell(jobs, total, known)]
    if jobs and (found := beginning.expected(jobs, known)):
        lines.append(telling.table(found, params.cores))
    text = "\n".join(lines)
    print(text)
    print(text, file=sys.__stdout__, flush=True)


if __name__ == "__main__":
    run(main, snakemake)
