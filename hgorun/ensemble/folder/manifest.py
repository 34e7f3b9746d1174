"""The manifest of a sweep's folder: what the numbers follow from, and the text from which any process makes members."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from hgorun.config.nearest import near_file
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.fingerprint import Ingredients, fingerprint, ingredients
from hgorun.ensemble.members.recipe import ensemble_of, recipe_of
from hgorun.errors import ConfigError
from hgorun.files import write_text

MANIFEST = "manifest.json"
_FORMAT = "hgorun-sweep-store-2"
_PARTS = {"version": str, "code": dict, "configuration": dict, "sweep": dict}


@dataclass(frozen=True)
class Manifest:
    """What a folder is about.

    Attributes
    ----------
    fingerprint : str
        The hash of what the numbers follow from.
    members : int
        How many there are.
    made_of : dict
        What the numbers follow from.
    recipe : str
        The text that the ensemble is made from.
    """

    fingerprint: str
    members: int
    made_of: Ingredients
    recipe: str

    @classmethod
    def of(cls, ensemble: Ensemble) -> Manifest:
        """That of an ensemble."""
        made_of = ingredients(ensemble)
        return cls(fingerprint(made_of), ensemble.size, made_of, recipe_of(ensemble))

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """That of a folder.

        Raises
        ------
        ConfigError
            When there is none, or it is none.
        """
        path = folder / MANIFEST
        if os.path.isfile(folder):
            raise ConfigError(
                "this is a file; merge takes the folders NAME.sweep in which parts of a sweep were run",
                file=str(folder),
            )
        try:
            said = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            if not os.path.exists(folder):
                raise ConfigError(f"there is no such folder{near_file(folder)}", file=str(folder)) from None
            raise ConfigError(f"not the folder of a sweep: {MANIFEST} is missing", file=str(folder)) from None
        except (OSError, ValueError, RecursionError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise ConfigError(f"not the manifest of a sweep: {reason}", file=str(path)) from None
        wrong = _wrong(said)
        if wrong is not None:
            raise ConfigError(f"not the manifest of a sweep that this version can continue: {wrong}", file=str(path))
        return cls(said["fingerprint"], said["members"], said["made_of"], said["recipe"])

    def write(self, folder: Path) -> None:
        """Make it that of a folder."""
        write_text(folder / MANIFEST, json.dumps({"format": _FORMAT, **asdict(self)}, indent=1))

    def ensemble(self, folder: Path) -> Ensemble:
        """The ensemble.

        Raises
        ------
        ConfigError
            When none can be made from the recipe, or it has not as many members as are said.
        """
        path = str(folder / MANIFEST)
        try:
            found = ensemble_of(self.recipe)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise ConfigError(f"its recipe does not make an ensemble: {reason}", file=path, key="recipe") from None
        self.refuse_members(found.size, folder)
        return found

    def refuse_members(self, count: int, folder: Path) -> None:
        """Refuse another number of members than the axes give."""
        if self.members != count:
            message = f"it says {self.members} members, but its axes give {count}"
            raise ConfigError(message, file=str(folder / MANIFEST), key="members")


def _wrong(said: object) -> str | None:
    """What is wrong with a manifest."""
    if not isinstance(said, dict):
        return "expected a JSON object"
    if said.get("format") != _FORMAT:
        return f"format is {said.get('format')!r:.50}, expected {_FORMAT!r}"
    for key, kind in {"fingerprint": str, "members": int, "made_of": dict, "recipe": str}.items():
        if type(said.get(key)) is not kind:
            return f"{key} is missing or of another type"
    made_of = said["made_of"]
    if any(type(made_of.get(part)) is not kind for part, kind in _PARTS.items()):
        return f"made_of must have {', '.join(_PARTS)}"
    if fingerprint(made_of) != said["fingerprint"]:
        return "its fingerprint is not that of what it says"
    return None
