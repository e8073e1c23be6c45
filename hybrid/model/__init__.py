"""The plan: mesh, zones, ends and the arrays that a scene requires, and the contents: what is on and off."""
