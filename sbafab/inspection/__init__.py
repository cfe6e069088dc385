"""A picture of a cut sheet measured against the cut file."""
