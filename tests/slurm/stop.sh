#!/bin/bash
# Stops what tests/slurm/start.sh started, by the process ids it wrote.
SLURM_TEST_DIR="${1:-/tmp/trajopt-slurm}"
export SLURM_CONF="$SLURM_TEST_DIR/slurm.conf"
scancel --user=root 2>/dev/null
for name in slurmd slurmctld munged; do
    file="$SLURM_TEST_DIR/$name.pid"
    [ -s "$file" ] && kill "$(cat "$file")" 2>/dev/null
done
exit 0
