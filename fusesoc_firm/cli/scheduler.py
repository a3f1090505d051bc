"""`firm scheduler`: the evaluation of the schedulers, and the best scheduler for a system."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_sources, command, load, natural, positive

if TYPE_CHECKING:
    from fusesoc_firm.scheduling.evaluation.bench import Selection


def add_scheduler(commands: Any) -> None:
    """Declare the command and its actions."""
    scheduler = command(commands, "scheduler", "evaluate and choose schedulers", "firm scheduler choose robot.yaml")
    actions = scheduler.add_subparsers(title="actions", metavar="ACTION", required=True)
    bench = command(
        actions,
        "bench",
        "evaluate the schedulers with cycle-exact models, as in the dissertation's section 4.3",
        "firm scheduler bench --policies lru,lst --requesters 8,32 --csv values.csv",
        _bench_schedulers,
    )
    add_evaluations(bench)
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


def add_evaluations(parser: argparse.ArgumentParser) -> None:
    """Add the options that select evaluations, and the processors that run them."""
    lists = "names separated by commas (default: %(default)s)"
    parser.add_argument(
        "--dataset", default="large", metavar="NAMES", help=f"data sets: large, cc1 to cc4, or all; {lists}"
    )
    parser.add_argument("--policies", default="all", metavar="NAMES", help=f"schedulers; {lists}")
    parser.add_argument("--requesters", metavar="N,N", help="numbers of accelerators (default: 2,4,8,16,32,64,128,256)")
    parser.add_argument(
        "--sets", type=positive, metavar="N", help="number of sets in each data set (default: set by the data set)"
    )
    parser.add_argument(
        "--cycles",
        type=positive,
        metavar="N",
        help="number of cycles in each simulation (default: set by the data set)",
    )
    parser.add_argument("--seed", type=natural, default=1, metavar="N", help="seed of all random values (default: 1)")
    parser.add_argument(
        "--distribution",
        choices=("normal", "uniform"),
        default="normal",
        help="distribution of the times (default: normal)",
    )
    parser.add_argument(
        "--shortest-run",
        type=positive,
        default=1,
        metavar="BEATS",
        help="number of beats in a run before a preemptive scheduler may interrupt the run (default: 1)",
    )
    parser.add_argument(
        "--resume-beats",
        type=natural,
        default=0,
        metavar="BEATS",
        help="number of additional beats in a resumed run; 1 for the Manager's bursts (default: 0, as in section 4.3)",
    )
    parser.add_argument(
        "--jobs", type=positive, metavar="N", help="number of parallel simulations (default: one per processor core)"
    )
    parser.add_argument(
        "--cluster", metavar="ADDRESS", help="run on the Dask cluster of the scheduler at ADDRESS, not on this machine"
    )


def selection_of(arguments: argparse.Namespace) -> Selection:
    """Return the selected evaluations; raise `InputError` for an unknown name or an illegal number."""
    from fusesoc_firm.scheduling.evaluation.bench import Selection, names_of, numbers_of
    from fusesoc_firm.scheduling.evaluation.jobs import Settings
    from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, REQUESTERS, Distribution
    from fusesoc_firm.scheduling.policies import POLICIES

    def names(text: str, legal: Sequence[str], what: str) -> tuple[str, ...]:
        return tuple(legal) if text == "all" else names_of(text, legal, what)

    return Selection(
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


def _bench_schedulers(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.scheduling.evaluation.bench import bench
    from fusesoc_firm.tools.workers import chosen_workers

    bench(selection_of(arguments), chosen_workers(arguments.jobs, arguments.cluster), arguments.csv)


def _choose_scheduler(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.exploration.worst_case import worst_times
    from fusesoc_firm.exploration.worst_case_text import worst_times_text
    from fusesoc_firm.scheduling.analysis import Criterion, choose
    from fusesoc_firm.scheduling.choice import show
    from fusesoc_firm.system.derived.timing import channel_of, tasks_of

    loaded = load(arguments)
    system = loaded.system
    choice = choose(tasks_of(system), Criterion(arguments.criterion), channel_of(system))
    responses = {item.task.name: item.response for item in choice.best.bounds if item.response is not None}
    times = worst_times(loaded, responses)
    print(show(choice, arguments.format, {"worstCase": [item.data() for item in times]}), end="")
    if arguments.format == "text":
        print("\n".join(worst_times_text(times)))
