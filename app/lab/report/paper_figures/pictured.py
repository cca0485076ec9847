"""Which of the compared projects can stand in pictures side by side: those of the same capture at the same size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.evaluation.headless import TrainedProject, open_trained
from app.lab.pictures import Pictures
from app.lab.report.comparison import Compared
from app.project.project_facts import ClipFacts


@dataclass(frozen=True, slots=True)
class Pictured:
    """A project with its figures and its pictures."""

    compared: Compared
    pictures: Pictures

    @property
    def name(self) -> str:
        """As the page calls it."""
        return self.compared.facts.name

    def clip_at(self, frame_index: int) -> ClipFacts | None:
        """The trained clip that shows a frame."""
        clips = self.compared.facts.clips
        return next((clip for clip in clips if clip.start <= frame_index < clip.start + clip.n_frames), None)


def pictured_projects(
    compared: Sequence[Compared],
    own_pictures: Pictures,
    opened: TrainedProject,
    make_pictures: Callable[[TrainedProject], Pictures],
) -> tuple[list[Pictured], list[str]]:
    """Projects that show the same pictures as the first, and sentences on the others.

    Args:
        opened: The first project; the others are opened with its capture.
    Raises:
        ProjectError: A clip is damaged.
    """
    first = compared[0]
    found, left_out = [Pictured(first, own_pictures)], []
    for one in compared[1:]:
        a, b = first.facts.settings, one.facts.settings
        if a.fingerprint != b.fingerprint:
            left_out.append(f"{one.facts.name} is in none of the pictures, because it is of another capture.")
        elif a.scale != b.scale:
            left_out.append(f"{one.facts.name} is in none of the pictures, because it works at another scale.")
        else:
            found.append(Pictured(one, make_pictures(open_trained(one.facts.project, opened.capture))))
    return found, left_out


def trained_on(projects: Sequence[Pictured], frames: Sequence[int]) -> tuple[list[Pictured], list[str]]:
    """Projects in which all of some frames are trained, and sentences on the others."""
    shown = [one for one in projects if all(one.clip_at(frame) is not None for frame in frames)]
    words = f"frame {frames[0]}" if len(frames) == 1 else f"frames {' and '.join(map(str, frames))}"
    return shown, [f"Not trained on {words}, so not here: {one.name}." for one in projects if one not in shown]


def of_main_group(one: Compared, rows: Sequence[dict]) -> list[dict]:
    """Rows of the cameras that a project's figures are of: pictures, or pairs of neighbouring frames."""
    return [row for row in rows if row["is_held_out"] == (one.group == "held_out")]
