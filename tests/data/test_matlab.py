"""Files as MATLAB 7.3 writes them: HDF5 behind a block of 512 bytes, with dimensions in the opposite order."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.errors import Problem

TIMES, VALUES = np.array([0.0, 0.5, 1.0, 1.75]), np.array([3.0, 2.5, 2.25, -1.0])
HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 23 10:00:00 2026 HDF5 schema 1.00 ."


def _variable(group: h5py.Group, name: str, values: np.ndarray, kind: str = "double") -> h5py.Dataset:
    """A matrix as MATLAB stores it, the transposed one."""
    data = group.create_dataset(name, data=np.atleast_2d(values).T)
    data.attrs["MATLAB_class"] = np.bytes_(kind)
    return data


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as made:
        _variable(made, "t", TIMES[:, None])
        _variable(made, "row", VALUES[None, :])
        _variable(made, "both", np.column_stack([VALUES, 2 * VALUES]), "single")
        _variable(made, "counts", np.array([[3], [2], [2], [1]], dtype=np.int16), "int16")
        _variable(made, "valid", np.array([[1], [0], [1], [1]], dtype=np.uint8), "logical")
        _variable(made, "words", np.array([[104, 105]], dtype=np.uint16), "char")
        _variable(made, "T", np.array([[1, 2, 3, 4]], dtype=np.uint32), "table").attrs["MATLAB_object_decode"] = 3
        _variable(made, "nothing", np.array([[0], [0]], dtype=np.uint64)).attrs["MATLAB_empty"] = np.uint8(1)
        log = made.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        _variable(log, "glucose", VALUES[:, None])
        several = made.create_group("several")
        several.attrs["MATLAB_class"] = np.bytes_("struct")
        several.create_dataset("y", data=[[made["t"].ref, made["row"].ref]], dtype=h5py.ref_dtype)
        sparse = made.create_group("sparse")
        sparse.attrs["MATLAB_class"], sparse.attrs["MATLAB_sparse"] = np.bytes_("double"), np.uint64(4)
        sparse.create_dataset("data", data=VALUES)
        made.create_group("#refs#").create_dataset("a", data=VALUES)
    with path.open("r+b") as stream:
        stream.write(HEADER.ljust(124) + b"\x00\x02IM")
    return path


def _signal(file: Path, column: str, **more: object) -> np.ndarray:
    block = {"file": file.name, "time": "t", "outputs": {"S": {"column": column, **more}}}
    return read(Data.model_validate(block), file.parent).outputs["S"].values


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("row", VALUES),
        ("log/glucose", VALUES),
        ("both/0", VALUES),
        ("both/1", 2 * VALUES),
        ("counts", [3.0, 2.0, 2.0, 1.0]),
    ],
)
def test_vectors_matrices_and_fields_of_structs_are_columns(file: Path, column: str, expected: np.ndarray) -> None:
    np.testing.assert_array_equal(_signal(file, column), expected)


def test_true_and_false_are_a_quality(file: Path) -> None:
    kept = _signal(file, "row", quality={"column": "valid", "good": [1]})
    np.testing.assert_array_equal(kept, VALUES[[0, 2, 3]])


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("T", "T is there, but is a table, which MATLAB alone reads: S = table2struct(T, 'ToScalar', true)"),
        ("words", "words is there, but is text"),
        ("nothing", "nothing is there, but is empty"),
        ("several/y", "several/y is there, but is a field of several structs"),
        ("sparse/data", "sparse/data is there, but in sparse, which is a sparse matrix: full makes a matrix of it"),
        ("#refs#/a", "holds what variables of MATLAB refer to"),
        ("glucose", "It has: both/0, both/1, counts, log/glucose, row, t, valid"),
    ],
)
def test_what_cannot_be_read_is_told_with_what_to_do(file: Path, column: str, said: str) -> None:
    with pytest.raises(Problem) as caught:
        _signal(file, column)
    assert said in str(caught.value)
