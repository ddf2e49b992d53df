"""rtcomp: identify friction hysteresis on line, compensate it in a fixed-rate loop."""

__version__ = "0.1.0"
