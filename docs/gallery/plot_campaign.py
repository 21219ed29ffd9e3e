"""
A campaign
==========

How does the error grow with the noise of the encoders? One experiment on the twin, many times, with one thing varied.
Here 24 runs; real campaigns have thousands, on all processors or a cluster, and continue after a stop
(:doc:`campaigns </campaign>`).
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt

from swingid.cli import main

# %%
# The plan: what is done, what is varied.

Path("noise.toml").write_text("""
name = "noise"
repeats = 6

[base]
rig = "paper"
reference = "sine 0.8 rad 8.5 rad/s"
duration = 10
rate = 500
methods = ["momentum", "equation-error"]
both.sensors.counts_per_turn = "absent"

[factors.noise]
key = "both.sensors.noise"
range = [1e-4, 1e-2]
scale = "log"
steps = 4
""")
code = main(["campaign", "noise.toml", "--out", "noise", "--workers", "1"])
assert code == 0

# %%
# The folder has every run as a row of ``results.parquet``, and a report in HTML.

print(sorted(path.name for path in Path("noise").iterdir()))
summary = json.loads(Path("noise/summary.json").read_text())
print(list(summary))

# %%
# Error of each run, and the uncertainty that the method stated for it.

import pyarrow.parquet as pq

rows = [row for row in pq.read_table("noise/results.parquet").to_pylist() if row["quantity"] == "inertia"]
figure, axes = plt.subplots(figsize=(8, 4))
for k, method in enumerate(("momentum", "equation-error")):
    own = [row for row in rows if row["method"] == method]
    noise = [row["noise"] for row in own]
    axes.loglog(noise, [100 * abs(row["value"] / row["truth"] - 1) for row in own], f"C{k}o", label=f"{method}, error")
    axes.loglog(noise, [100 * row["u"] / row["truth"] for row in own], f"C{k}_", ms=12, label=f"{method}, stated")
axes.set(xlabel="noise of the encoders, rad", ylabel="% of the inertia")
axes.legend()
figure.tight_layout()
