"""The training settings and presets as tables, from their declarations."""

from __future__ import annotations

from itertools import groupby

from engine.setting import Setting, value_text
from engine.training.config import SETTINGS
from engine.training.presets import PRESETS
from tests.documents.table import table


def settings_tables() -> str:
    """One table per group: name, default, what is allowed, what it does."""
    parts = []
    for group, settings in groupby(SETTINGS.values(), key=lambda setting: setting.group):
        rows = [(f"`{s.name}`", f"`{value_text(s.default)}`", _allowed(s), _meaning(s)) for s in settings]
        parts.append(f"## {group}\n\n{table(('setting', 'default', 'allowed', 'meaning'), rows)}")
    return "\n\n".join(parts)


def presets_table() -> str:
    """One column per preset, one row per setting that any of them changes."""
    changed = [name for name in SETTINGS if any(name in values for values in PRESETS.values())]
    rows = [
        (f"`{name}`", *(value_text(values.get(name, SETTINGS[name].default)) for values in PRESETS.values()))
        for name in changed
    ]
    return table(("setting", *(f"`{name}`" for name in PRESETS)), rows)


def _allowed(setting: Setting) -> str:
    return setting.span if setting.bounds else ", ".join(f"`{choice}`" for choice in setting.span.split(", "))


def _meaning(setting: Setting) -> str:
    choices = "; ".join(f"`{choice}`: {meaning}" for choice, meaning in setting.choices.items())
    return f"{setting.meaning} {choices}." if choices else setting.meaning
