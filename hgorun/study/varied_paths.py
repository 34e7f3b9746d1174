"""The paths of ``vary``: those that lead nowhere are refused before anything is carried out."""

from __future__ import annotations

from hgorun.config.models import File
from hgorun.config.refusals import Refusals
from hgorun.ensemble.members.members import written_out
from hgorun.errors import ConfigError
from hgorun.study.study import Run


def refuse_paths(run: Run) -> None:
    """Refuse the paths of ``vary`` that lead nowhere, all of them at once.

    Raises
    ------
    ConfigError
        Each with its place in the file.
    """
    faults = Refusals()
    for path, number in run.changes(run.values[0]).items() if run.values else ():
        with faults.of_a_part():
            try:
                written_out(run.base, path)
                if path.partition(".")[0] not in File.model_fields:
                    run.base.varied({path: number})
            except ConfigError as error:
                raise run.wrong(path, error.message) from error
    faults.refuse()
