"""Measure a picture of a cut sheet against its cut file."""
