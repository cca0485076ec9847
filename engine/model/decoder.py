"""Decoder: the heads that make Gaussians of features. Shared by all clips, frozen after the reference clip.

Four heads of two layers. Opacity and colour end in a sigmoid, so no Gaussian is ever without gradient; shape gives
scale ratios and a quaternion; offset is unbounded. Nothing depends on the viewing direction, so one decode serves all
cameras. Source: ClipGStream, decoder; the colour head is added to the logit of the anchor's cloud colour.
Letters: n anchors, K Gaussians per anchor, F feature width.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

HEADS = {"opacity": 1, "color": 3, "shape": 7, "offset": 3}
"""Values per Gaussian of each head, in the order of their slices in the output."""


class Decoder(nn.Module):
    """The heads: [f_s; f_d] of anchors to raw values of K Gaussians per anchor. `engine.model.decoding` runs
    them.

    The four first layers are one matrix and the four second layers a block each; each head has its own parameters
    so that its learning rate can differ.

    Args:
        static_dim, dynamic_dim: Widths of f_s and f_d.
        gaussians_per_anchor: K.
        hidden: Width of each head's hidden layer.
        generator: Draws the start.
        is_plain: Whether biases start as all others do; else Gaussians start unrotated and spread over their cell.
    """

    def __init__(
        self,
        *,
        static_dim: int,
        dynamic_dim: int,
        gaussians_per_anchor: int,
        hidden: int,
        generator: torch.Generator | None = None,
        is_plain: bool = False,
    ) -> None:
        super().__init__()
        self.static_dim, self.dynamic_dim = static_dim, dynamic_dim
        self.gaussians_per_anchor, self.hidden = gaussians_per_anchor, hidden
        self.first = nn.ParameterDict()
        self.first_bias = nn.ParameterDict()
        self.second = nn.ParameterDict()
        self.second_bias = nn.ParameterDict()

        def uniform(*size: int, fan_in: int) -> nn.Parameter:
            bound = 1.0 / math.sqrt(fan_in)
            return nn.Parameter((torch.rand(size, generator=generator) * 2 - 1) * bound)

        n_in = static_dim + dynamic_dim
        for head, width in HEADS.items():
            self.first[head] = uniform(n_in, hidden, fan_in=n_in)
            self.first_bias[head] = uniform(hidden, fan_in=n_in)
            self.second[head] = uniform(hidden, gaussians_per_anchor * width, fan_in=hidden)
            self.second_bias[head] = uniform(gaussians_per_anchor * width, fan_in=hidden)
        if is_plain:
            return
        with torch.no_grad():
            shape_bias = self.second_bias["shape"].view(gaussians_per_anchor, 7)
            shape_bias[:, 3:] = torch.tensor([1.0, 0.0, 0.0, 0.0])  # start unrotated
            offset = torch.rand(gaussians_per_anchor * 3, generator=generator) - 0.5
            self.second_bias["offset"].copy_(offset)  # start spread over the anchor's cell, half a spacing each way

    def head_parameters(self, head: str) -> list[nn.Parameter]:
        """All parameters of one head."""
        return [
            self.first[head],
            self.first_bias[head],
            self.second[head],
            self.second_bias[head],
        ]

    def raw(self, static_features: Tensor, dynamic_features: Tensor | None) -> Tensor:
        """Head outputs before activation, heads side by side, in plain torch, any dtype. [n, K * 14]

        Args:
            static_features: [n, static_dim]
            dynamic_features: [n, dynamic_dim], or None for f_d = 0.
        """
        weight = torch.cat([self.first[head] for head in HEADS], dim=1)  # [F, 4 * hidden]
        bias = torch.cat([self.first_bias[head] for head in HEADS])
        if dynamic_features is None:
            hidden = torch.addmm(bias, static_features, weight[: self.static_dim])
        else:
            hidden = torch.addmm(bias, torch.cat([static_features, dynamic_features], dim=1), weight)
        hidden = torch.relu(hidden).split(self.hidden, dim=1)
        blocks = [torch.addmm(self.second_bias[head], hidden[i], self.second[head]) for i, head in enumerate(HEADS)]
        return torch.cat(blocks, dim=1)
