"""What is known of a publication as a whole: its reference, and the errors found in its print."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from hgorun.config import yaml_source
from hgorun.config.types import Block
from hgorun.config.validation import validate


class Erratum(Block):
    """One place of a publication that is wrong, or where it cannot be told what is right."""

    place: str = Field(description="equation, figure or page")
    printed: str
    right: str
    evidence: str = ""
    kind: Literal["error", "undecided", "kept"] = Field(
        default="error",
        description="error: the print is wrong. undecided: it is open what is right. kept: used as printed",
    )


class Publication(Block):
    """The file ``_publication.yaml`` of a folder of experiments."""

    short: str = Field(description="authors and year")
    title: str = Field(description="full reference")
    errata: tuple[Erratum, ...] = ()

    @property
    def errors(self) -> list[Erratum]:
        """What is wrong in print."""
        return [erratum for erratum in self.errata if erratum.kind == "error"]

    @property
    def doubts(self) -> list[Erratum]:
        """What is undecided, or kept as printed."""
        return [erratum for erratum in self.errata if erratum.kind != "error"]


def publication(folder: Path) -> Publication:
    """The publication that a folder of experiments reproduces; the folder's name where nothing else is known.

    Raises
    ------
    ConfigError
    """
    file = folder / "_publication.yaml"
    if not file.is_file():
        return Publication(short=folder.name, title=folder.name)
    _, source = yaml_source.read(file)
    return validate(Publication, source.data, source, ())
