"""What is kept and shown: probes, the HDF5 recorder and reader, plots (which read files and nothing else)."""
