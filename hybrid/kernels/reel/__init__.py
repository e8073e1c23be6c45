"""A line that is paid out or hauled in: its length, nodes that enter and leave, a winch."""
