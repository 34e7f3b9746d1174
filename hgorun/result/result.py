"""The result of a run as users meet it: its data, and how to save, draw and label them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hgorun.result.data import ResultData

if TYPE_CHECKING:
    import pandas
    import xarray


class Result(ResultData):
    """A finished run: the arrays of :class:`~hgorun.result.data.ResultData`, with conveniences."""

    def _repr_html_(self) -> str:
        """In a notebook: the observers with their metrics."""
        from hgorun.result.notebook import as_html

        return as_html(self)

    def save(self, path: str | Path) -> Path:
        """Write the HDF5 file, whole or not at all."""
        from hgorun.result.writing import save

        return save(self, Path(path))

    def to_xarray(self) -> xarray.Dataset:
        """Truth, estimates and outputs with labelled coordinates; needs the package xarray."""
        from hgorun.result.labelled import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pandas.DataFrame:
        """Truth and estimates as a table, a row for every time; needs the package pandas."""
        from hgorun.result.labelled import to_pandas

        return to_pandas(self)

    def plot(self, path: str | Path | None = None) -> Any:
        """A comparison figure (matplotlib); saved where ``path`` (png, pdf or svg) is given."""
        from hgorun.figures.drawing import comparison
        from hgorun.figures.files import save

        figure = comparison([self])
        if path is not None:
            save(figure, Path(path).with_suffix(""), (Path(path).suffix.lstrip(".") or "png",))
        return figure
