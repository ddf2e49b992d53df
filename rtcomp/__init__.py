"""rtcomp: identify friction hysteresis on line, compensate it in a fixed-rate loop, diagnose missing physics."""

__version__ = "0.1.0"
