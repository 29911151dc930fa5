#!/bin/bash
#SBATCH --job-name=shutterbug --array=0-15 --cpus-per-task=2 --mem=4G --requeue
# A list of captures into one data set, as a Slurm array: every task takes its share of the list.
#   sbatch examples/slurm/simulate.sh captures.txt /shared/dataset --seed 1 --format webdataset
# The array's size above is the number of shares; `sbatch --array=0-63` changes it. A task that is requeued keeps what it
# had finished. Needs `shutterbug` on PATH (pip install shutterbug). docs/python/machines.md says what the rest means.
set -euo pipefail
list=${1:?a list of captures, a folder a line, is expected} out=${2:?a folder that all machines see is expected}
shift 2
# A software driver takes every processor that it sees otherwise.
export LP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-2}
exec shutterbug simulate "$list" --out "$out" --resume \
  --shard "${SLURM_ARRAY_TASK_ID:?this is a Slurm array: sbatch starts it}/$SLURM_ARRAY_TASK_COUNT" "$@"
