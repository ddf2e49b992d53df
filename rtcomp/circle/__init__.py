"""The circle closed: an effect hidden in the plant, diagnosed, and compensated with what was found."""
