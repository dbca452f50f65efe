"""Makes a data set, or an atlas, under Ray: one task for each of N workers, started anew where it fails.

usage: ray_shards.py WORKERS PROGRAM [ARGUMENT ...]
    ray_shards.py 8 ./sabine augment --speech SPEECH --rir RIR --out /shared/set --count 94500
    ray_shards.py 8 ./effect_atlas --rooms 20 --out /shared/atlas

Joins the cluster that RAY_ADDRESS names, else starts one on this machine. The folder given as --out must be the same one on
every machine (NFS, Lustre, ...). `--resume` and `--worker I/N` are added here: what a dead worker has finished is kept.
RAY_SHARDS_CPUS sets how many processors a worker takes (default 1).
"""

import os
import socket
import subprocess
import sys

import ray

CPUS = int(os.environ.get("RAY_SHARDS_CPUS", "1"))


@ray.remote(num_cpus=CPUS, max_retries=5, retry_exceptions=True)
def make(index, workers, command):
    """What one worker makes. A program that dies, or a machine that does, is tried again up to five times."""
    process = subprocess.Popen(
        [*command, "--resume", "--worker", f"{index}/{workers}"],
        env={**os.environ, "RAYON_NUM_THREADS": str(CPUS)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    print(f"worker {index}/{workers}: process {process.pid} on {socket.gethostname()}", flush=True)
    output, _ = process.communicate()
    if process.returncode != 0:
        print(f"worker {index}/{workers}: ended with {process.returncode}", flush=True)
        raise RuntimeError(f"worker {index}/{workers} ended with {process.returncode}: {output[-2000:]}")
    lines = [line for line in output.splitlines() if " made, " in line]
    return f"worker {index}/{workers}: {lines[-1] if lines else output[-200:]}"


def main():
    workers, command = int(sys.argv[1]), sys.argv[2:]
    if "RAY_ADDRESS" in os.environ:
        ray.init()
    else:
        ray.init(num_cpus=max(CPUS, min(workers * CPUS, os.cpu_count())), include_dashboard=False,
                 object_store_memory=80 * 2**20)
    for done in ray.get([make.remote(i + 1, workers, command) for i in range(workers)]):
        print(done)


main()
