# SPDX-License-Identifier: MIT
"""Opens sequences of Gaussians that ClipGStream Studio exported: File > Import > ClipGStream sequence.

The code of this add-on is ClipGStream Studio's own, under the MIT licence. It runs inside Blender and uses bpy, which
is GPL-3.0-or-later: whoever distributes both together as one program follows the GPL.
"""

from . import operators, panel, playback, properties

_PARTS = (properties, operators, panel, playback)


def register() -> None:
    """Called by Blender when the add-on is switched on."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Called by Blender when it is switched off; scenes keep what they show."""
    for part in reversed(_PARTS):
        part.unregister()
