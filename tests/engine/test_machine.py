"""Memory that is free: of the machine, or of the control groups that a process is in."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.machine import free_memory_bytes

MEMINFO = "MemTotal:       24000 kB\nMemFree:         1000 kB\nMemAvailable:   20000 kB\n"


def write(root: Path, files: dict[str, str]) -> Path:
    for name, text in {"proc/meminfo": MEMINFO, **files}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def group(limit: str, used: int, cache: int, *, is_old: bool = False) -> dict[str, str]:
    names = ("max", "current", "inactive_file")
    if is_old:
        names = ("limit_in_bytes", "usage_in_bytes", "total_inactive_file")
    stat = f"anon 5\n{names[2]} {cache}\n"
    return {f"memory.{names[0]}": limit, f"memory.{names[1]}": str(used), "memory.stat": stat}


def at(folder: str, files: dict[str, str]) -> dict[str, str]:
    return {f"{folder}/{name}": text for name, text in files.items()}


def test_of_a_machine_without_groups(tmp_path):
    assert free_memory_bytes(write(tmp_path, {})) == 20_000 * 1024
    assert free_memory_bytes(tmp_path / "no-linux") is None


@pytest.mark.parametrize(
    ("limit", "above", "expected"),
    [
        ("5000000", "max", 5_000_000 - 2_000_000),
        ("max", "4000000", 4_000_000 - 2_000_000),
        ("max", "max", 20_000 * 1024),
        ("1000000", "max", 0),
    ],
)
def test_of_the_tightest_group(tmp_path, limit, above, expected):
    files = {"proc/self/cgroup": "0::/slurm/job_7\n"}
    files |= at("sys/fs/cgroup/slurm/job_7", group(limit, 3_000_000, 1_000_000))
    files |= at("sys/fs/cgroup/slurm", group(above, 3_000_000, 1_000_000))
    assert free_memory_bytes(write(tmp_path, files)) == expected


def test_of_groups_of_the_first_version_and_of_a_container_that_sees_its_own_as_the_top(tmp_path):
    files = {"proc/self/cgroup": "5:cpu,cpuacct:/x\n4:memory:/docker/abc\n0::/\n"}
    files |= at("sys/fs/cgroup/memory", group("6000000", 2_000_000, 500_000, is_old=True))
    assert free_memory_bytes(write(tmp_path, files)) == 4_500_000
