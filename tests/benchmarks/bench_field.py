"""Speed of the decode (hash grid, field network, heads, activations) beside its error, as one table.

    python -m tests.benchmarks.bench_field
    python -m tests.benchmarks.bench_field --scenes 8k,50k --runs 30 --json field.json

The fused back end and plain torch run in turn, forward and backward, at the same size; errors are against float64. The
scenes called "heads" have no dynamic feature: what is missing there is the hash grid and the field network.
"""

from __future__ import annotations

from app.lab.bench.field import SCENES
from app.lab.bench.suite import Plan
from tests.benchmarks.options import make_parser, names, run


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = make_parser(__doc__, n_runs=15)
    parser.add_argument("--scenes", default=",".join(SCENES), help="comma-separated names")
    parser.add_argument("--no-memory", action="store_true", help="do not measure peak memory, which starts processes")
    options = parser.parse_args(argv)
    chosen = names(options.scenes, list(SCENES), parser)
    memory = frozenset() if options.no_memory else frozenset(chosen)
    run(Plan(decode=chosen, with_memory=memory, n_runs=options.runs), options)


if __name__ == "__main__":
    main()
