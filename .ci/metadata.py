"""README and addresses of the package's metadata, for hatchling.

A page on a package index shows pictures by absolute addresses only, and the source does not know
where it will be published: ``SBAFAB_REPOSITORY=https://host/owner/sbafab python -m build`` says so.
Without it README keeps its relative links, and the metadata has no addresses.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://|#|mailto:)([^)]+)\)")


class PublishedHook(MetadataHookInterface):
    """Fills in ``readme`` and ``urls``."""

    def update(self, metadata: dict[str, Any]) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        repository = os.environ.get("SBAFAB_REPOSITORY", "").rstrip("/")
        if repository:
            text = absolute(text, repository)
        metadata["urls"] = urls(repository)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def absolute(text: str, repository: str) -> str:
    """Markdown with its relative links to the repository's files, pictures to their raw content."""

    def full(found: re.Match[str]) -> str:
        picture, label, path = found.groups()
        kind = "raw" if picture else "blob"
        return f"{picture}[{label}]({repository}/{kind}/main/{path})"

    return RELATIVE.sub(full, text)


def urls(repository: str) -> dict[str, str]:
    """The project's addresses, none where nothing is known."""
    if not repository:
        return {}
    return {
        "Repository": repository,
        "Documentation": f"{repository}/tree/main/docs",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }
