"""How kernels are compiled, kept on disk and given their arguments: all that is undocumented of numba."""
