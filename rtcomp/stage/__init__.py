"""A stage is a chain of effects: loaded and saved, simulated, and both sides of its force balance."""
