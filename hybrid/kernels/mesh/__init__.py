"""A line on its mesh, criteria of zones, lengths of cells, how a state is carried to another mesh."""
