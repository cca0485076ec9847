"""The files of claims: PROJECT/claims/0003.0001 says who trains clip 3. Made so that no file system needs locks.

A claim is a file that was not there before, which every file system, also a network's, gives to one process only. Its
content is the token of its holder. When a holder has died, the claim is not changed but surpassed: by a file of the
next number, which again only one process can make. The highest number counts. A holder that had only been slow finds
a higher one, or another token under its own number, and gives up. Whoever releases a claim removes it together with all
below it, lowest first.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.project.clips.clip_names import PROGRAM_NAME
from engine.storage.files import read_bytes

CLAIMS = "claims"
_CLAIM = re.compile(r"(?P<key>[0-9-]{4,19})\.(?P<number>[0-9]{4,9})")
_HOLDER = re.compile(r"holder-(?P<token>[0-9a-f]{32})\.json")
_MAX_TOKEN_BYTES = 64


@dataclass(frozen=True, slots=True)
class ClaimFile:
    """One claim: the clip's key, and the number that counts among claims of one clip."""

    folder: Path
    key: str
    number: int

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self.folder / CLAIMS / f"{self.key}.{self.number:04d}"

    def token(self) -> str:
        """Of its holder; empty where it is not written yet, or cannot be read."""
        try:
            return read_bytes(self.path, max_bytes=_MAX_TOKEN_BYTES).decode("ascii", "replace")
        except OSError:
            return ""


def holder_path(folder: Path, token: str) -> Path:
    """The file in which a holder says that it lives. folder: Of the project."""
    return folder / CLAIMS / f"holder-{token}.json"


def list_claims(folder: Path) -> dict[str, ClaimFile]:
    """The claim that counts of every claimed clip, by key. folder: Of the project. Raises OSError but for no folder."""
    found: dict[str, ClaimFile] = {}
    for key, number in _numbered(folder):
        if key not in found or found[key].number < number:
            found[key] = ClaimFile(folder, key, number)
    return found


def list_holders(folder: Path) -> list[str]:
    """Tokens of all that have a file. folder: Of the project."""
    return [match["token"] for name in _names(folder) if (match := _HOLDER.fullmatch(name))]


def newest_claim(folder: Path, key: str) -> ClaimFile | None:
    """The claim of a clip that counts; None without one. folder: Of the project."""
    numbers = _numbers_of(folder, key)
    return ClaimFile(folder, key, max(numbers)) if numbers else None


def is_unsurpassed(claim: ClaimFile, token: str) -> bool:
    """Whether a claim is as its holder of that token made it, and none that counts more was made after it. Looks at two
    files only."""
    after = ClaimFile(claim.folder, claim.key, claim.number + 1)
    return claim.token() == token and not os.path.lexists(after.path)


def make_claim(claim: ClaimFile, token: str) -> bool:
    """Make the claim's file. Whether it is ours now: nobody had made it, and none that counts more has come.

    Raises:
        OSError: The disk refused.
    """
    flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0)
    try:
        descriptor = os.open(claim.path, flags, 0o666)
    except FileExistsError:
        return False
    try:
        try:
            os.write(descriptor, token.encode("ascii"))
        finally:
            os.close(descriptor)  # where a disk of the network says that it is full
    except OSError:
        with suppress(OSError):
            claim.path.unlink(missing_ok=True)
        raise
    newest = newest_claim(claim.folder, claim.key)
    if newest is not None and newest.number > claim.number:
        with suppress(OSError):
            claim.path.unlink(missing_ok=True)
        return False
    return True


def remove_claim(claim: ClaimFile) -> None:
    """Remove a claim and all that count less, lowest first. Never fails; what the disk refuses counts as dead later."""
    below: list[int] = []
    if claim.number > 1:  # else there is nothing to list
        with suppress(OSError):
            below = [number for number in sorted(_numbers_of(claim.folder, claim.key)) if number < claim.number]
    for number in (*below, claim.number):
        with suppress(OSError):
            ClaimFile(claim.folder, claim.key, number).path.unlink(missing_ok=True)


def _numbered(folder: Path) -> list[tuple[str, int]]:
    found = (_CLAIM.fullmatch(name) for name in _names(folder))
    return [(match["key"], int(match["number"])) for match in found if match and PROGRAM_NAME.fullmatch(match["key"])]


def _numbers_of(folder: Path, key: str) -> list[int]:
    prefix = f"{key}."  # hundreds of others are passed over quickly
    found = (_CLAIM.fullmatch(name) for name in _names(folder) if name.startswith(prefix))
    return [int(match["number"]) for match in found if match]


def _names(folder: Path) -> list[str]:
    try:
        return os.listdir(folder / CLAIMS)
    except FileNotFoundError:
        return []
