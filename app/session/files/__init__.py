"""The files of the open project: repairing and relocating them, saving them somewhere else."""
