"""The fixed-rate loop: device protocol, clock, the one tick, states and safety, the ring to others."""
