"""The coarse shell of a stack of round balloons, shared by several simulators."""
