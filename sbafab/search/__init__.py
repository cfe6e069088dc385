"""Many designs: swept over ranges of their keys, or searched for one that meets requirements."""
