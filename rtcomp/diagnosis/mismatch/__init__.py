"""Where simulation and recording differ: the force left open, along every axis that one can point to."""
