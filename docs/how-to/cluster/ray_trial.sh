#!/bin/bash
# Does a set made under Ray, one of whose two workers is killed half-way, equal the set made at once?
#
# usage: ray_trial.sh PYTHON SABINE FOLDER [ARGUMENT ...]
#   ray_trial.sh python3 ./sabine /tmp/trial --speech SPEECH --rir RIR --count 1536 --shard-size 128 --rooms 12
# PYTHON must have ray. FOLDER is made; it receives the sets `alone` and `ray`, and the log of Ray.
set -euo pipefail
python=$1 program=$2 folder=$3
shift 3
here=$(dirname "$0")
mkdir "$folder"

"$program" augment --out "$folder/alone" "$@" >"$folder/alone.log" 2>&1

# A program that leaves its number and becomes augment_dataset.
cat >"$folder/noted" <<END
#!/bin/bash
echo "\$\$ \$*" >>"$folder/processes"
exec "$program" augment "\$@"
END
chmod +x "$folder/noted"
"$python" "$here/ray_shards.py" 2 "$folder/noted" --out "$folder/ray" "$@" >"$folder/ray.log" 2>&1 &
driver=$!
# Wait until a shard is there and the first worker is in the middle of its next one.
until ls "$folder"/ray/*.safetensors >/dev/null 2>&1; do
    kill -0 "$driver"
    sleep 0.05
done
sleep 0.5
victim=$(sed -n 's/^\([0-9]*\) .*--worker 1\/2$/\1/p' "$folder/processes" | head -n 1)
echo "$(ls "$folder"/ray/*.safetensors | wc -l) shards are there; killing process $victim, worker 1/2"
kill -KILL "$victim"
wait "$driver"
grep -o 'worker [12]/2: .*' "$folder/ray.log" | sed 's/RuntimeError.*//'

echo "started: $(grep -c 'worker 1/2$' "$folder/processes") times worker 1/2, $(grep -c 'worker 2/2$' "$folder/processes") times worker 2/2"

sums() { (cd "$1" && find . -type f | sort | xargs sha256sum); }
sums "$folder/alone" >"$folder/alone.sha256"
sums "$folder/ray" >"$folder/ray.sha256"
echo "$(wc -l <"$folder/alone.sha256") files; sha256 of their list: $(sha256sum <"$folder/alone.sha256" | cut -c 1-16) alone, $(sha256sum <"$folder/ray.sha256" | cut -c 1-16) under Ray"
diff "$folder/alone.sha256" "$folder/ray.sha256" && echo "identical, byte for byte"
