"""The plan: mesh, zones, ends and the arrays that a scene requires, and the ledger of what is on."""
