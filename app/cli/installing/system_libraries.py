"""Libraries of a Linux system that the program's own packages load: which of them are missing, and how to get them.

Nothing but Python's own library is imported: setup.sh asks before anything is installed.
"""

from __future__ import annotations

import ctypes
import glob
import sys

LIBRARIES = {
    "libegl1": "libEGL.so.1",
    "libgl1": "libGL.so.1",
    "libglx-mesa0": "libGLX_mesa.so.0",
    "libegl-mesa0": "libEGL_mesa.so.0",
    "libx11-6": "libX11.so.6",
    "libxext6": "libXext.so.6",
    "libusb-1.0-0": "libusb-1.0.so.0",
    "libgomp1": "libgomp.so.1",
    "libudev1": "libudev.so.1",
    "libidn2-0": "libidn2.so.0",
}
"""Names of libraries by their Debian packages."""
DRIVERS = "libgl1-mesa-dri"
DRIVER_FILES = ("/usr/lib/*/dri/*_dri.so", "/usr/lib*/dri/*_dri.so")


def missing_packages() -> list[str]:
    """Debian packages whose library cannot be loaded; none on other systems than Linux."""
    if not sys.platform.startswith("linux"):
        return []
    missing = [package for package, name in LIBRARIES.items() if not _loads(name)]
    return missing if any(map(glob.glob, DRIVER_FILES)) else [*missing, DRIVERS]


def install_line(packages: list[str]) -> str:
    """The line for a terminal that installs packages where there is apt."""
    return f"sudo apt-get install -y --no-install-recommends {' '.join(packages)}"


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
