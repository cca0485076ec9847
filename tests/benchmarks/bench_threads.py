"""How idle threads should wait: a training-like loop under several OpenMP settings, alone and beside busy processes.

    python -m tests.benchmarks.bench_threads
    python -m tests.benchmarks.bench_threads --repeats 9 --seconds 2 --json threads.json

Each measurement is a fresh process, because OpenMP reads its environment when it is loaded. It draws and
differentiates 40,000 Gaussians at 320x240 and multiplies matrices in torch, so that both thread pools take turns as
they do in a training. Policies and numbers of busy neighbours are measured in turn, and that several times over.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from engine.backends.table import backend_called
from engine.kernels.threads import SPIN_COUNT

ROOT = Path(__file__).resolve().parents[2]
VARIABLES = ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY", "KMP_BLOCKTIME")
# our program sets SPIN_COUNT unless the variable is set, so libgomp's own default is written out
POLICIES: dict[str, dict[str, str]] = {
    "libgomp's default": {"GOMP_SPINCOUNT": "300000"},
    "spin 200": {"GOMP_SPINCOUNT": "200"},
    "spin 2,000": {"GOMP_SPINCOUNT": "2000"},
    "spin 20,000": {"GOMP_SPINCOUNT": "20000"},
    "spin 200,000": {"GOMP_SPINCOUNT": "200000"},
    "passive": {"OMP_WAIT_POLICY": "passive", "GOMP_SPINCOUNT": "0"},
}
BUSY = "while True: pass"
N_GAUSSIANS, WIDTH, HEIGHT = 40_000, 320, 240
N_WARM = 3


def measure_here(seconds: float) -> list[float]:
    """Milliseconds of every step of the loop in this process."""
    import torch

    from app.background.kernels import use_threads
    from app.lab.synthetic.gaussian_scenes import layered_scene
    from engine.raster import Gaussians, rasterize

    use_threads(None)
    scene = layered_scene(N_GAUSSIANS, WIDTH, HEIGHT, 2.0)
    leaves = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
    weights = [torch.randn(32, 256), torch.randn(256, 70)]
    features = torch.randn(8_000, 32)
    steps_ms: list[float] = []
    until_s = float("inf")
    turn = 0
    while time.perf_counter() < until_s:
        started_s = time.perf_counter()
        hidden = torch.relu(features @ weights[0]) @ weights[1]
        image = rasterize(leaves, *scene.arguments, backend=backend_called("cpu")).image
        image.backward(image.detach() + float(hidden[0, 0]) * 1e-9)
        for tensor in leaves.tensors():
            tensor.grad = None
        if turn >= N_WARM:
            steps_ms.append((time.perf_counter() - started_s) * 1e3)
        elif turn == N_WARM - 1:
            until_s = time.perf_counter() + seconds
        turn += 1
    return steps_ms


def measure_fresh(policy: dict[str, str], seconds: float) -> list[float]:
    """The same in a process of its own under a policy."""
    env = {name: value for name, value in os.environ.items() if name not in VARIABLES} | policy
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.bench_threads", "--child", str(seconds)],
        cwd=ROOT,
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60 + 20 * seconds,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


@contextmanager
def busy_neighbours(n: int) -> Iterator[None]:
    """So many other processes that each keep a core busy."""
    others = [subprocess.Popen([sys.executable, "-c", BUSY], stdin=subprocess.DEVNULL) for _ in range(n)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="processes per policy and number of neighbours")
    parser.add_argument("--seconds", type=float, default=2.0, help="how long each process measures")
    parser.add_argument("--neighbours", default="0,1,2", help="numbers of busy processes beside it")
    parser.add_argument("--policies", default=";".join(POLICIES), help="names, separated by semicolons")
    parser.add_argument("--json", type=Path, help="also write every step here")
    parser.add_argument("--child", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.child is not None:
        print(json.dumps(measure_here(options.child)))
        return
    chosen = [name for name in POLICIES if name in options.policies.split(";")] or list(POLICIES)
    numbers = [int(part) for part in options.neighbours.split(",")]
    measure_fresh(POLICIES[chosen[0]], 0.1)  # compiles what is not compiled yet
    steps: dict[tuple[str, int], list[list[float]]] = {(name, n): [] for name in chosen for n in numbers}
    for repeat in range(options.repeats):
        for n in numbers:
            with busy_neighbours(n):
                for name in chosen:
                    steps[name, n].append(measure_fresh(POLICIES[name], options.seconds))
        print(f"{repeat + 1} of {options.repeats}, load {os.getloadavg()[0]:.1f}", file=sys.stderr)
    print(f"ms per step on {os.cpu_count()} cores; our own setting is {SPIN_COUNT:,} rounds. Each cell: median of the")
    print(f"processes' medians, worst process' median, slowest step of all; {options.repeats} processes each.")
    print(f"{'policy':20s}" + "".join(f"{f'beside {n} busy' if n else 'alone':>28s}" for n in numbers))
    for name in chosen:
        cells = []
        for n in numbers:
            medians = [statistics.median(run) for run in steps[name, n]]
            slowest = max(max(run) for run in steps[name, n])
            cells.append(f"{statistics.median(medians):10.1f}{max(medians):9.1f}{slowest:9.1f}")
        print(f"{name:20s}" + "".join(cells))
    if options.json:
        rows = [{"policy": name, "neighbours": n, "steps_ms": runs} for (name, n), runs in steps.items()]
        options.json.write_text(json.dumps({"spin_count": SPIN_COUNT, "rows": rows}) + "\n")


if __name__ == "__main__":
    main()
