"""
Download: files that data_dir lacks and a server has, by Snakemake's storage, held to their checksums.

Needs   download.url and download.files in the configuration
Makes   the files that are missing in data_dir; those that are there stay as they are
"""

# Numbers are those of the whole list: a rule keeps its name when another file has come.
for number, path in enumerate(settings.download.sha256):
    if path not in MISSING_DATA:
        continue

    rule:
        name:
            f"download_{number}"
        input:
            there=storage(f"{settings.download.url.rstrip('/')}/{path}"),
            code=code("download"),
        output:
            here=ensure(
                local(str(Path(settings.data_dir) / path)), sha256=MISSING_DATA[path]
            ),
        log:
            logs(f"download_{number}"),
        benchmark:
            benchmarks(f"download_{number}")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(500),
        message:
            said(f"fetching {path}")
        script:
            "../scripts/download.py"
