"""The solve: the march along s, Newton, time, statics."""
