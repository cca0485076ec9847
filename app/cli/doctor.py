"""The report of `clipgstream doctor`: versions, cores, memory, compiled kernels, OpenGL. Changes nothing."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass

from app.background.kernels import use_threads
from app.cli.installing.system_libraries import install_line, missing_packages
from app.export.video.formats import FORMATS, missing_codecs
from app.training.worker.worker import n_training_threads
from engine.kernels.cache import UNWRITABLE, cache_state
from engine.machine import memory_bytes
from engine.parallel import n_cores
from engine.user_folders import cache_dir, data_dir

PACKAGES = ("torch", "numpy", "numba", "scipy", "av", "open3d-cpu", "open3d", "pycolmap", "pyglet", "moderngl")
PACKAGES += ("imgui-bundle", "safetensors", "fourdgs", "opencv-python-headless", "matplotlib")
EXTRAS = {"cluster": ("ray", "training on several computers"), "usd": ("usd-core", "USD files")}
"""Extras of the package: what each brings, and for what."""
_GL_PROBE = """
import json, sys
import moderngl
options = {"backend": "egl"} if sys.platform.startswith("linux") else {}
ctx = moderngl.create_standalone_context(require=330, **options)
print(json.dumps([ctx.info["GL_RENDERER"], ctx.info["GL_VERSION"]]))
"""


@dataclass(frozen=True, slots=True)
class MachineFinding:
    """One line of the report. `is_fine` is False for findings that the user should look at."""

    subject: str
    text: str
    is_fine: bool = True


def examine() -> list[MachineFinding]:
    """Look at everything; takes a few seconds, because OpenGL is tried in a process of its own."""
    return [
        _python(),
        *_packages(),
        _extras(),
        _encoders(),
        _libraries(),
        _cores(),
        _memory(),
        _kernels(),
        _vectors(),
        _threads(),
        _gl(),
        _display(),
        _disk(),
    ]


def _python() -> MachineFinding:
    version = platform.python_version()
    is_fine = (3, 11) <= sys.version_info[:2] < (3, 14)
    return MachineFinding("Python", f"{version} on {platform.platform()}", is_fine)


def _packages() -> list[MachineFinding]:
    found, missing = [], []
    for name in PACKAGES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    if len({"open3d", "open3d-cpu"} & set(missing)) == 1:  # either of the two will do
        missing = [name for name in missing if not name.startswith("open3d")]
    findings = [MachineFinding("Packages", ", ".join(found))]
    if missing:
        how = f"Run: {_pip_line(*missing)}"
        findings.append(MachineFinding("Missing", f"{', '.join(missing)}. {how}", is_fine=False))
    return findings


def _pip_line(*names: str) -> str:
    return f"{shlex.quote(sys.executable)} -m pip install {shlex.join(names)}"


def _extras() -> MachineFinding:
    texts = []
    for name, (package, use) in EXTRAS.items():
        try:
            texts.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            texts.append(f"no {package}, for {use} ({_pip_line(f'clipgstream[{name}]')})")
    return MachineFinding("Extras", "; ".join(texts))


def _encoders() -> MachineFinding:
    missing = [codec for name in FORMATS for codec in missing_codecs(name, needs_sound=True)]
    if missing:
        how = f"The wheel of PyAV brings them. Run: {_pip_line('--force-reinstall', '--only-binary=:all:', 'av')}"
        return MachineFinding("Encoders", f"FFmpeg lacks {', '.join(missing)}. {how}", is_fine=False)
    return MachineFinding("Encoders", f"FFmpeg writes {', '.join(kind.label for kind in FORMATS.values())}")


def _libraries() -> MachineFinding:
    missing = missing_packages()
    if not missing:
        return MachineFinding("System", "all libraries that the window needs are there")
    text = f"missing {', '.join(missing)}, which the window needs. On Debian and Ubuntu run: {install_line(missing)}"
    return MachineFinding("System", text, is_fine=False)


def _cores() -> MachineFinding:
    cores = n_cores()
    threads = n_training_threads(cores, is_window_open=True)
    return MachineFinding("Cores", f"{cores}; training beside the window uses {threads}")


def _memory() -> MachineFinding:
    n_bytes = memory_bytes()
    if n_bytes is None:
        return MachineFinding("Memory", "unknown")
    return MachineFinding("Memory", f"{n_bytes / 2**30:.1f} GB", n_bytes > 3 * 2**30)


def _kernels() -> MachineFinding:
    state = cache_state()
    place = f"{state.folder}, {state.n_bytes / 2**20:.1f} MB"
    if state.is_fallback:
        place += f" (a temporary folder, because {cache_dir()} cannot be written)"
    if state.is_warm:
        return MachineFinding("Kernels", f"compiled, in {place}", not state.is_fallback)
    is_fine = state.reason != UNWRITABLE and not state.is_fallback
    wait = "the first training or picture takes some seconds longer"
    return MachineFinding("Kernels", f"not compiled: {state.reason}; {wait}. Folder {place}", is_fine)


def _vectors() -> MachineFinding:
    from engine.kernels.lanes import N_LANES

    name, width, cpu = host_vectors()
    n_registers = -(-N_LANES // width)
    text = f"{name}, {width} numbers at once: {N_LANES} lanes of a kernel fill {n_registers} register"
    return MachineFinding("Vectors", f"{text}{'s' if n_registers > 1 else ''} ({cpu})")


def host_vectors() -> tuple[str, int, str]:
    """Widest instruction set that kernels can use here, float32 numbers it holds, and LLVM's name of the processor."""
    from llvmlite import binding

    features = {name for name, is_there in binding.get_host_cpu_features().items() if is_there}
    return *vector_width(features, platform.machine()), binding.get_host_cpu_name()


def vector_width(features: set[str], machine: str) -> tuple[str, int]:
    """Name of the widest instruction set that kernels can use, and how many float32 it holds.

    Args:
        features: Names of LLVM's host features that are there.
        machine: As platform.machine() says it.
    """
    for feature, name, width in (("avx512f", "AVX-512", 16), ("avx2", "AVX2", 8), ("avx", "AVX", 8)):
        if feature in features:
            return name, width
    if "neon" in features or machine.lower() in ("arm64", "aarch64"):
        return "NEON", 4
    return ("SSE", 4) if "sse2" in features else ("no vector instructions known", 1)


def _threads() -> MachineFinding:
    n_threads = use_threads(None)
    from engine.kernels.launch import parallel_guard
    from engine.kernels.numba_internals import layer as layer_of_threads

    with parallel_guard():  # starts the threads, so that the layer is known
        layer = layer_of_threads()
    spin = os.environ["GOMP_SPINCOUNT"]
    policy = os.environ.get("OMP_WAIT_POLICY")
    waits = f"; OMP_WAIT_POLICY={policy}" if policy else ""
    text = f"{n_threads}, layer {layer}; an idle one spins {spin} rounds (GOMP_SPINCOUNT){waits}"
    if layer == "workqueue":
        return MachineFinding(
            "Threads", f"{text}. No OpenMP (libgomp) was found, so kernels run one call at a time.", False
        )
    return MachineFinding("Threads", text)


def _gl() -> MachineFinding:
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", _GL_PROBE],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )
        renderer, version = json.loads(done.stdout.splitlines()[-1])
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError):
        hint = "The window needs OpenGL 3.3; training, eval and render do not."
        return MachineFinding("OpenGL", f"not available. {hint}", is_fine=False)
    is_software = any(word in renderer.lower() for word in ("llvmpipe", "softpipe", "swrast", "software"))
    how = "software drawing, so the window shows the rasterizer's pictures" if is_software else "graphics card"
    return MachineFinding("OpenGL", f"{version}, {renderer}: {how}")


def _display() -> MachineFinding:
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        return MachineFinding("Display", "none; commands run without a window")
    return MachineFinding("Display", os.environ.get("DISPLAY", "yes"))


def _disk() -> MachineFinding:
    folder = data_dir()
    place = next(parent for parent in (folder, *folder.parents) if parent.exists())
    free = shutil.disk_usage(place).free
    return MachineFinding("Projects", f"in {folder / 'projects'}, {free / 2**30:.1f} GB free", free > 2**30)
