"""Where the time of a training step goes: the table of its stages, beside the whole step.

    python -m tests.benchmarks.bench_iteration
    python -m tests.benchmarks.bench_iteration --sizes 8k --runs 100 --json iteration.json

"joint" is a reference clip whose anchors all move and learn, with field, heads and gains; "source" has frozen heads
and half of its anchors static and frozen. Stages are cut apart at their boundaries; the whole step runs without cuts.
"""

from __future__ import annotations

from app.lab.bench.iteration import SIZES
from app.lab.bench.suite import Plan
from tests.benchmarks.options import make_parser, names, run


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = make_parser(__doc__, n_runs=60)
    parser.add_argument("--sizes", default=",".join(SIZES), help="comma-separated names")
    options = parser.parse_args(argv)
    run(Plan(iterations=names(options.sizes, list(SIZES), parser), n_steps=options.runs), options)


if __name__ == "__main__":
    main()
