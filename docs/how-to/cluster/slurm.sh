#!/bin/bash
# Makes a data set as a Slurm job array, one worker a task: sbatch --array=1-16 slurm.sh
#SBATCH --job-name=sabine-set
#SBATCH --cpus-per-task=4
#SBATCH --mem=2G
#SBATCH --time=01:00:00
#SBATCH --requeue
set -euo pipefail

# SLURM_ARRAY_TASK_ID counts from 1 as workers do. The array must be whole (1-N, no gaps).
export RAYON_NUM_THREADS=$SLURM_CPUS_PER_TASK
srun ./sabine augment \
    --speech /data/speech --rir /data/rir --noise /data/noise --rooms 1000 \
    --out /scratch/set --count 94500 --seed 1 \
    --resume --worker "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
