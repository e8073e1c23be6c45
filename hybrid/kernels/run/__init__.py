"""The loops over steps, and the entries that Python calls."""
