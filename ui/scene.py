"""stub"""

from __future__ import annotations
from dataclasses import dataclass
from typing import Any
from imgui_bundle import ImVec2


@dataclass(frozen=True)
class SceneView:
    world_to_camera: Any
    K: Any
    width: int
    height: int
    is_moving: bool


@dataclass(frozen=True)
class Layer:
    glo: int
    uv0: ImVec2
    uv1: ImVec2


@dataclass(frozen=True)
class Layers:
    textures: tuple
    is_stale: bool = False


@dataclass(frozen=True)
class Counts:
    n_inherited: int = 0
    n_residual: int = 0


class Scene:
    def __init__(s, ctx):
        s.ctx = ctx
        s.counts = Counts(1500, 300)
        s.shows = "cloud"
        s.is_software = True

    def release(s):
        pass

    def has_news(s, session):
        return False

    def compose(s, session, view):
        return Layers(())

    def captured(s, session, w):
        return None
