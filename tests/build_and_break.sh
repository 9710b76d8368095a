#!/usr/bin/env bash
# Builds the smoke scene in a folder with the present Snakemake: a plan, a killed run, one that goes
# on, one in which a job fails over a damaged view, and one that mends it.
#   tests/build_and_break.sh FOLDER CORES
set -euo pipefail
mkdir -p "$1"
smoke=(snakemake --directory "$1" --cores "$2" smoke)
"${smoke[@]}" --dry-run
timeout --signal KILL 15 "${smoke[@]}" || true
"${smoke[@]}"

folder=$1/results/smoke/LFCuboid_1x1x1/perspective
view=$folder/view_f0000f.png
before=$(mktemp)
touch --reference "$view" "$before"
printf damage | dd of="$view" bs=1 seek=1000 conv=notrunc status=none
touch --reference "$before" "$view"
rm "$before" "$folder/transforms.json"
log=$1/failing_run.txt
if "${smoke[@]}" 2>"$log"; then
    echo "error: no job failed over $view" >&2
    exit 1
fi
cat "$log" >&2
grep --quiet "^export_to_instant_ngp failed: error: .*view_f0000f.png: is not as its job made it" "$log"
"${smoke[@]}"
