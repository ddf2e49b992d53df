"""The objective that judges by force: both sides of the force balance, its noise, its blocks."""
