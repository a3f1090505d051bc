"""`firm scheduler`: the evaluation of the schedulers, and the best scheduler for a system."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, command, load, natural, positive


def add_scheduler(commands: Any) -> None:
    """Declare the command and its actions."""
    scheduler = command(commands, "scheduler", "evaluate and choose schedulers", "firm scheduler choose robot.yaml")
    actions = scheduler.add_subparsers(title="actions", metavar="ACTION", required=True)
    bench = command(
        actions,
        "bench",
        "evaluate the schedulers with cycle-exact models, as in the dissertation's section 4.3",
        "firm scheduler bench --dataset all --output evaluation",
        _bench_schedulers,
    )
    lists = "names separated by commas (default: %(default)s)"
    bench.add_argument(
        "--dataset", default="large", metavar="NAMES", help=f"data sets: large, cc1 to cc4, or all; {lists}"
    )
    bench.add_argument("--policies", default="all", metavar="NAMES", help=f"schedulers; {lists}")
    bench.add_argument("--requesters", metavar="N,N", help="numbers of accelerators (default: 2,4,8,16,32,64,128,256)")
    bench.add_argument(
        "--sets", type=positive, metavar="N", help="number of sets in each data set (default: set by the data set)"
    )
    bench.add_argument(
        "--cycles",
        type=positive,
        metavar="N",
        help="number of cycles in each simulation (default: set by the data set)",
    )
    bench.add_argument("--seed", type=natural, default=1, metavar="N", help="seed of all random values (default: 1)")
    bench.add_argument(
        "--distribution",
        choices=("normal", "uniform"),
        default="normal",
        help="distribution of the times (default: normal)",
    )
    bench.add_argument(
        "--shortest-run",
        type=positive,
        default=1,
        metavar="BEATS",
        help="number of beats in a run before a preemptive scheduler may interrupt the run (default: 1)",
    )
    bench.add_argument(
        "--resume-beats",
        type=natural,
        default=0,
        metavar="BEATS",
        help="number of additional beats in a resumed run; 1 for the Manager's bursts (default: 0, as in section 4.3)",
    )
    bench.add_argument(
        "--jobs", type=positive, metavar="N", help="number of parallel simulations (default: one per processor core)"
    )
    bench.add_argument(
        "--cluster", metavar="ADDRESS", help="run on the Dask cluster of the scheduler at ADDRESS, not on this machine"
    )
    bench.add_argument(
        "--output", type=Path, metavar="DIR", help="write a report with all tables and figures into this folder"
    )
    bench.add_argument("--csv", type=Path, metavar="F.csv", help="write all metrics of all simulations to this table")
    choose = command(
        actions,
        "choose",
        "choose the best scheduler for a specification, and compute the required buffers",
        "firm scheduler choose robot.yaml --criterion lateness",
        _choose_scheduler,
    )
    choose.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
    choose.add_argument(
        "--criterion",
        choices=("luts", "lateness", "finish"),
        default="luts",
        help="luts: fewest LUTs with all deadlines met; lateness: smallest worst lateness; "
        "finish: fewest LUTs without starvation (default: luts)",
    )
    choose.add_argument("--format", choices=("text", "yaml", "json"), default="text", help="default: text")
    add_sources(choose)


def _bench_schedulers(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.scheduling.evaluation.bench import Places, Selection, bench, names_of, numbers_of
    from fusesoc_firm.scheduling.evaluation.jobs import Settings
    from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, REQUESTERS, Distribution
    from fusesoc_firm.scheduling.policies import POLICIES

    def names(text: str, legal: Sequence[str], what: str) -> tuple[str, ...]:
        return tuple(legal) if text == "all" else names_of(text, legal, what)

    selection = Selection(
        names(arguments.dataset, list(DATA_SETS), "data set"),
        names(arguments.policies, list(POLICIES), "policy"),
        REQUESTERS if arguments.requesters is None else numbers_of(arguments.requesters),
        Settings(
            arguments.seed,
            arguments.sets,
            arguments.cycles,
            Distribution(arguments.distribution),
            arguments.shortest_run,
            arguments.resume_beats,
        ),
    )
    bench(selection, Places(arguments.jobs, arguments.cluster, arguments.output, arguments.csv))


def _choose_scheduler(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.scheduling.analysis import Criterion, choose
    from fusesoc_firm.scheduling.choice import show
    from fusesoc_firm.system.derived.timing import channel_of, tasks_of

    system = load(arguments).system
    choice = choose(tasks_of(system), Criterion(arguments.criterion), channel_of(system))
    print(show(choice, arguments.format), end="")
