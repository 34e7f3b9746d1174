"""Files that hold arrays, column by column: HDF5, netCDF, MATLAB and Parquet."""
