#!/bin/bash
# What the same work costs under each engine with one worker and with two, as rows of a table: processor time of the program in all
# workers (not that of the engine), clock, and whether the files are those of the first run.
#
# usage: engine_times.sh FOLDER ENGINES PROGRAM [ARGUMENT ...]
#   PYTHON=python3 SLURM_CONF=/tmp/slurm/slurm.conf engine_times.sh /tmp/times none,ray,slurm ./effect_atlas --effects none --rooms 4
# FOLDER is made. One thread for each worker. PYTHON must have ray.
set -euo pipefail
folder=$1 engines=${2//,/ } program=$(realpath "$3")
shift 3
here=$(realpath "$(dirname "$0")")
mkdir "$folder"
folder=$(realpath "$folder")
export RAYON_NUM_THREADS=1
# Else Ray's workers give way to whatever else runs (niceness 15), and the clock of the engines does not compare.
export RAY_worker_niceness=0

# Runs the program and writes down what it took of the processor.
cat >"$folder/timed" <<END
#!/bin/bash
"$program" "\$@"
code=\$?
# In a pipe times would tell of another shell. Its second line is of the children.
times >"$folder/\$TIMED.\$\$"
exit \$code
END
chmod +x "$folder/timed"

begin() {
    case $1 in
    none) "$folder/timed" "${@:3}" --resume --worker 1/1 ;;
    ray) "${PYTHON:-python3}" "$here/ray_shards.py" "$2" "$folder/timed" "${@:3}" ;;
    slurm) sbatch --wait --array=1-"$2" --cpus-per-task=1 --mem=512M --output="$folder/task_%A_%a.log" "$here/slurm.sh" "$folder/timed" "${@:3}" ;;
    esac
}

sums() { (cd "$1" && find . -type f | sort | xargs sha256sum | sha256sum | cut -c 1-16); }
echo "| engine | workers | processor (s) | clock (s) | files |"
echo "|---|---|---|---|---|"
for engine in $engines; do
    for workers in 1 2; do
        [ "$engine$workers" != none2 ] || continue
        export TIMED="$engine-$workers.times"
        start=$(date +%s.%N)
        begin "$engine" "$workers" "$@" --out "$folder/$engine-$workers" >"$folder/$engine-$workers.log" 2>&1
        clock=$(awk -v from="$start" -v to="$(date +%s.%N)" 'BEGIN {printf "%.1f", to - from}')
        # Lines such as 1m2.345s 0m0.120s.
        processor=$(tail -q -n 1 "$folder/$TIMED".* | tr 'ms' '  ' | awk '{sum += 60 * $1 + $2 + 60 * $3 + $4} END {printf "%.1f", sum}')
        echo "| $engine | $workers | $processor | $clock | $(sums "$folder/$engine-$workers") |"
    done
done
