"""Compiled numerical kernels, and the arrays they work on."""
