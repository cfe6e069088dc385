"""MuJoCo: a model of a whole actuator made of flexes, and running it."""
