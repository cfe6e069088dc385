"""The coarse shell of a stack of round balloons, which several simulators take."""
