"""The watch: criteria, the plan they ask for, and the remap of a state from old zones to new ones."""
