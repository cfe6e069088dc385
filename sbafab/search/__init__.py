"""Sweep many designs over ranges of their keys, or search for one that meets requirements."""
