"""The live view of a scene while it is written, and of a result, a running one too: a page on this machine alone."""
