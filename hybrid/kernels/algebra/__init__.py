"""Vectors and rotations, block elimination in space and in a plane, sparse rows."""
