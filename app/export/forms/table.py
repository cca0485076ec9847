"""The forms of all kinds of exports: one row each, in the order in which they are offered."""

from __future__ import annotations

from app.export.export_choices import ExportChoices, ExportContext
from app.export.forms.data_forms import CAMERAS, METRICS
from app.export.forms.form import Answers, Form
from app.export.forms.gaussians_form import GAUSSIANS
from app.export.forms.player_form import PLAYER
from app.export.forms.video_form import VIDEO

FORMS: dict[str, Form] = {form.kind: form for form in (GAUSSIANS, VIDEO, PLAYER, METRICS, CAMERAS)}
"""By kind."""


def answers_to(context: ExportContext, choices: ExportChoices) -> Answers:
    """What was chosen, with the questions that it answers."""
    return Answers(FORMS[choices.kind], context, choices)
