"""Intervals that move while learning runs.

`self_placing` is the operator on cells, `branch_slopes` measures the branch in each of them, `pieces` says
what intervals make of it, `placing` moves one where that pays; `places` says what stands where in their
arrays.
"""
