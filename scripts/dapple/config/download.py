"""Data that lie on a server."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from dapple.config.base import Section, key

Checksum = Annotated[str, Field(pattern=r"^[0-9a-f]{64}  [^/\s].*$")]


class Download(Section):
    """Where files that data_dir lacks are fetched from: a server or an object store."""

    url: str = key("", "where they lie, as in https://... or s3://...; empty: nowhere")
    files: tuple[Checksum, ...] = key(
        (),
        "as `sha256sum` writes them: the checksum, two blanks, and the path relative to url and "
        "data_dir",
    )

    @property
    def sha256(self) -> dict[str, str]:
        """Checksums by path."""
        return {path: checksum for checksum, path in (one.split("  ", 1) for one in self.files)}
