# SPDX-License-Identifier: MIT
"""Builds trees of nodes, from inputs to outputs."""

from typing import Any

import bpy


class NodeBuilder:
    """Adds nodes to a tree, and links their inputs.

    Args:
        tree: An empty one.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self._tree = tree

    def add(
        self, kind: str, inputs: dict[str, Any] | None = None, output: str | None = None, **settings: Any
    ) -> bpy.types.NodeSocket | None:
        """Add a node.

        Args:
            kind: Its type.
            inputs: By identifier a value, or the output that is linked to it.
            output: Identifier of the output to return; None for the first.
            settings: Attributes of the node.
        Returns:
            The output; None of a node without one.
        """
        node = self._tree.nodes.new(kind)
        node.location = 180 * len(self._tree.nodes), 0
        for name, value in settings.items():
            setattr(node, name, value)
        sockets = {socket.identifier: socket for socket in node.inputs}
        sockets |= {socket.name: socket for socket in node.inputs if socket.name not in sockets}
        for name, value in (inputs or {}).items():
            if isinstance(value, bpy.types.NodeSocket):
                self._tree.links.new(value, sockets[name])
            else:
                sockets[name].default_value = value
        outputs = {socket.identifier: socket for socket in node.outputs}
        return outputs[output] if output is not None else next(iter(node.outputs), None)

    def math(self, operation: str, a: Any, b: Any = 0.0) -> bpy.types.NodeSocket:
        """Add arithmetic of two numbers."""
        return self.add("ShaderNodeMath", {"Value": a, "Value_001": b}, operation=operation)
