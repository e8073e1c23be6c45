"""Runs: statics, motion, restart, error control."""
