"""HDF5 files of results: written, read, checked."""
