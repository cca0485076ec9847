"""Cameras out of step, as engine.synchronisation measures it."""

from __future__ import annotations

from engine.capture.capture import Capture
from engine.doctor.finding import Finding, PairEvidence
from engine.doctor.words import counted, listed
from engine.errors import CaptureError
from engine.progress import ReportProgress
from engine.synchronisation.applying import corrections_for
from engine.synchronisation.estimating import synchronise
from engine.synchronisation.synchronisation import CameraOffset, SourceName, Synchronisation

LEAST_FRAMES = 0.5
"""A camera is shifted by whole frames: what rounds to none is not worth it."""
STRONG: set[SourceName] = {"timecode", "audio", "epipolar"}
"""Sources whose disagreement means something; how much moves differs between views."""
UNSURE = 0.4
"""Less likely offsets are not reported."""


def check_synchronisation(capture: Capture, report: ReportProgress = lambda progress: None) -> list[Finding]:
    """Measure the offsets of all cameras and say which are out of step.

    Raises:
        CaptureError: Pictures cannot be read.
    """
    return offset_findings(capture, synchronise(capture, report=report))


def offset_findings(capture: Capture, found: Synchronisation) -> list[Finding]:
    """The findings from measured offsets of a capture."""
    late = [camera for camera in found.cameras if camera.source and abs(camera.offset_frames) >= LEAST_FRAMES]
    sure = [camera for camera in late if camera.is_sure]
    unsure = [camera for camera in late if not camera.is_sure and camera.confidence >= UNSURE]
    findings = []
    if sure:
        try:
            fix = corrections_for(capture, found)
        except CaptureError:  # its capture.json went away meanwhile
            fix = None
        findings.append(
            Finding(
                kind="synchronisation",
                severity="warning",
                cameras=tuple(camera.name for camera in sure),
                frames=(),
                text=f"{listed([_said(camera) for camera in sure])}, measured by "
                f"{listed(sorted({str(camera.source) for camera in sure}))}.",
                certainty=min(camera.confidence for camera in sure),
                advice=f"Shift {counted(sure, 'this camera', 'these cameras')}; otherwise motion is blurred by that "
                "much.",
                fix=fix,
                evidence=_evidence(capture, found, sure[0]),
            )
        )
    if unsure:
        findings.append(
            Finding(
                kind="synchronisation",
                severity="note",
                cameras=tuple(camera.name for camera in unsure),
                frames=(),
                text=f"Perhaps {listed([_said(camera) for camera in unsure])}.",
                certainty=max(camera.confidence for camera in unsure),
                advice="Compare one quick motion in these cameras, or use sound or a clapperboard.",
                evidence=_evidence(capture, found, unsure[0]),
            )
        )
    findings += [
        Finding("synchronisation", "note", (found.cameras[one.camera_index].name,), (), one.text, 0.5, "Check both.")
        for one in found.disagreements
        if {one.source, one.other} <= STRONG
    ]
    return findings


def _said(camera: CameraOffset) -> str:
    word = "ahead" if camera.offset_frames > 0 else "behind"
    return f"{camera.name} is {abs(camera.offset_frames):.1f} frames {word}"


def _evidence(capture: Capture, found: Synchronisation, camera: CameraOffset) -> tuple[PairEvidence, ...]:
    """The camera next to the nearest one that is in step, in the middle of the capture."""
    names = capture.rig.names
    row = names.index(camera.name)
    still = [i for i, other in enumerate(found.cameras) if i != row and abs(other.offset_frames) < LEAST_FRAMES]
    if not still:
        return ()
    centers = capture.rig.centers
    near = min(still, key=lambda i: float(((centers[i] - centers[row]) ** 2).sum()))
    caption = "the same frame number"
    return (PairEvidence(camera.name, names[near], capture.n_frames // 2, caption),)
