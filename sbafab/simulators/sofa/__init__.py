"""SOFA: scenes of a whole actuator, and running them where SOFA is installed."""
