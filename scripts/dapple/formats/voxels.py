"""Voxel grids of plant area density as xarray datasets: NetCDF and AMAPVox's text."""
