"""``sbafab studio``: a page in the browser that edits a design and shows it."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("source", metavar="[DESIGN|FOLDER|LINK]", required=False)
@click.option(
    "--port", type=click.IntRange(1, 65535), help="Port to listen on; 8417 if it is free."
)
@click.option("--browser/--no-browser", default=True, help="Whether to open the browser.")
@click.option(
    "--static",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Write the page into FOLDER, to run without a server of ours: Python runs in the page.",
)
@click.option(
    "--pyodide",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Where Pyodide and its wheels lie, for --static; node_modules/pyodide if not given.",
)
def studio(
    source: str | None,
    port: int | None,
    browser: bool,
    static: Path | None,
    pyodide: Path | None,
) -> None:
    """Edit a design in the browser.

    Layers, rules, prediction and actuator follow at once.

    The page is served on this machine only and asks for the token in its link. Ctrl-C ends it.
    """
    if static is not None:
        if source is not None:
            raise click.UsageError(
                f"--static writes a page for any design; leave out {source}, and open it in there"
            )
        _write(static, pyodide)
        return
    if pyodide is not None:
        raise click.UsageError("--pyodide goes with --static FOLDER")
    from sbafab.studio.app import serve

    def announce(link: str) -> None:
        click.echo(f"studio: {link}")
        click.echo("Ctrl-C ends it.")
        if browser:
            import webbrowser

            webbrowser.open(link)

    serve(source, port, announce)


def _write(folder: Path, pyodide: Path | None) -> None:
    from sbafab.studio.without_server import write

    page = write(folder, pyodide)
    click.echo(f"{page.folder}: {page.bytes / 1e6:.1f} MB; any web server can hand it out, such as")
    click.echo(f"    python -m http.server --bind 127.0.0.1 --directory {page.folder}")
    for name in page.lacks:
        click.echo(
            f"Without {name} it has no prediction, motion, registration rules and cut files; put "
            f"the wheel of {name} from Pyodide's distribution beside Pyodide, and write it again."
        )
