"""Quantities on the output grid, computed from states."""
