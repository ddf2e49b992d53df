"""Fits of a model: the belief with entries of the catalogue, on one objective, by blocks left out."""
