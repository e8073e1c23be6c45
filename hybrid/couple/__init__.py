"""A cable behind the interfaces of other programs: co-simulation units (FMI 3.0), MoorDyn, cosseratbench."""
