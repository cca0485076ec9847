"""ClipPaths: where the files of one clip lie in a project folder. Paths only; nothing is read or written here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

LIVE = "live"
PREP = "prep"


@dataclass(frozen=True, slots=True)
class ClipPaths:
    """The files of a clip.

    Attributes:
        folder: Of the project.
        key: The clip's name, see app.project.clips.clip_names.
    """

    folder: Path
    key: str

    @property
    def clip(self) -> Path:
        """The finished clip."""
        return self.folder / "clips" / f"{self.key}.safetensors"

    @property
    def handed_over(self) -> Path:
        """A complete clip that its worker has left for the owner of the project's lock to put in its place."""
        return self.folder / LIVE / f"{self.key}-trained.safetensors"

    @property
    def checkpoint(self) -> Path:
        """The unfinished clip."""
        return self.folder / "checkpoints" / f"{self.key}.safetensors"

    @property
    def metrics(self) -> Path:
        """Curves of the finished clip."""
        return self.folder / "metrics" / f"{self.key}.jsonl"

    @property
    def unfinished_metrics(self) -> Path:
        """Curves of a training that is not finished. Apart from the others, so that those of an earlier one stand."""
        return self.folder / "metrics" / f"{self.key}.unfinished.jsonl"

    @property
    def log(self) -> Path:
        """Log of the clip's worker."""
        return self.folder / "logs" / f"clip-{self.key}.log"

    def snapshot(self, revision: int) -> Path:
        """A state of the running training."""
        return self.folder / LIVE / f"clip-{self.key}-r{revision:04d}.safetensors"
