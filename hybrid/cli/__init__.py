"""The command line."""

import gc
import os

# Objects made between two searches for garbage.  What is imported stays: with Python's own 700 a command of 1.2 s
# spends 0.1 s on looking through it.  Before the imports, for that reason.
gc.set_threshold(500_000)
# pydantic would look through all installed packages for plugins, of which a command needs none.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
