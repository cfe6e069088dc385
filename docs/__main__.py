"""Builds the site into out/site: ``python -m docs [--fast]``.

Generated pages (reference, gallery) come first, then Sphinx with warnings as errors. ``--fast``
keeps the generated pages of an earlier build. Last every link is followed, and nothing may be
loaded from another host.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from docs.scripts import made
from docs.scripts.offline import complaints

HERE = Path(__file__).parent
SITE = HERE.parent / "out" / "site"


def main() -> int:
    if "--fast" not in sys.argv[1:]:
        made.write_all(HERE / "_made")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    doctrees = SITE.with_name("site-doctrees")
    built = subprocess.run(
        [*command, "-d", str(doctrees), str(HERE), str(SITE)], cwd=HERE.parent, check=False
    )
    if built.returncode:
        return built.returncode
    found = list(complaints(SITE))
    print(*found, sep="\n", end="\n" if found else "")
    print(f"open {SITE / 'index.html'}")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
