"""The solve: the march along s, Newton, time, statics; and the arbiter, which shares nothing with them."""
