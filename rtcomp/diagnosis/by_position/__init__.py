"""Diagnosis by simulated position, for axes that stick finer than their encoder sees.

`sticking` says whether that is so, `windows` lets a stage go from points of the recordings, `turning` fits
its numbers to where they end, `decide` names what is missing, `told` says it as every diagnosis is said.
"""
