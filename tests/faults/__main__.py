"""`make faults`: runs every fault many times (docs/reliability.md). Seeds are printed; `--only kills --way WAY --runs 1 --seed SEED` repeats one."""

import argparse
import secrets
import sys
from collections import Counter
from collections.abc import Callable
from typing import Final

from tests.faults.disk_full import can_mount, run_disk_full
from tests.faults.kills import WAYS, run_kills
from tests.faults.system_calls import is_strace_usable, run_system_calls


def kills(options: argparse.Namespace) -> int:
    return sum(_kills_of(way, options) for way in options.way or WAYS)


def _kills_of(way: str, options: argparse.Namespace) -> int:
    seed = secrets.randbelow(1 << 31) if options.seed is None else options.seed
    print(f"random kills ({WAYS[way]}): {options.runs} runs of {options.kills} kills, seeds {seed} to {seed + options.runs - 1}", flush=True)
    reports = run_kills(options.runs, options.kills, seed, way=way)
    total = sum((report.kills for report in reports), Counter[str]())
    wrong = [report for report in reports if report.faults]
    print(f"random kills ({WAYS[way]}): {total.total():,} in {len(reports)} runs: {_counts(total)}; {len(wrong)} runs with faults", flush=True)
    return len(wrong)


def system_calls(options: argparse.Namespace) -> int:
    if not is_strace_usable():
        print("SKIPPED system calls: strace is not installed or may not trace processes; apt install strace")
        return 0
    report = run_system_calls(options.every)
    print(f"system calls: {report.outcomes.total():,} points: {_counts(report.outcomes)}; {len(report.faults)} faults")
    return _show(report.faults)


def disk_full(options: argparse.Namespace) -> int:
    if not can_mount():
        print("SKIPPED full disk: only root may mount the small disk")
        return 0
    return _show(run_disk_full(options.sizes).faults)


FAULTS: Final[dict[str, Callable[[argparse.Namespace], int]]] = {"kills": kills, "calls": system_calls, "disk": disk_full}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--only", choices=sorted(FAULTS), action="append", help="only this kind of fault; repeatable")
    parser.add_argument("--runs", type=int, default=50, help="number of runs with random kills")
    parser.add_argument("--kills", type=int, default=21, help="kills in each run")
    parser.add_argument("--seed", type=int, help="seed of the first run; default: random")
    parser.add_argument("--way", choices=sorted(WAYS), action="append", help="only this way of random kills; repeatable")
    parser.add_argument("--every", type=int, default=1, help="only every Nth failing system call")
    parser.add_argument("--sizes", type=int, default=24, help="number of disk sizes")
    options = parser.parse_args()
    found = sum(FAULTS[name](options) for name in options.only or FAULTS)
    return 1 if found else 0


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{count:,} {name}" for name, count in counter.most_common())


def _show(faults: list[str]) -> int:
    for fault in faults:
        print(f"FAULT {fault}")
    return len(faults)


if __name__ == "__main__":
    sys.exit(main())
