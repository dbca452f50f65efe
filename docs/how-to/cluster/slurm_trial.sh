#!/bin/bash
# Does what a Slurm array of two tasks makes, one of them killed half-way and queued again, equal what one process makes at once?
#
# usage: slurm_trial.sh FOLDER PATTERN PROGRAM [ARGUMENT ...]
#   export SLURM_CONF=/tmp/slurm/slurm.conf
#   slurm_trial.sh /tmp/trial '*.safetensors' ./sabine augment --speech SPEECH --rir RIR --count 1536 --shard-size 128 --rooms 12
#   slurm_trial.sh /tmp/trial 'room-*.json' ./effect_atlas --effects none,truncation --rooms 3
# FOLDER is made; it receives the results `alone` and `slurm`, and their logs. PATTERN is what finished pieces are
# called; PIECES of them (default 1) are waited for before the kill. The cluster must start a task again that
# ends with 137 (`RequeueExit=137`, as slurm_node.sh sets it up), or someone must say `scontrol requeue`.
set -euo pipefail
folder=$1 pattern=$2 program=$(realpath "$3")
shift 3
here=$(realpath "$(dirname "$0")")
mkdir "$folder"
folder=$(realpath "$folder")
pieces() { find "$folder/slurm" -name "$pattern" 2>/dev/null | wc -l; }

"$program" "$@" --out "$folder/alone" >"$folder/alone.log" 2>&1

# A program that leaves its number and becomes the real one.
cat >"$folder/noted" <<END
#!/bin/bash
echo "\$\$ \$*" >>"$folder/processes"
exec "$program" "\$@"
END
chmod +x "$folder/noted"
job=$(sbatch --parsable --array=1-2 --cpus-per-task=1 --mem=512M --output="$folder/task_%a.log" "$here/slurm.sh" "$folder/noted" "$@" \
    --out "$folder/slurm")
# Wait until enough pieces are there and the first worker is in the middle of its next one.
until [ "$(pieces)" -ge "${PIECES:-1}" ]; do
    [ -n "$(squeue --noheader --jobs "$job" 2>/dev/null)" ]
    sleep 0.05
done
sleep 0.5
victim=$(sed -n 's/^\([0-9]*\) .*--worker 1\/2$/\1/p' "$folder/processes" | head -n 1)
echo "$(pieces) pieces are there; killing process $victim, worker 1/2"
kill -KILL "$victim"
while [ -n "$(squeue --noheader --jobs "$job" 2>/dev/null)" ]; do
    sleep 1
done
grep -h ' made, ' "$folder"/task_*.log
echo "started: $(grep -c 'worker 1/2$' "$folder/processes") times worker 1/2, $(grep -c 'worker 2/2$' "$folder/processes") times worker 2/2"

sums() { (cd "$1" && find . -type f | sort | xargs sha256sum); }
sums "$folder/alone" >"$folder/alone.sha256"
sums "$folder/slurm" >"$folder/slurm.sha256"
echo "$(wc -l <"$folder/alone.sha256") files; sha256 of their list: $(sha256sum <"$folder/alone.sha256" | cut -c 1-16) alone, $(sha256sum <"$folder/slurm.sha256" | cut -c 1-16) under Slurm"
diff "$folder/alone.sha256" "$folder/slurm.sha256" && echo "identical, byte for byte"
