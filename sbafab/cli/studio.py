"""``sbafab studio``: a page in the browser that edits a design and shows it."""

from __future__ import annotations

import click


@click.command()
@click.argument("source", metavar="[DESIGN|FOLDER|LINK]", required=False)
@click.option(
    "--port", type=click.IntRange(1, 65535), help="Port to listen on; 8417 if it is free."
)
@click.option("--browser/--no-browser", default=True, help="Whether to open the browser.")
def studio(source: str | None, port: int | None, browser: bool) -> None:
    """Edit a design in the browser and see layers, rules and actuator at once.

    The page is served on this machine only and asks for the token in its link. Ctrl-C ends it.
    """
    from sbafab.studio.serving import serve

    def announce(link: str) -> None:
        click.echo(f"studio: {link}")
        click.echo("Ctrl-C ends it.")
        if browser:
            import webbrowser

            webbrowser.open(link)

    serve(source, port, announce)
