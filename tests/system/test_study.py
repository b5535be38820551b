"""Many simulated scans: what is done is kept, what fails is told, what is left is done later."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from setae.cli import main
from setae.errors import ConfigError, InputError, SetaeError
from setae.experiments import samples, study
from setae.experiments.study import Outcome, Run, conduct, conducting, perform
from setae.objects import random_object
from setae.rig import assembly
from setae.sim import SimulationError, World

# Four places of a bare table: a tenth of a second of computing.
SMALL = ["scan.area_mm=[20,20]", "scan.step_mm=20"]
# Nine places with an object in their middle: what stands on the table has to come along too.
OBJECT = {"objects": ["orange"], "vary": ["scan.area_mm=[140,140]", "scan.step_mm=70"]}
# So far above what it steps over the retracted bristle can't be.
TALL = "scan.clearance_mm=5,60"


def plan(**options: object) -> study.Plan:
    given = {"objects": ["none"], "seeds": 1, "vary": SMALL, **options}
    return study.of_options(**given)  # type: ignore[arg-type]  # as a command gives them


def never(run: Run) -> Outcome:
    raise AssertionError(f"{run.name} was done again")


def test_a_failed_run_is_told_and_the_others_go_on(tmp_path: Path) -> None:
    runs = plan(vary=[*SMALL, TALL]).runs()
    rows = conduct(runs, tmp_path, workers=1)
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert rows[0]["scan.clearance_mm"] == 5
    assert rows[0]["places"] == 4
    assert rows[0]["robot_s"] > 0
    assert "Raise the arm" in rows[1]["error"]
    # Again: what is done is not done anew, what failed is tried again.
    tried: list[str] = []

    def noted(run: Run) -> Outcome:
        tried.append(run.name)
        return perform(run)

    assert conduct(runs, tmp_path, workers=1, task=noted)[0] == rows[0]
    assert tried == [runs[1].name]
    assert [sample.name for sample in samples.read(tmp_path)] == [runs[0].name]


def test_a_run_is_scanned_in_its_own_mode_with_its_own_seed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # With one mode and one seed for all runs the tests passed, and a study would have compared
    # nothing.
    given: list[tuple[str, int]] = []

    def simulate(*_: object, mode: str, seed: int, **__: object) -> None:
        given.append((mode, seed))
        raise SetaeError("That will do.")

    monkeypatch.setattr("setae.experiments.study.one.simulate", simulate)
    runs = plan(seeds=2, modes=["paper", "safe", "adaptive"]).runs()
    for run in runs:
        perform(run)
    assert given == [(run.mode, run.seed) for run in runs]
    assert len(set(given)) == 6


def test_a_table_has_a_line_for_each_run(tmp_path: Path) -> None:
    rows = conduct(plan(vary=[*SMALL, TALL]).runs(), tmp_path, workers=1)
    read = study.read_table(study.write_table(tmp_path / "table.parquet", rows))
    assert [row["status"] for row in read] == ["done", "failed"]
    assert read[0]["robot_s"] == rows[0]["robot_s"]
    assert read[1]["robot_s"] is None
    assert json.loads(read[0]["scan.area_mm"]) == [20, 20]
    with pytest.raises(InputError, match=r"is a folder. Give the table in it: table\.parquet"):
        study.read_table(tmp_path)


def test_processes_share_the_runs_and_give_what_one_gives(tmp_path: Path) -> None:
    runs = plan(seeds=3, **OBJECT).runs()
    alone = conduct(runs, tmp_path / "alone", workers=1)
    with socket.socket() as other:
        # A second study on the machine failed: dask's usual port was taken.
        with contextlib.suppress(OSError):  # it is taken
            other.bind(("127.0.0.1", 8787))
            other.listen()
        together = conduct(runs, tmp_path / "together", workers=2)
    assert all(row["status"] == "done" and row["touched"] > 0 for row in alone)
    timeless = [[{**row, "wall_s": 0} for row in rows] for rows in (alone, together)]
    assert timeless[0] == timeless[1]
    for run in runs:
        maps = [tmp_path / folder / study.RUNS / run.name / study.MAP
                for folder in ("alone", "together")]  # fmt: skip
        assert maps[0].read_bytes() == maps[1].read_bytes()
    assert conduct(runs, tmp_path / "together", workers=2, task=never) == together
    found = {sample.name: sample for sample in samples.read(tmp_path / "alone")}
    for run in runs:
        sample = found[run.name]
        assert sample.label == "orange"
        assert sample.scene is not None
        assert sample.scene.object == random_object("orange", run.seed, area_mm=(140, 140))
        assert np.nanmax(sample.heights.height_mm) > sample.scene.table_z_mm + 10


def test_an_interrupt_while_the_workers_start_waits_until_they_can_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half-started workers, and dask that could not end them, left tracebacks."""
    happened: list[str] = []

    class Starting:
        def __init__(self, **_: object) -> None:
            signal.raise_signal(signal.SIGINT)
            blocked = "import signal; print(signal.SIGINT in signal.pthread_sigmask(0, []))"
            worker = [sys.executable, "-c", blocked]
            happened.append(subprocess.run(worker, capture_output=True, text=True).stdout.strip())

        def __enter__(self) -> object:
            return self

        def __exit__(self, *_: object) -> None:
            happened.append("ended")

    monkeypatch.setattr("distributed.LocalCluster", Starting)
    with pytest.raises(KeyboardInterrupt):
        conduct(plan(seeds=2).runs(), tmp_path, workers=2)
    assert happened == ["True", "ended"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_scheduler_that_runs_elsewhere_does_the_runs(tmp_path: Path) -> None:
    runs = plan(vary=[*SMALL, TALL]).runs()
    distributed: Any = importlib.import_module("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://",
        host="127.0.0.1", dashboard_address="127.0.0.1:0",
    ) as cluster:  # fmt: skip
        rows = conduct(runs, tmp_path, scheduler=cluster.scheduler_address)
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert (tmp_path / study.RUNS / runs[0].name / study.MAP).is_file()


def test_a_bug_in_a_run_is_kept_with_its_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("no reason")

    monkeypatch.setattr("setae.experiments.study.one.simulate", broken)
    runs = plan().runs()
    rows = conduct(runs, tmp_path, workers=1)
    assert rows[0]["error"] == "ZeroDivisionError: no reason"
    text = (tmp_path / study.RUNS / runs[0].name / "traceback.txt").read_text()
    assert "in broken" in text


def test_half_written_lines_and_other_runs_do_not_count(tmp_path: Path) -> None:
    runs = plan(seeds=2).runs()
    folder = tmp_path / study.RUNS / runs[0].name
    folder.mkdir(parents=True)
    (folder / "row.json").write_text('{"status": "do')
    done: list[str] = []

    def quick(run: Run) -> Outcome:
        done.append(run.name)
        return Outcome(row={"run": run.name, "status": "done"})

    conduct(runs[:1], tmp_path, workers=1, task=quick)
    conduct(runs, tmp_path, workers=1, task=quick)
    assert done == [run.name for run in runs]


def test_a_run_without_the_log_that_is_to_be_kept_is_done_again(tmp_path: Path) -> None:
    # A second call with --keep-logs said that all was done, and kept none.
    done: list[bool] = []

    def quick(run: Run) -> Outcome:
        done.append(run.keep_log)
        files = {"scan.mcap": b"log"} if run.keep_log else {}
        return Outcome(row={"run": run.name, "status": "done"}, files=files)

    for keep_logs in (False, True, True, False):
        conduct(plan(keep_logs=keep_logs).runs(), tmp_path, workers=1, task=quick)
    assert done == [False, True]


def test_a_run_that_failed_to_keep_its_log_is_done_again(tmp_path: Path) -> None:
    # The line of the same run without a log vouched for the half of the files that was written.
    done: list[bool] = []

    def quick(run: Run) -> Outcome:
        done.append(run.keep_log)
        files = {"scan.mcap": b"log", "map.npz": b"map"} if run.keep_log else {}
        return Outcome(row={"run": run.name, "status": "done"}, files=files)

    plain, logged = plan().runs(), plan(keep_logs=True).runs()
    conduct(plain, tmp_path, workers=1, task=quick)
    in_the_way = tmp_path / study.RUNS / plain[0].name / "map.npz"
    in_the_way.mkdir()
    with pytest.raises(SetaeError):
        conduct(logged, tmp_path, workers=1, task=quick)
    in_the_way.rmdir()
    conduct(logged, tmp_path, workers=1, task=quick)
    assert done == [False, True, True]


def test_the_name_of_a_run_changes_with_all_that_it_is_made_of() -> None:
    base = plan().runs()[0]
    others = [
        plan(seeds=2).runs()[1],
        plan(modes=["safe"]).runs()[0],
        plan(plants=["paper_like"]).runs()[0],
        plan(vary=["scan.area_mm=[20,20]"]).runs()[0],
    ]
    assert len({run.name for run in (base, *others)}) == 5
    assert plan().runs()[0] == base


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: plan(objects=["lemon"]), "'lemon'"),
        (lambda: plan(modes=["quick"]), "'quick'"),
        (lambda: plan(seeds=0), "seeds"),
        (lambda: plan(vary=["scan.step_mm"]), "no key with its values"),
        (lambda: plan(vary=["scan.step_mm=10,10"]), "twice"),
        # The first one's values went without a word.
        (lambda: plan(vary=["scan.step_mm=10", "scan.step_mm=20"]), "step_mm is given twice"),
        (lambda: plan(vary=["scan.stride_mm=10"]), "stride_mm"),
        (lambda: plan(vary=["scan.step_mm=-1"]), "step_mm"),
        (lambda: plan(seeds=100_001), "too many"),
        # These were told run by run, after the runs before them.
        (lambda: plan(plants=["ideal", "foo"]), "no plant 'foo'"),
        (lambda: plan(vary=["simulator.tendon.friction=0.1,9"]), r"tendon\.friction must be"),
        (lambda: plan(vary=["simulator.tendon.fricton=0.1"]), r"Did you mean 'tendon\.friction'"),
        # It stood outside of the area: nothing was found, and nothing said.
        (lambda: plan(objects=["orange"]), "orange:0 doesn't fit into the scanned 20 x 20 mm"),
    ],
)
def test_what_can_not_be_is_told_before_anything_runs(
    make: Callable[[], study.Plan], words: str
) -> None:
    with pytest.raises((InputError, ConfigError), match=words):
        make()


def test_a_spring_without_an_equilibrium_fails_its_run_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One combination of possible values refused the whole study before anything had run.
    class Unsolved(World):
        def __init__(self, **given: Any) -> None:
            super().__init__(**given)
            self.friction = given["parameters"]["tendon.friction"]

        def start(self, arm_mm: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
            if self.friction == 0.2:
                raise SimulationError("Simulator: the spring has no equilibrium.")
            super().start(arm_mm)

    monkeypatch.setattr(assembly, "World", Unsolved)
    runs = plan(vary=[*SMALL, "simulator.tendon.friction=0.1,0.2"]).runs()
    rows = conduct(runs, tmp_path, workers=1)
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert "no equilibrium" in rows[1]["error"]


def test_workers_are_counted_where_the_system_does_not_say_which_cores_it_may_use(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # os.sched_getaffinity is Linux's: elsewhere `setae study` ended with an AttributeError.
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert conducting.workers_for(None, None) == 3


def test_a_file_says_the_same_as_options(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("[bristle]\nthreshold_hpa = 12\n")
    file = tmp_path / "study.toml"
    file.write_text(
        '[study]\nobjects = ["eraser", "none"]\nseeds = [3, 5]\nmodes = "safe"\n'
        'plants = ["ideal", "paper_like"]\nconfig = "robot.toml"\n'
        "[vary]\nscan.step_mm = [10, 20]\n"
    )
    runs = study.load(file).runs()
    assert len(runs) == 2 * 2 * 2 * 2
    assert runs[-1].object == "none"
    assert dict(runs[-1].changes) == {
        "simulator.plant_name": "paper_like", "scan.step_mm": 20, "bristle.threshold_hpa": 12,
    }  # fmt: skip
    assert "threshold_hpa = 12.0" in runs[0].config
    file.write_text("[study]\nsaeds = 3\n")
    with pytest.raises(InputError, match="saeds"):
        study.load(file)


def test_a_scheduler_that_is_not_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("setae.experiments.study.conducting._CONNECT_S", 0.2)
    with pytest.raises(SetaeError, match=r"no scheduler at tcp://127\.0\.0\.1:9"):
        conduct(plan().runs(), tmp_path, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(InputError, match="workers"):
        conduct(plan().runs(), tmp_path, scheduler="tcp://127.0.0.1:9", workers=2)


def test_the_command_leaves_table_and_report_and_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "study"
    command = ["study", "--object", "none", "--seeds", "1", "--vary", SMALL[0],
               "--vary", SMALL[1], "--vary", TALL, "--workers", "1", "--out", str(out)]  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        main(command)
    printed = capsys.readouterr().out
    assert ended.value.code == 3, "failed runs ended as if all was well"
    assert "1 of 2 runs done, 1 failed" in printed
    assert "Raise the arm" in printed
    assert f"The same call with --out {out} tries what failed again." in printed
    page = (out / "report.html").read_text()
    assert "1 of 2 runs failed" in page
    assert "Raise the arm" in page
    with pytest.raises(SystemExit) as ended:
        main([*command, "--no-report"])
    assert ended.value.code == 3
    assert "1 of 2 runs done, 1 failed" in capsys.readouterr().out


def call(*arguments: str, code: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", "--object", "none", "--seeds", "1", "--vary", SMALL[0], *arguments])
    assert ended.value.code == code


def test_the_table_holds_the_runs_of_all_calls_into_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A second call with another plan left a table of its own runs alone, beside all folders.
    out = ("--workers", "1", "--out", str(tmp_path))
    call("--vary", "scan.step_mm=10,20", "--no-report", *out)
    call("--vary", "scan.step_mm=20", "--vary", "scan.order='raster'", *out)
    assert "1 of 1 run done" in (printed := capsys.readouterr().out)
    assert "with 2 runs of other calls" in printed
    rows = study.read_table(tmp_path / "table.parquet")
    assert {row["run"] for row in rows} == {path.name for path in (tmp_path / study.RUNS).iterdir()}
    assert [(row["scan.step_mm"], row["scan.order"]) for row in rows[:1]] == [(20, "raster")]
    assert sorted(row["scan.step_mm"] for row in rows[1:]) == [10, 20]
    page = (tmp_path / "report.html").read_text()
    assert "3 of 3 runs done" in page
    assert "adaptive, area_mm [20, 20], step_mm 10<" in page
    # Of a run from before there was a column its cell is empty. `setae cluster` advised to run the
    # study again, which did nothing.
    line = tmp_path / study.RUNS / rows[1]["run"] / conducting.LINE
    kept = json.loads(line.read_text())
    line.write_text(
        json.dumps({name: kept[name] for name in kept.keys() - {"robot_s", "reach_mm"}})
    )
    call("--vary", "scan.step_mm=20", "--vary", "scan.order='raster'", *out)
    again = study.read_table(tmp_path / "table.parquet")
    assert [row["robot_s"] is None for row in again] == [False, True, False]
    with pytest.raises(InputError, match=r"has no 'reach_mm'\. Do the study again, into another"):
        samples.read(tmp_path)


def test_runs_of_two_robots_in_one_folder_are_told_apart(tmp_path: Path) -> None:
    # Their lines were equal in object, seed, mode and every column of the configuration, and the
    # report made one combination of them.
    robot = tmp_path / "robot.toml"
    for step_mm in (20, 10):
        robot.write_text(f"[scan]\nstep_mm = {step_mm}\n[simulator]\nplant_name = 'paper_like'\n")
        call("--config", str(robot), "--workers", "1", "--out", str(tmp_path / "study"))
    rows = study.read_table(tmp_path / "study/table.parquet")
    assert [row["scan.step_mm"] for row in rows] == [None, 20], "the paper's is 10"
    page = (tmp_path / "study/report.html").read_text()
    for case in ("", ", step_mm 20"):  # what all have is left out
        assert f"<td>adaptive, area_mm [20, 20]{case}</td>" in page
    # It was said of each that its plant was the ideal one.
    assert {one.origin for one in samples.read(tmp_path / "study")} == {
        "simulated, plant paper_like, mode adaptive"
    }


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--workers", "0"), "Give 1 or more"),
        (("--scheduler", "X", "--workers", "2"), "of its own"),
    ],
)
def test_workers_that_can_not_be_are_told_before_anything_is_made(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The folder and the progress bar came before the refusal.
    call(*arguments, "--out", str(tmp_path / "study"), code=1)
    printed = capsys.readouterr()
    assert said in printed.err
    assert not printed.out
    assert not (tmp_path / "study").exists()


def test_the_command_takes_a_scheduler(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed: Any = importlib.import_module("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://",
        host="127.0.0.1", dashboard_address="127.0.0.1:0",
    ) as cluster:  # fmt: skip
        call("--vary", SMALL[1], "--no-report", "--scheduler", cluster.scheduler_address,
             "--out", str(tmp_path))  # fmt: skip
    assert "1 of 1 run done, 0 failed" in capsys.readouterr().out
    monkeypatch.setattr("setae.experiments.study.conducting._CONNECT_S", 0.2)
    call("--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path / "other"), code=1)
    assert "There is no scheduler at tcp://127.0.0.1:9." in capsys.readouterr().err


def killed_at_the_second(first_line: Path, run: Run) -> Outcome:
    if run.seed == 1:
        deadline_s = time.monotonic() + 120
        while not first_line.exists() and time.monotonic() < deadline_s:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)
    return Outcome(row={"run": run.name, "status": "done"})


def test_a_killed_worker_costs_its_run_and_no_other(tmp_path: Path) -> None:
    dask: Any = importlib.import_module("dask.config")
    runs = plan(seeds=2).runs()
    # It held only where the runs went to different workers: what else a killed worker has fails
    # too. So the first is kept before the second's worker is killed.
    task = partial(killed_at_the_second, tmp_path / study.RUNS / runs[0].name / "row.json")
    with dask.set({"distributed.scheduler.allowed-failures": 0}):  # it is not tried again
        rows = conduct(runs, tmp_path, workers=2, task=task)
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert "KilledWorker" in rows[1]["error"]


def no_process() -> None:
    raise AssertionError("a process for workers was begun")


def test_one_run_or_none_begins_no_other_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One for workers was begun before it was known whether there are runs for them, and before
    # a missing extra or a folder in use was told.
    monkeypatch.setattr(forkserver, "ensure_running", no_process)
    for _ in range(2):  # the second time nothing is left
        call("--vary", SMALL[1], "--no-report", "--workers", "2", "--out", str(tmp_path / "study"))
    (tmp_path / "other").mkdir()
    (tmp_path / "other/thesis.txt").write_text("mine")
    call("--vary", "scan.step_mm=10,20", "--workers", "2", "--out", str(tmp_path / "other"), code=1)


def test_a_missing_extra_is_told_before_anything_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr(forkserver, "ensure_running", no_process)
    with pytest.raises(SystemExit) as ended:
        main(["study", "--seeds", "1", "--workers", "2", "--out", str(tmp_path / "study")])
    assert ended.value.code == 1
    assert "setae[study]" in capsys.readouterr().err
    assert not (tmp_path / "study").exists()
