"""Points and bodies, and the lines that are joined there."""
