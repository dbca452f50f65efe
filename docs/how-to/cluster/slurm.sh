#!/bin/bash
# Makes a data set, or an atlas, as a Slurm job array, one worker a task:
#
#   sbatch --array=1-16 --cpus-per-task=4 slurm.sh ./sabine augment --speech /data/speech --rir /data/rir --noise /data/noise \
#       --rooms 1000 --out /scratch/set --count 94500 --seed 1
#   sbatch --array=1-16 --cpus-per-task=2 slurm.sh ./effect_atlas --rooms 20 --out /scratch/atlas
#
# `--resume` and `--worker I/N` are added here. The array must be whole (1-N, no gaps).
#SBATCH --job-name=sabine
#SBATCH --mem=2G
#SBATCH --time=01:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail

# SLURM_ARRAY_TASK_ID counts from 1 as workers do.
export RAYON_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}
srun --cpus-per-task="$RAYON_NUM_THREADS" "$@" --resume --worker "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
