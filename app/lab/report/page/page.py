"""The page: sections as one HTML file that brings everything along and asks for nothing."""

from __future__ import annotations

from collections.abc import Sequence

from app.lab.report.page.markup import Markup, escaped, joined, png_source, tag
from app.lab.report.page.parts import Figure, Folded, Part, Section
from app.lab.report.page.tables import Table
from engine.assets import asset_path

STYLE_FILE = "report.css"


def page_html(title: str, lead: str, sections: Sequence[Section]) -> str:
    """The whole document.

    Args:
        title: Of the page.
        lead: One sentence below it.
    """
    contents = tag("ol", *(tag("li", tag("a", section.title, href=f"#{section.anchor}")) for section in sections))
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Markup(asset_path(STYLE_FILE).read_text(encoding="utf-8"))),
    )
    main = tag(
        "main",
        tag("h1", title),
        tag("p", lead, class_="lead"),
        tag("nav", tag("h2", "Contents"), contents, aria_label="Contents"),
        *(_section(section) for section in sections),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", main), lang="en") + "\n"


def _section(section: Section) -> Markup:
    return tag("section", tag("h2", section.title), *(_part(part) for part in section.parts), id=section.anchor)


def _part(part: Part) -> Markup:
    match part:
        case Table():
            return part.markup() if part.is_shown else escaped("")
        case Figure():
            image = tag("img", src=png_source(part.png), alt=part.alt, loading="lazy", id=f"figure-{part.name}")
            return tag("figure", image, tag("figcaption", part.caption))
        case Folded():
            return tag("details", tag("summary", part.title), joined(part.table.markup()))
        case _:
            return tag("p", part)
