"""Vibrations about an equilibrium of any network: natural modes, and the response to a sea."""
