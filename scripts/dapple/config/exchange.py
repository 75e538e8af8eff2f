"""Scenes that other light models wrote."""

from __future__ import annotations

from dapple.config.base import Section, key


class Exchange(Section):
    """A scene in the format of the light-model intercomparison on plants."""

    scene: str = key("", "scene.json beside its files, relative to data_dir; empty: none")
