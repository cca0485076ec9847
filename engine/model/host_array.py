"""Tensors on their way out of a model: to files, to clouds and to the screen, which know numpy alone."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def host_array(tensor: Tensor) -> np.ndarray:
    """The values in main memory, floats as float32, as files hold them; shares the tensor's memory where it can."""
    values = tensor.detach().cpu()
    return (values.to(torch.float32) if values.is_floating_point() else values).numpy()
