"""Claims as a process finds them that has not watched their holders: which may be alive, and which are surely not."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from app.project.claims.claim_files import ClaimFile, holder_path, list_claims, list_holders, remove_claim
from app.project.claims.holder_record import HolderRecord, holder_words, read_holder
from engine.errors import ProjectError


def live_claims(folder: Path) -> dict[str, HolderRecord | None]:
    """Claimed clips of a project whose holder may live, by key: the holder, or None where it is not known."""
    holders = ((key, _holder(claim)) for key, claim in _claims(folder).items())
    return {key: holder for key, holder in holders if holder is None or not holder.is_gone}


def check_unclaimed(folder: Path) -> None:
    """Check that nobody trains a clip of a project, before something is changed that all clips depend on.

    Raises:
        ProjectError: Somebody does, or may do so.
    """
    for key, holder in live_claims(folder).items():
        raise ProjectError(
            f"{holder_words(holder)} trains {_named(key)} of this project.",
            hint="Stop it there first, or wait for it. If nothing runs there, remove the folder.",
            path=folder / "claims",
        )


def sweep_claims(folder: Path) -> None:
    """Remove claims of processes of this computer that have ended. folder: Of the project."""
    for claim in _claims(folder).values():
        holder = _holder(claim)
        if holder is not None and holder.is_gone:
            remove_claim(claim)
    with suppress(OSError):
        for token in list_holders(folder):
            path = holder_path(folder, token)
            holder = read_holder(path)
            if holder is not None and holder.is_gone:
                path.unlink(missing_ok=True)


def _named(key: str) -> str:
    """A clip as people call it: by its number, or by its frames where clips were split or merged."""
    first, _, stop = key.partition("-")
    return f"the clip of frames {int(first)} to {int(stop) - 1}" if stop else f"clip {int(first)}"


def _claims(folder: Path) -> dict[str, ClaimFile]:
    try:
        return list_claims(folder)
    except OSError:
        return {}


def _holder(claim: ClaimFile) -> HolderRecord | None:
    token = claim.token()
    return read_holder(holder_path(claim.folder, token)) if token else None
