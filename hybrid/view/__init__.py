"""Plots, reports and animations of results."""
