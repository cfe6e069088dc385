"""What to say where a package is missing that only conforming meshes need."""

from __future__ import annotations

MISSING = 'conforming meshes need {}; install it with: pip install "sbafab[mesh]"'
