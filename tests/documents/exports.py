"""The options of exports as tables, from the declarations of their jobs."""

from __future__ import annotations

from collections.abc import Mapping

from app.export.jobs.job import ExportJob
from app.export.jobs.table import KINDS
from engine.setting import Setting, settings_of
from tests.documents.table import table


def export_tables() -> str:
    """One table per kind of export: option of the command line, keyword of scripts, what is usual, what it does."""
    return "\n\n".join(f"**{job.title}.** {job.about}\n\n{_options(job)}" for job in KINDS.values())


def _options(job: type[ExportJob]) -> str:
    rows: list[tuple[str, ...]] = []
    for name, setting in settings_of(job).items():
        rows.append(_row(name, setting, {short: full for full, short in job.formats().items()}))
        rows += [_row(f"{name}.{inner}", one, {}) for inner, one in setting.inner.items()]
    return table(("option", "in scripts", "usual", "means"), rows)


def _row(name: str, setting: Setting, full: Mapping[str, str]) -> tuple[str, ...]:
    flags = ", ".join(f"`{flag.name}`" for flag in setting.flags)
    known = {full.get(choice, choice): words for choice, words in setting.choices.items()}
    choices = "; ".join(f"`{choice}`: {words}" if words else f"`{choice}`" for choice, words in known.items())
    span = f" ({setting.span})" if setting.bounds else ""
    usual = setting.usual if setting.default is None else f"`{full.get(setting.usual, setting.usual)}`"
    return flags, f"`{name}`", usual, f"{setting.meaning}{span}" + (f". {choices}" if choices else "")
