"""What a shell completes: templates and files, keys with their choices, rules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import click


def designs(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Templates by name, and files."""
    from sbafab.design.templates import template_summaries

    found = [
        CompletionItem(name, help=said)
        for name, said in template_summaries().items()
        if name.startswith(typed)
    ]
    return [*found, CompletionItem(typed, type="file")]


designs_or_folders = designs
"""Files of a shell's own completion include folders."""


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """What ``sbafab new`` writes."""
    from sbafab.cli.new import COUPON, KIT
    from sbafab.design.templates import template_summaries

    others = {COUPON: "the kerf's calibration piece", KIT: "films, tubes, press, laser, limits"}
    return _beginning(typed, (template_summaries() | others).items())


def rules(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Rules and checks by name, with what they ask."""
    from sbafab.rules.explained import EXPLAINED

    return _beginning(typed, ((name, one.holds) for name, one in EXPLAINED.items()))


def assignments(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """``KEY=`` for every key of a design; after it the values of a key that has a choice."""
    key, equals, _ = typed.partition("=")
    if not equals:
        return _beginning(typed, ((f"{name}=", None) for name in _keys()))
    return _beginning(typed, ((f"{key}={value}", None) for value in _choices(_keys().get(key))))


def _beginning(typed: str, known: Iterable[tuple[str, str | None]]) -> list[CompletionItem]:
    return [CompletionItem(name, help=said) for name, said in known if name.startswith(typed)]


def _keys() -> dict[str, object]:
    """Every key that holds a value, of any family, with its annotation."""
    from sbafab.actuators import records
    from sbafab.design.messages import key_paths

    found: dict[str, object] = {}
    for record in records().values():
        found |= key_paths(record)
    tables = {path.rpartition(".")[0] for path in found}
    return {path: found[path] for path in sorted(found) if path not in tables}


def _choices(annotation: Any) -> Iterator[str]:
    """The values of a ``Literal``, and of a switch."""
    from typing import Literal, get_args, get_origin

    if annotation is bool:
        yield from ("true", "false")
    elif get_origin(annotation) is Literal:
        yield from map(str, get_args(annotation))
