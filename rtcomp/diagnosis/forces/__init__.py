"""The objective that judges by force: the force balance, its noise and blocks, in which units it closes."""
