"""The result of a run as users meet it: its data, and how to save, draw and label them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hgorun.files import refuse_no_result
from hgorun.result.records.data import ResultData

if TYPE_CHECKING:
    import pandas
    import xarray


class Result(ResultData):
    """A finished run: the arrays of :class:`~hgorun.result.records.data.ResultData`, with conveniences.

    The most used ones, with Nt points of time, n states, m inputs and q outputs; units are those of the model:

    Attributes
    ----------
    time : ndarray, shape (Nt,)
    x, u, y : ndarray, shapes (Nt, n), (Nt, m), (Nt, q)
        Plant states, inputs and noise-free outputs.
    states, inputs, outputs : tuple of str
        Their names.
    observers : mapping of str to ObserverResult
        By label; ``xhat`` is the estimate, shape (Nt, n), and ``status`` says whether it can be trusted.
    units : mapping of str to str
        Of ``time``, states, outputs and inputs, where known.

    Examples
    --------
    >>> error = result.observers["SHGO"].xhat - result.x
    >>> error.shape == (len(result.time), len(result.states))
    True
    """

    def _repr_html_(self) -> str:
        """In a notebook: the observers with their metrics."""
        from hgorun.result.notebook import as_html

        return as_html(self)

    def save(self, path: str | Path) -> Path:
        """Write the HDF5 file, whole or not at all.

        Parameters
        ----------
        path : path
            It ends in .h5, .hdf5 or .nc, or in nothing that files of other kinds end in. A result that is there is
            replaced, a recording is not.

        Returns
        -------
        Path
            That of the file.

        Raises
        ------
        ConfigError
            For a name of a file of another kind, such as .yaml or .csv, and for that of a file of numbers that hgorun
            has not written: it may be a recording.
        HgorunError
            When it cannot be written.
        """
        from hgorun.result.file.writing import save
        from hgorun.result.hdf5.forms import refuse_not_ours

        refuse_no_result(Path(path), "save")
        refuse_not_ours(Path(path), "save")
        return save(self, Path(path))

    def to_xarray(self) -> xarray.Dataset:
        """Truth, estimates and outputs with labelled coordinates; needs the package xarray.

        Raises
        ------
        HgorunError
            Where xarray is not installed.
        """
        from hgorun.result.labelled import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pandas.DataFrame:
        """Truth and estimates as a table, a row for every time; needs the package pandas.

        Raises
        ------
        HgorunError
            Where pandas is not installed.
        """
        from hgorun.result.labelled import to_pandas

        return to_pandas(self)

    def plot(self, path: str | Path | None = None) -> Any:
        """Draw truth, estimates and errors.

        Parameters
        ----------
        path : path, optional
            Where the figure is saved, too: .png, .pdf or .svg.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ConfigError
            For what is no name of such a file.
        """
        from hgorun.figures.drawing import comparison
        from hgorun.figures.files import named, save

        place = None if path is None else named(path)
        figure = comparison([self])
        if place is not None:
            stem, suffix = place
            save(figure, stem, (suffix,))
        return figure
