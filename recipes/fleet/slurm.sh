#!/bin/bash
# Logs of a manifest on a batch queue: each element of the array looks back on its share of the lines.
#
#   sbatch --array=0-63 recipes/fleet/slurm.sh /data/logs.txt /data/fleet
#   sbatch --dependency=afterany:JOB recipes/fleet/slurm.sh --join /data/logs.txt /data/fleet
#
# An element that was killed is sent again (scontrol requeue) and does only what is missing. AWS Batch
# says the same by AWS_BATCH_JOB_ARRAY_INDEX and AWS_BATCH_JOB_ARRAY_SIZE; paths are absolute, and
# those of the queue's machines, or addresses (s3://...).
#SBATCH --job-name=slamreplay --ntasks=1 --cpus-per-task=1 --mem=5G --time=12:00:00 --requeue
set -euo pipefail
export OMP_NUM_THREADS=1

if [ "$1" = --join ]; then
    # Parts of tables, reports and maps have names that tell their content: one folder holds them all. Each is there as a
    # whole or not at all, and rows come last.
    manifest=$2 out=$3
    for what in maps logs tables; do
        mkdir -p "$out/$what"
        for one in "$out"/slices/*/"$what"/*; do
            to="$out/$what/${one##*/}"
            if [ -e "$one" ] && [ ! -e "$to" ]; then
                rm -rf "$out/.joining"
                cp -r "$one" "$out/.joining"
                mv "$out/.joining" "$to"
            fi
        done
    done
    for one in "$out"/slices/*/batch.json; do
        cp "$one" "$out"   # it marks the folder as one of a batch; all are the same
    done
    # Nothing is left to do but what an element did not come to, and the page over all of them.
    slamreplay batch "$manifest" --output "$out" --workers 1
    exit
fi

manifest=$1 out=$2
index=${SLURM_ARRAY_TASK_ID:-${AWS_BATCH_JOB_ARRAY_INDEX:-0}}
size=${SLURM_ARRAY_TASK_COUNT:-${AWS_BATCH_JOB_ARRAY_SIZE:-1}}
mkdir -p "$out/slices"
# An element that was killed may come back on another machine, which cannot know that it holds no lock any more. No two
# of it run at once.
if [ "${SLURM_RESTART_COUNT:-0}" -gt 0 ] || [ "${AWS_BATCH_JOB_ATTEMPT:-1}" -gt 1 ]; then
    rm -f "$out/slices/$index/.lock"
fi
# Every n-th line, for logs of one day and place are of one length.
awk -v i="$index" -v size="$size" 'NF && !/^#/ && n++ % size == i' "$manifest" > "$out/slices/$index.txt"
slamreplay batch "$out/slices/$index.txt" --output "$out/slices/$index" --workers 1 --memory-limit 4GiB
