"""What a measured hysteresis is: symmetric, congruent, closed, alike at every speed (the paper's Fig. 11).

Pure analysis on arrays: `branches` cuts a motion at its reversals, and each property has its own module.
"""
