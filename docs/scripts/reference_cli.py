"""The page of the commands, from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator

import click

from sbafab.cli import app

HEAD = """# Commands

Written from the commands themselves; `sbafab COMMAND --help` prints the same. DESIGN is a template's name or a TOML
file. Exit codes: 0 done; 1 a rule failed, a part is too large for its film, a simulation stopped early, or files did
not read back as they should; 2 bad input or usage; 130 stopped by Ctrl-C. With `--json` an error is also printed as
JSON, `{"schema": "sbafab/error@1", "error": {"kind": ..., "message": ..., "exit_code": ...}}`.

## Completion in the shell

Templates, files, keys of `--set`, rules and options are completed:

    eval "$(_SBAFAB_COMPLETE=bash_source sbafab)"               # in ~/.bashrc
    eval "$(_SBAFAB_COMPLETE=zsh_source sbafab)"                # in ~/.zshrc
    _SBAFAB_COMPLETE=fish_source sbafab | source                # in ~/.config/fish/completions/sbafab.fish
"""


def page() -> str:
    """The whole page, as MyST Markdown."""
    top = click.Context(app, info_name="sbafab", show_default=True)
    parts = [HEAD]
    for name in app.list_commands(top):
        command = app.commands[name]
        parts.append("\n".join(_command(command, click.Context(command, top, name))))
    return "\n".join(parts)


def _command(command: click.Command, ctx: click.Context) -> Iterator[str]:
    yield f"\n## sbafab {ctx.info_name}\n"
    yield f"    {command.get_usage(ctx).removeprefix('Usage: ')}\n"
    for paragraph in (command.help or "").split("\n\n"):
        yield f"{_plain(' '.join(paragraph.split()))}\n"
    rows = [row for param in command.get_params(ctx) if (row := param.get_help_record(ctx))]
    yield "| option | |\n|---|---|"
    for options, said in rows:
        if said and "--help" not in options:
            yield f"| {_code(options)} | {_plain(said)} |"


def _code(options: str) -> str:
    return f"`{options}`".replace("|", "\\|")


def _plain(said: str) -> str:
    return said.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
