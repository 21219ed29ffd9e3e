"""Campaigns on a real Dask cluster with a worker killed in the middle, and the efficiency of maximum likelihood."""

from __future__ import annotations

import os
import signal
from multiprocessing import active_children
from pathlib import Path

import pytest

from swingid.study.campaign import run_campaign, summarise
from swingid.study.campaign.loading import plan_from_text

PLAN = """
name = "lost"
repeats = 12
block = 2
[base]
reference = "sine 0.8 rad 8.5 rad/s"
duration = 8
both.sensors.noise = 1e-3
methods = ["momentum", "energy", "output-error"]
[factors.friction.levels]
"viscous" = {}
"Coulomb" = {twin.axis.friction.coulomb = 2e-3}
"""


@pytest.mark.long
def test_a_worker_of_a_dask_cluster_killed_in_the_middle(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    plan = plan_from_text(PLAN)
    run_campaign(plan, tmp_path / "here", workers=1)
    killed: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=tmp_path / "dask"
    ) as cluster:
        with distributed.Client(cluster) as client:
            pids = client.run(os.getpid)

        def kill_one(done: int, trials: int, already: int) -> None:
            if not killed and 0 < done < trials:
                killed.append(next(iter(pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        run_campaign(plan, tmp_path / "there", scheduler=cluster.scheduler_address, progress=kill_one)
    assert len(killed) == 1
    results = [(tmp_path / name / "results.parquet").read_bytes() for name in ("here", "there")]
    assert results[0] == results[1]
    assert summarise(plan, tmp_path / "there").of("momentum").answered == 24


@pytest.mark.long
def test_a_killed_process_of_this_machine_costs_time_only(tmp_path: Path) -> None:
    plan = plan_from_text(PLAN)
    run_campaign(plan, tmp_path / "one", workers=1)
    killed: list[int] = []

    def kill_one(done: int, trials: int, already: int) -> None:
        if not killed and 0 < done < trials:
            killed.append(active_children()[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    run_campaign(plan, tmp_path / "two", workers=2, progress=kill_one)
    assert len(killed) == 1
    results = [(tmp_path / name / "results.parquet").read_bytes() for name in ("one", "two")]
    assert results[0] == results[1]


@pytest.mark.long
def test_maximum_likelihood_is_efficient_over_a_noise_grid(tmp_path: Path) -> None:
    """Output error that is given the law reaches the bound; its intervals hold the truth."""
    plan = plan_from_text("""
name = "efficient"
repeats = 60
[base]
reference = "sine 0.8 rad 8.5 rad/s"
duration = 6
methods = ["nls", "momentum"]
both.sensors.counts_per_turn = "absent"
[methods.nls]
method = "output-error"
law = "viscous"
[factors.noise]
key = "both.sensors.noise"
values = [1e-4, 1e-3, 1e-2]
[bound]
""")
    run_campaign(plan, tmp_path / "one")
    summary = summarise(plan, tmp_path / "one")
    share, error = summary.of("nls").efficiency
    assert share == pytest.approx(0.93, abs=0.07 + 3 * error)
    for level in ("0.0001", "0.001", "0.01"):
        assert (
            summary.at("noise", level, "nls").efficiency[0] > 2 * summary.at("noise", level, "momentum").efficiency[0]
        )
        covered, spread = summary.at("noise", level, "nls").coverage
        assert covered == pytest.approx(0.95, abs=3 * spread)
