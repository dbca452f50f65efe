#!/bin/bash
# Does what two workers make under Ray, one of them killed half-way, equal what one process makes at once?
#
# usage: ray_trial.sh PYTHON FOLDER PATTERN PROGRAM [ARGUMENT ...]
#   ray_trial.sh python3 /tmp/trial '*.safetensors' ./sabine augment --speech SPEECH --rir RIR --count 1536 --shard-size 128 --rooms 12
#   ray_trial.sh python3 /tmp/trial 'room-*.json' ./effect_atlas --effects none,truncation --rooms 3
# PYTHON must have ray. FOLDER is made; it receives the results `alone` and `ray`, and their logs. PATTERN is what finished pieces are
# called; PIECES of them (default 1) are waited for before the kill.
set -euo pipefail
python=$1 folder=$2 pattern=$3 program=$(realpath "$4")
shift 4
here=$(realpath "$(dirname "$0")")
mkdir "$folder"
folder=$(realpath "$folder")
pieces() { find "$folder/ray" -name "$pattern" 2>/dev/null | wc -l; }

"$program" "$@" --out "$folder/alone" >"$folder/alone.log" 2>&1

# A program that leaves its number and becomes the real one.
cat >"$folder/noted" <<END
#!/bin/bash
echo "\$\$ \$*" >>"$folder/processes"
exec "$program" "\$@"
END
chmod +x "$folder/noted"
"$python" "$here/ray_shards.py" 2 "$folder/noted" "$@" --out "$folder/ray" >"$folder/ray.log" 2>&1 &
driver=$!
# Wait until enough pieces are there and the first worker is in the middle of its next one.
until [ "$(pieces)" -ge "${PIECES:-1}" ]; do
    kill -0 "$driver"
    sleep 0.05
done
sleep 0.5
victim=$(sed -n 's/^\([0-9]*\) .*--worker 1\/2$/\1/p' "$folder/processes" | head -n 1)
echo "$(pieces) pieces are there; killing process $victim, worker 1/2"
kill -KILL "$victim"
wait "$driver"
grep -o 'worker [12]/2: .*' "$folder/ray.log" | sed 's/RuntimeError.*//'

echo "started: $(grep -c 'worker 1/2$' "$folder/processes") times worker 1/2, $(grep -c 'worker 2/2$' "$folder/processes") times worker 2/2"

sums() { (cd "$1" && find . -type f | sort | xargs sha256sum); }
sums "$folder/alone" >"$folder/alone.sha256"
sums "$folder/ray" >"$folder/ray.sha256"
echo "$(wc -l <"$folder/alone.sha256") files; sha256 of their list: $(sha256sum <"$folder/alone.sha256" | cut -c 1-16) alone, $(sha256sum <"$folder/ray.sha256" | cut -c 1-16) under Ray"
diff "$folder/alone.sha256" "$folder/ray.sha256" && echo "identical, byte for byte"
