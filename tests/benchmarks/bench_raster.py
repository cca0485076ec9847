"""Speed of the CPU rasterizer beside its error, as one table.

    python -m tests.benchmarks.bench_raster
    python -m tests.benchmarks.bench_raster --scenes small,heavy --runs 30 --json raster.json

Milliseconds are medians (and minima) of one forward and one backward pass of everything, 2D means included, after a
warm-up. Brute force in float64 cannot render the large scenes, so those are also rendered at 80x60 with the same
overlap: there the error is measured and the speed compared with plain torch in the same run. Pairs are (pixel,
Gaussian) evaluations; the limit is that of the multiply-add ports, measured beforehand.
"""

from __future__ import annotations

from app.lab.bench.scenes import RECIPES
from app.lab.bench.suite import Plan
from tests.benchmarks.options import make_parser, names, run


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = make_parser(__doc__, n_runs=15)
    parser.add_argument("--scenes", default=",".join(RECIPES), help="comma-separated names")
    parser.add_argument("--no-memory", action="store_true", help="do not measure peak memory, which starts processes")
    options = parser.parse_args(argv)
    chosen = names(options.scenes, list(RECIPES), parser)
    memory = frozenset() if options.no_memory else frozenset(chosen)
    run(Plan(raster=chosen, with_memory=memory, n_runs=options.runs), options)


if __name__ == "__main__":
    main()
