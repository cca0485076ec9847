"""Texts that a document can keep."""

from __future__ import annotations

from app.document.project_document import MAX_TEXT_CHARACTERS
from engine.errors import ProjectError
from engine.text import shown


def checked_text(text: str) -> str:
    """A name of the user's, as it is.

    Raises:
        ProjectError: It is too long, or no file can hold it.
    """
    if len(text) > MAX_TEXT_CHARACTERS:
        raise ProjectError(f"The name has {len(text)} characters, at most {MAX_TEXT_CHARACTERS} are kept.")
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise ProjectError(f"The name {shown(text)} is not Unicode.", hint="Use another name.") from error
    return text
