"""The laws: rotations, the cell (tension), the element (bending and twist), loads.  Compiled, and blind to scenes."""
