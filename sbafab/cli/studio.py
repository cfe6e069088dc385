"""``sbafab studio``: a page in the browser to edit and see a design."""

from __future__ import annotations

import click


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
def studio(source: str | None, port: int | None, browser: bool, phone: str | None) -> None:
    """Edit a design in the browser.

    Layers, rules, prediction and actuator are updated at once.

    The page is served on this machine only, and needs the token in its link. Ctrl-C stops it.
    --phone prints the link as a code to scan; it goes through the network without encryption.
    """
    # The server comes with the extra "studio".
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
