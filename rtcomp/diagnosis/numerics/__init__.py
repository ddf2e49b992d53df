"""Numerics of the diagnosis: bounded least squares, filters, periodograms, tails; none knows a stage."""
