"""Trains what is not trained, cleans the scene up and writes it: python clean_scene.py PROJECT OUT

PROJECT is a project folder, as the window and `clipgstream train` make them; OUT a new folder.
"""

import sys
from pathlib import Path

from clipgstream import EngineError, Expose, Scope, Sphere, Turntable, open_project


def clean(project, out):
    """Train, edit, render and export an open project.."""
    for clip_index in project.training_order:  # the reference clip first: the others inherit from it
        outcome = project.train_clip(clip_index, on_progress=show)
        print(f"clip {clip_index}: {outcome.state}, {outcome.step} steps")

    # Edits lie over what was trained. Each is a step that `project.undo()` takes back, here as in the window.
    faint = project.select("opacity<0.02 and motion=static", frame_index=0)
    project.apply_edit("delete", faint, name="faint specks")
    project.apply_edit("isolate", Sphere((0.0, 0.0, 0.0), 50.0), name="nothing far away")
    last = project.clips[-1]
    project.apply_edit("smooth", scope=Scope(last.start, last.stop), sigma_frames=1.5)
    trial = project.apply_edit(Expose(3.0))
    project.remove_edit(trial.edit_id)  # too bright after all

    out.mkdir()
    width, height = project.capture.picture_size
    project.render(out / "turn", format="png", turntable=Turntable(0.25), size=(width, height), frames=range(2))
    project.export(out / "frames", format="spz", frames=range(0, project.n_frames, 5))
    project.export(out / "player.html", format="player")


def show(status):
    """Say how far a training is, on one line."""
    print(f"\r{status.stage or 'starting'} {100 * status.progress:3.0f} %", end="")


if __name__ == "__main__":  # trainings run in processes of their own, which read this file again
    try:
        with open_project(sys.argv[1]) as opened:
            clean(opened, Path(sys.argv[2]))
    except EngineError as error:  # what cannot be done says why, and what to do
        sys.exit(str(error))
