"""Input files of other programs, as scenes."""
