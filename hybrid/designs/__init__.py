"""Design: what results answer to the numbers of a scene."""
