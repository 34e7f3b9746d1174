"""The result of a run: its arrays and metrics, and its file in netCDF-4 conventions. Nothing else knows HDF5."""
