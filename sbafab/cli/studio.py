"""``sbafab studio``: a page in the browser to edit and see a design."""

from __future__ import annotations

from pathlib import Path

import click

from sbafab.cli.printing import print_verdict
from sbafab.studio.without_server import write


@click.command()
@click.argument("source", metavar="[DESIGN|FOLDER|LINK]", required=False)
@click.option(
    "--port",
    type=click.IntRange(1, 65535),
    help="Port to listen on.  [default: 8417, or another if it is taken]",
)
@click.option(
    "--browser/--no-browser",
    default=True,
    help="Open the page in the browser, or only print its link.",
)
@click.option(
    "--phone",
    metavar="ADDRESS",
    help="Serve the record page, and nothing else, at this machine's ADDRESS in the network.",
)
@click.option(
    "--static",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Write the page to FOLDER, to be served by any web server: Python runs in the page.",
)
@click.option(
    "--pyodide",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="With --static: folder of Pyodide and its wheels.  [default: node_modules/pyodide]",
)
def studio(
    source: str | None,
    port: int | None,
    browser: bool,
    phone: str | None,
    static: Path | None,
    pyodide: Path | None,
) -> None:
    """Edit a design in the browser.

    Layers, rules, prediction and actuator are updated at once.

    The page is served on this machine only, and needs the token in its link. Ctrl-C stops it.
    --phone prints the link as a code to scan; it goes through the network without encryption.
    """
    if phone is not None and (static is not None or pyodide is not None):
        raise click.UsageError("--phone serves a page; leave out --static and --pyodide")
    if static is not None:
        if source is not None:
            raise click.UsageError(
                f"--static writes a page for any design; leave out {source} and open it in the page"
            )
        _write(static, pyodide)
        return
    if pyodide is not None:
        raise click.UsageError("--pyodide goes with --static FOLDER")
    # The server comes with the extra "studio"; the page that --static writes does without it.
    from sbafab.studio.app import ADDRESS, serve

    def announce(link: str) -> None:
        click.echo(f"studio: {link}")
        if phone is not None:
            import segno

            segno.make(link, error="l", micro=False).terminal(compact=True)
        click.echo("Ctrl-C stops it.")
        if browser and phone is None:
            import webbrowser

            webbrowser.open(link)

    serve(source, port, announce, phone or ADDRESS)


def _write(folder: Path, pyodide: Path | None) -> None:
    page = write(folder, pyodide)
    for name in page.lacks:
        click.echo(
            f"Without {name} the page has no prediction, motion, registration rules and cut files; "
            f"put the wheel of {name} from Pyodide's distribution beside Pyodide and write again"
        )
    click.echo("Any web server can serve the page, for example:")
    click.echo(f"    python -m http.server --bind 127.0.0.1 --directory {page.folder}")
    print_verdict(f"Studio written to {page.folder}: {page.bytes / 1e6:.1f} MB")
