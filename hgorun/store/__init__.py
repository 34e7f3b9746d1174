"""Results as HDF5 files in netCDF-4 conventions: nothing else in hgorun knows HDF5."""

from hgorun.store.labelled import to_xarray
from hgorun.store.reading import read
from hgorun.store.writing import save

__all__ = ["read", "save", "to_xarray"]
