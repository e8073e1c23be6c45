"""Forces and their exact derivatives: cell, element, water, seabed, members, tension over strain, torque of tension."""
