"""AnchorSet: named rows of anchors that share a role (engine.clip_files.roles).

An anchor is a position, which learns only after `learn_positions`, with a static feature and two sets of log scales;
Gaussians are decoded from it. Sets are kept apart by name and never recovered by position in a concatenation. A set
whose `presence` is None is static: it has no dynamic feature and exists at all times. Dynamic ones may travel.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from engine.model.motion import AnchorMotion

_COLOR_EDGE = 0.02  # keeps the logit of a cloud colour finite


class AnchorSet(nn.Module):
    """Anchors of one role. Owns positions, features, scales and the gate in time; does not decode.

    Shapes: positions [A, 3] scene units; color_logits [A, 3]; features [A, F]; log_offset_scales and
    log_base_scales [A, 3], log of scene units; presence [A, M] bool or None for a static set; motion of a set whose
    anchors travel, else None.
    """

    positions: Tensor
    color_logits: Tensor
    presence: Tensor | None
    birth_frames: Tensor

    def __init__(
        self,
        *,
        positions: Tensor,
        color_logits: Tensor,
        features: Tensor,
        log_offset_scales: Tensor,
        log_base_scales: Tensor,
        presence: Tensor | None,
        is_trainable: bool,
        motion: AnchorMotion | None = None,
    ) -> None:
        super().__init__()
        tensors = [positions, color_logits, features, log_offset_scales, log_base_scales]
        tensors += [] if presence is None else [presence]
        tensors += [] if motion is None else [motion.birth_frames, motion.velocities, motion.accelerations]
        rows = {len(tensor) for tensor in tensors}
        if len(rows) != 1:
            raise ValueError(f"an anchor set's tensors have different numbers of rows: {sorted(rows)}")
        self.register_buffer("positions", positions.contiguous())
        self.register_buffer("color_logits", color_logits.contiguous())
        self.register_buffer("presence", presence)
        self.features = nn.Parameter(features.contiguous(), requires_grad=is_trainable)
        self.log_offset_scales = nn.Parameter(log_offset_scales.contiguous(), requires_grad=is_trainable)
        self.log_base_scales = nn.Parameter(log_base_scales.contiguous(), requires_grad=is_trainable)
        self.is_trainable = is_trainable
        self.travels = motion is not None
        if motion is not None:
            self.register_buffer("birth_frames", motion.birth_frames.contiguous())
            self.velocities = nn.Parameter(motion.velocities.contiguous(), requires_grad=is_trainable)
            self.accelerations = nn.Parameter(motion.accelerations.contiguous(), requires_grad=is_trainable)

    def __len__(self) -> int:
        return self.positions.shape[0]

    @property
    def is_dynamic(self) -> bool:
        """Whether these anchors have a dynamic feature."""
        return self.presence is not None

    @property
    def motion(self) -> AnchorMotion | None:
        """Of anchors that travel."""
        return AnchorMotion(self.birth_frames, self.velocities, self.accelerations) if self.travels else None

    def stay(self) -> None:
        """From here on the anchors keep their positions."""
        if self.travels:
            del self.birth_frames, self.velocities, self.accelerations
            self.travels = False

    def positions_at(self, frame: float) -> Tensor:
        """Where the anchors are at a frame of the clip, or between two. Scene units. [A, 3]"""
        return self.positions if self.motion is None else self.positions + self.motion.away(frame)

    @classmethod
    def from_cloud(
        cls,
        points: Tensor,
        colors: Tensor,
        *,
        spacing: float | Tensor,
        feature_dim: int,
        presence: Tensor | None,
        motion: AnchorMotion | None = None,
    ) -> AnchorSet:
        """Fresh trainable anchors on a cloud: zero features, Gaussians about as large as the anchor spacing.

        Args:
            points: Scene units. [A, 3]
            colors: Scene colours in 0..1, the start of the Gaussians' colour. [A, 3]
            spacing: Distance between neighbours, scene units; one for all, or one each [A].
            feature_dim: Width of the static feature.
            presence: Frames of the clip in which each anchor exists, or None for a static set. [A, M] bool
            motion: Of anchors that travel.
        """
        spacings = torch.as_tensor(spacing, dtype=torch.float32).expand(len(points))
        log_scales = torch.log(spacings)[:, None].expand(-1, 3).clone()
        return cls(
            positions=points.float(),
            color_logits=torch.logit(colors.float().clamp(_COLOR_EDGE, 1 - _COLOR_EDGE)),
            features=torch.zeros(len(points), feature_dim),
            log_offset_scales=log_scales,
            # the shape head halves this at the start (sigmoid of about 0), so 1.2 spacings give 0.6: neighbours overlap
            log_base_scales=log_scales + float(torch.log(torch.tensor(1.2))),
            presence=presence,
            is_trainable=True,
            motion=motion,
        )

    @classmethod
    def from_points(cls, points: Tensor, *, distances: Tensor, feature_dim: int, presence: Tensor | None) -> AnchorSet:
        """Fresh trainable anchors as the published method starts them: zero features, all scales the distance to the
        neighbours, and no colour.

        Args:
            points: Scene units. [A, 3]
            distances: Positive, scene units. [A]
            feature_dim: Width of the static feature.
            presence: Frames of the clip in which each anchor exists, or None for a static set. [A, M] bool
        """
        log_scales = torch.log(distances.float())[:, None].expand(-1, 3)
        return cls(
            positions=points.float(),
            color_logits=torch.zeros(len(points), 3),
            features=torch.zeros(len(points), feature_dim),
            log_offset_scales=log_scales.clone(),
            log_base_scales=log_scales.clone(),
            presence=presence,
            is_trainable=True,
        )

    def learn_positions(self) -> None:
        """From here on the positions are parameters. Nothing happens where they are already, or nothing here learns."""
        if self.is_trainable and not isinstance(self.positions, nn.Parameter):
            positions = self.positions
            del self.positions
            self.positions = nn.Parameter(positions)

    def subset(
        self, is_chosen: Tensor, *, presence: Tensor | None = None, is_trainable: bool | None = None
    ) -> AnchorSet:
        """Some of these anchors, in their order. A copy.

        Args:
            is_chosen: [A] bool
            presence: Takes the place of their own. [n, M] bool
            is_trainable: None leaves it.
        """
        own = None if self.presence is None else self.presence[is_chosen]
        return AnchorSet(
            positions=self.positions.detach()[is_chosen],
            color_logits=self.color_logits[is_chosen],
            features=self.features.detach()[is_chosen],
            log_offset_scales=self.log_offset_scales.detach()[is_chosen],
            log_base_scales=self.log_base_scales.detach()[is_chosen],
            presence=own if presence is None else presence,
            is_trainable=self.is_trainable if is_trainable is None else is_trainable,
            motion=None if self.motion is None else self.motion.map(lambda values: values.detach()[is_chosen]),
        )

    def alive(self, frame_in_clip: int) -> Tensor:
        """Rows that exist at this frame. [n] int64"""
        if self.presence is None:
            return torch.arange(len(self))
        return self.presence[:, frame_in_clip].nonzero()[:, 0]
