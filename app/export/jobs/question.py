"""Question: what the form of an export asks about one option, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.export.export_choices import ExportChoices, ExportContext
from engine.setting import Setting


@dataclass(frozen=True, slots=True)
class Question:
    """One question.

    Attributes:
        name: As in ExportChoices.answers.
        label: In front of the answers.
        values: Value and words of each answer, the usual one first; none where the user types.
        tips: Explanations of the answers, by value; none where the words are enough.
        has_names: Whether words have names in them that the user or the capture gave.
        hint: The meaning of an empty text.
    """

    name: str
    label: str
    values: tuple[tuple[str, str], ...]
    tips: Mapping[str, str] = field(default_factory=dict)
    has_names: bool = False
    hint: str = ""

    def chosen(self, choices: ExportChoices) -> str:
        """The answer, the usual one where there is none or it is none of the values."""
        answer = choices.answer(self.name)
        return answer if not self.values or answer in dict(self.values) else self.values[0][0]


def question_about(setting: Setting, context: ExportContext) -> Question:
    """The question about an option."""
    titles = dict(setting.titles or {choice: choice for choice in setting.choices})
    words = titles.pop("*", "")
    usual = setting.text(setting.default)
    titles = {**({usual: titles[usual]} if usual in titles else {}), **titles}
    if setting.names:
        titles |= {name: words.format(name) for name in getattr(context, setting.names)}
    tips = {value: setting.choices.get(value, "" if setting.choices else setting.meaning) for value in titles}
    tips[""] = setting.none
    return Question(
        setting.name,
        setting.label,
        tuple(titles.items()),
        {value: f"{tip[0].upper()}{tip[1:]}" for value, tip in tips.items() if tip},
        bool(setting.names),
        f"{setting.none[:1].upper()}{setting.none[1:]}",
    )
