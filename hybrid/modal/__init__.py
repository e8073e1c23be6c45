"""Vibrations about an equilibrium: natural modes of any network of lines, points and bodies."""
