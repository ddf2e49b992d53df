"""What a run is: a configuration becomes plan, device, loop, recording and model, and a judgement of it."""
