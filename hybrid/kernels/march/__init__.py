"""Block rows of nodes and elements, the march along s, torque through catenaries, what energy and power they make."""
