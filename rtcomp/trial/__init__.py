"""Sealed trials: plants of its own, hidden effects, diagnoses made by other processes, scores.

Nothing here shares physics with the rest of the program: the integrator, the friction, the sensor and the
effects are written anew, so that a diagnosis cannot recognise its own simulator.
"""
