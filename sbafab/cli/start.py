"""``sbafab new``, ``import`` and ``studio``: a first file, and a page to edit it."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from sbafab import plugins
from sbafab.api.files import template_summaries, write_kit, write_new
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.documents import Document
from sbafab.version import GENERATOR

COUPON = "coupon"
KIT = "kit"
OTHERS = {COUPON: "the kerf's calibration piece", KIT: "films, tubes, press, laser, limits"}
"""Files to start from other than designs, with a summary."""


class TemplateEntry(Document):
    """A bundled design."""

    name: str
    summary: str


TEMPLATES = list[TemplateEntry]
"""Output of ``new --json``."""


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, "coupon" and "kit"."""
    return opt.completions(typed, (template_summaries() | OTHERS).items())


@click.command()
@click.argument("template", required=False, shell_complete=templates)
@click.argument("file", type=opt.file_path(), required=False)
@opt.json_option
def new(template: str | None, file: Path | None, as_json: bool) -> None:
    """Write a commented design file to start from, or list the templates.

    Without TEMPLATE: list all, one per line. FILE is by default TEMPLATE.toml in this folder.

    TEMPLATE "coupon" writes the kerf coupon, its picture and a table to fill in; FILE is then a
    folder, by default "coupon". TEMPLATE "kit" writes the films, tubes, press, laser and limits of
    the paper with their sources, to be adapted to your lab (kit.toml).
    """
    if as_json and template is not None:
        raise click.UsageError("--json lists the templates; omit TEMPLATE")
    designs = template_summaries()
    if as_json:
        rows = [TemplateEntry(name=name, summary=words) for name, words in designs.items()]
        show.document([row.model_dump() for row in rows])
    elif template is None:
        show.names(designs | OTHERS)
    elif template == COUPON:
        _coupon(file or Path(COUPON))
    elif template == KIT:
        path = shlex.quote(str(write_kit(file or Path("kit.toml"))))
        click.echo(f'{path} written. Edit it, then: sbafab generate DESIGN --set kit="{path}"')
    else:
        written = write_new(template, file)
        path = shlex.quote(str(written))
        click.echo(f"{written} written. Edit it, then: sbafab generate {path}")


def _coupon(folder: Path) -> None:
    # Its drawing takes numpy, which no other file to start from does.
    from sbafab.api.lab import write_coupon

    drawing, picture, table = write_coupon(folder, GENERATOR)
    click.echo(f"Cut {drawing} (picture: {picture}) from each film with a kerf offset of 0.")
    path = shlex.quote(str(table))
    click.echo(
        f"{folder} written. Measure the pieces, fill in {table}, then: sbafab kerf {path} "
        "--material tpe"
    )


@click.command("import")
@click.argument("source", type=opt.file_path())
@opt.folder_option("Folder in which NAME.toml and a folder of its drawings are written.")
@opt.file_option("NAME.toml")
@opt.json_option
def import_(source: Path, out: Path, to: Path | None, as_json: bool) -> None:
    """Write a design of drawn layers from other files.

    SOURCE is a folder of drawings with a table layers.csv, an output folder, a laminate.json, a
    ParchMint circuit (JSON), or a laminate of foldable_robotics or popupCAD. What is not carried
    over is named.
    """
    import_to = plugins.load("sbafab.importing.sources:import_to")
    name, remarks, written = import_to(source, to and opt.design_file(to, out, ""), out)
    layers, patterns = len(written.laminate.layers), len(written.laminate.patterns)
    if as_json:
        document = {"file": str(written.file), "format": name, "layers": layers}
        show.document({**document, "patterns": patterns, "remarks": list(remarks)})
        return
    for remark in remarks:
        show.note(remark)
    show.verdict(
        f"{written.file} written: {layers} layers in {patterns} patterns, from {name}. Next: "
        f"sbafab generate {shlex.quote(str(written.file))}",
        written.file,
    )


@click.command()
@click.argument("source", metavar="[DESIGN|FOLDER|LINK]", required=False)
@opt.option(
    "--port",
    "Port to listen on.  [default: 8417, or another if it is taken]",
    click.IntRange(1, 65535),
)
@opt.option(
    "--browser/--no-browser", "Open the page in the browser, or only print its link.", default=True
)
@opt.option(
    "--phone ADDRESS",
    "Serve the record page, and nothing else, at this machine's ADDRESS in the network.",
)
def studio(source: str | None, port: int | None, browser: bool, phone: str | None) -> None:
    """Edit a design in the browser.

    Layers, rules, prediction and actuator are updated at once.

    The page is served on this machine only, and needs the token in its link. Ctrl-C stops it.
    --phone prints the link as a code to scan; it goes through the network without encryption.
    """
    # The server comes with the extra "studio", which may be missing.
    app = plugins.load("sbafab.studio.app")

    def announce(link: str) -> None:
        click.echo(f"studio: {link}")
        if phone is not None:
            import segno

            segno.make(link, error="l", micro=False).terminal(compact=True)
        click.echo("Ctrl-C stops it.")
        if browser and phone is None:
            import webbrowser

            webbrowser.open(link)

    app.serve(source, port, announce, phone or app.ADDRESS)
