"""Everything between the loop and the metal: drivers, wire protocols, the plant server."""
