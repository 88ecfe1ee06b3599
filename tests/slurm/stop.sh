#!/bin/bash
# Stops what tests/slurm/start.sh started, by the process ids it wrote, and waits until it is gone.
SLURM_TEST_DIR="${1:-/tmp/trajopt-slurm}"
export SLURM_CONF="$SLURM_TEST_DIR/slurm.conf"
[ -s "$SLURM_CONF" ] || exit 0
timeout 10 scancel --user=root 2>/dev/null
for _ in $(seq 20); do  # jobs first, or their steps outlive slurmd
    [ -z "$(timeout 5 squeue --noheader 2>/dev/null)" ] && break
    sleep 0.5
done
left=0
for name in slurmd slurmctld munged; do
    pid="$(cat "$SLURM_TEST_DIR/$name.pid" 2>/dev/null)"
    [ -n "$pid" ] && [ "$(cat "/proc/$pid/comm" 2>/dev/null)" = "$name" ] || continue
    kill "$pid" 2>/dev/null
    for _ in $(seq 40); do
        [ -d "/proc/$pid" ] || break
        sleep 0.25
    done
    if [ -d "/proc/$pid" ] && [ "$(cut -d' ' -f3 "/proc/$pid/stat" 2>/dev/null)" != Z ]; then
        kill -9 "$pid" 2>/dev/null
        sleep 0.5
        [ -d "/proc/$pid" ] && left=1
    fi
done
exit "$left"
