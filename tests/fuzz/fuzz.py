"""Fuzz firmware and host. `python tests/fuzz/fuzz.py --help` says how; README.md says what."""

from __future__ import annotations

import argparse
import datetime
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.fuzz import building
from tests.fuzz.building import BUILD, HERE, MAX_BYTES, ROOT, TARGETS

RUNS = HERE / "runs.json"
HOST_TARGETS = ("engine", "config", "log")
HOST_MAX_BYTES = 200


def options(target: str, max_bytes: int | None = None) -> list[str]:
    """Return what libFuzzer is told in every run."""
    return [
        f"-max_len={max_bytes or MAX_BYTES[target]}",
        "-timeout=5",
        "-detect_leaks=0",
        "-print_final_stats=1",
        f"-artifact_prefix={BUILD}/crash-{target}-",
    ]


def check(target: str, runs: int, seed: int = 1) -> subprocess.CompletedProcess[str]:
    """Run a target over its corpus, then over `runs` inputs more, the same every time."""
    folder = BUILD / "check" / target
    shutil.rmtree(folder, ignore_errors=True)
    building.unpack(target, folder)
    program = building.fuzzer(target)
    command = [str(program), *options(target), f"-seed={seed}", f"-runs={runs}", str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def run_long(
    target: str, seconds: int, jobs: int, corpus: Path, max_bytes: int | None = None
) -> bool:
    """Fuzz a target, keep what it finds in `corpus`, and write the run down.

    Jobs share the corpus: each reads what the others have found.
    """
    building.unpack(target, corpus)
    program = building.fuzzer(target)
    limits = [*options(target, max_bytes), f"-max_total_time={seconds}"]
    command = [str(program), *limits, str(corpus)]
    return _run(target, command, seconds, jobs, max_bytes or MAX_BYTES[target])


def run_host(target: str, seconds: int, corpus: Path) -> bool:
    """Fuzz a part of the host with atheris, and write the run down."""
    corpus.mkdir(parents=True, exist_ok=True)
    command = [
        sys.executable, str(HERE / "atheris_host.py"), target, f"-max_total_time={seconds}",
        f"-max_len={HOST_MAX_BYTES}", "-print_final_stats=1",
        f"-artifact_prefix={BUILD}/crash-{target}-", str(corpus),
    ]  # fmt: skip
    return _run(f"host {target}", command, seconds, 1, HOST_MAX_BYTES)


def _run(target: str, command: Sequence[str], seconds: int, jobs: int, max_bytes: int) -> bool:
    running = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(jobs)]
    executions = crashes = 0
    for job in running:
        said = job.communicate()[1]
        found = re.search(r"stat::number_of_executed_units:\s*(\d+)", said)
        executions += int(found[1]) if found else 0
        if job.returncode != 0:
            crashes += 1
            print(said[-4000:], file=sys.stderr)
    record(target, executions, seconds, crashes=crashes, max_bytes=max_bytes)
    return crashes == 0


def record(target: str, executions: int, seconds: int, *, crashes: int, max_bytes: int) -> None:
    """Append a run to runs.json."""
    entry = {
        "target": target,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "commit": _commit(),
        "executions": executions,
        "seconds": seconds,
        "max_bytes": max_bytes,
        "crashes": crashes,
    }
    entries = json.loads(RUNS.read_text()) if RUNS.exists() else []
    lines = ",\n".join(json.dumps(item) for item in [*entries, entry])
    RUNS.write_text(f"[\n{lines}\n]\n")
    print(f"{target}: {executions} executions in {seconds} s, {crashes} crashes")


def _commit() -> str:
    """Return what was fuzzed; with a plus where sources differ from the commit."""

    def git(*words: str) -> str:
        command = ["git", *words]
        return subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()

    sources = ["firmware", "host", "protocol", "tests/fuzz", ":!tests/fuzz/runs.json"]
    changed = git("status", "--porcelain", "--", *sources)
    return git("rev-parse", "--short=10", "HEAD") + ("+" if changed else "")


def minimise(target: str, corpus: Path) -> None:
    """Keep of `corpus` what reaches something that nothing shorter reaches."""
    merged = BUILD / "merged" / target
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    program = building.fuzzer(target)
    command = [str(program), *options(target), "-merge=1", str(merged), str(corpus)]
    subprocess.run(command, capture_output=True, check=True)
    inputs = [path.read_bytes() for path in merged.iterdir()]
    building.write_corpus(target, inputs)
    print(f"{target}: {len(inputs)} inputs, {sum(map(len, inputs))} bytes")


def coverage() -> None:
    """Print which lines of the firmware's portable code the corpora reach."""
    profiles = []
    programs = []
    for target in TARGETS:
        program = building.build(
            building.COUNTED, target, [*building.sources_of(target), HERE / "replay.cpp"],
            tag="counted",
        )  # fmt: skip
        folder = BUILD / "counted" / f"{target}-corpus"
        shutil.rmtree(folder, ignore_errors=True)
        files = sorted(building.unpack(target, folder).iterdir())
        profile = BUILD / "counted" / f"{target}.profraw"
        subprocess.run(
            [str(program), *map(str, files)], check=True, env={"LLVM_PROFILE_FILE": str(profile)}
        )
        profiles.append(str(profile))
        programs.append(str(program))
    merged = str(BUILD / "counted" / "all.profdata")
    subprocess.run(["llvm-profdata", "merge", "-o", merged, *profiles], check=True)
    others = [word for program in programs[1:] for word in ("-object", program)]
    subprocess.run(
        ["llvm-cov", "report", programs[0], *others, f"-instr-profile={merged}",
         "-show-region-summary=0", "-show-functions=0", str(building.LIBRARIES)],
        check=True,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    every = [*TARGETS, *HOST_TARGETS]
    parser.add_argument("--target", nargs="+", choices=every, default=every)
    parser.add_argument("--seconds", type=int, default=600, help="for each target")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--max-bytes", type=int, help="of an input: shorter ones run faster")
    parser.add_argument("--corpus", type=Path, default=BUILD / "corpus", help="what runs collect")
    parser.add_argument("--minimise", action="store_true", help="take its best into the repository")
    parser.add_argument("--coverage", action="store_true", help="only say what the corpora reach")
    chosen = parser.parse_args(arguments)
    if chosen.coverage:
        coverage()
        return 0
    good = True
    for target in chosen.target:
        if target in HOST_TARGETS:
            good &= chosen.minimise or run_host(target, chosen.seconds, chosen.corpus / target)
        elif chosen.minimise:
            minimise(target, chosen.corpus / target)
        else:
            corpus = chosen.corpus / target
            good &= run_long(target, chosen.seconds, chosen.jobs, corpus, chosen.max_bytes)
    return not good


if __name__ == "__main__":
    raise SystemExit(main())
