"""What MATLAB 7.3 writes: HDF5 files whose dimensions are in the opposite order, with the class of each variable."""

from __future__ import annotations

import h5py

_NUMBERS = {"double", "single", "logical", *(f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64))}
_TABLE = "S = table2struct(T, 'ToScalar', true) and save(FILE, '-struct', 'S', '-v7.3') make columns of it"
_INSTEAD = {
    "char": "is text: numbers are read",
    "string": "is text: numbers are read",
    "cell": "is a cell array: cell2mat makes a vector of one that holds numbers",
    "table": f"is a table, which MATLAB alone reads: {_TABLE}",
    "timetable": f"is a timetable, which MATLAB alone reads: with T = timetable2table(TT), {_TABLE}",
    "datetime": "is of class datetime, which MATLAB alone reads: posixtime makes seconds of it",
    "duration": "is of class duration, which MATLAB alone reads: seconds makes numbers of it",
    "timeseries": "is a timeseries, which MATLAB alone reads: save its Time and Data",
}


def is_of_matlab(data: h5py.Dataset) -> bool:
    """Whether MATLAB has written a data set as a variable."""
    return _class(data) in _NUMBERS


def is_logical(data: h5py.Dataset) -> bool:
    """Whether its numbers are true and false."""
    return _class(data) == "logical"


def is_across(data: h5py.Dataset) -> bool:
    """Whether the columns of a matrix are rows of the data set, as MATLAB's are; a row vector is one column."""
    return is_of_matlab(data) and data.shape[1] != 1


def no_column(member: h5py.Group | h5py.Dataset, name: str) -> str:
    """Why a variable of MATLAB has no columns of numbers; empty where it has, and for what is not of MATLAB."""
    found = _class(member)
    if name in ("#refs#", "#subsystem#"):
        return "holds what variables of MATLAB refer to"
    if "MATLAB_sparse" in member.attrs:
        return "is a sparse matrix: full makes a matrix of it"
    if isinstance(member, h5py.Dataset):
        if "MATLAB_empty" in member.attrs:
            return "is empty"
        if not found and member.dtype.kind == "O" and _class(member.parent) == "struct":
            return "is a field of several structs: one struct with vectors as fields is read"
        if found and found not in _NUMBERS:
            return _INSTEAD.get(found, f"is of class {found}: numbers are read")
    return ""


def _class(member: h5py.Group | h5py.Dataset) -> str:
    found = member.attrs.get("MATLAB_class", b"")
    return found.decode("ascii", "replace") if isinstance(found, bytes) else ""
