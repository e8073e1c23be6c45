"""A network about its equilibrium, linear: its matrices, lowest vibrations, drag, and what excites it."""
