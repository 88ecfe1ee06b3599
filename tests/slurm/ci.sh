#!/bin/bash
# The Slurm tests from nothing to nothing: installs Debian's slurm-wlm and munge where they are missing, starts one
# node on loopback, tests, and stops it, however the tests end. For CI, as root in a container.
#
#   tests/slurm/ci.sh [python]        default: .venv/bin/python
#
# Slurm is an optional engine: where it can be neither found nor installed this says so loudly and exits with 0. Once
# it is there, nothing is skipped (TRAJOPT_REQUIRE_SLURM=1), and the exit code is that of the tests.
set -uo pipefail
cd "$(dirname "$0")/../.."
python="${1:-.venv/bin/python}"
directory="$(mktemp -d /tmp/trajopt-slurm-XXXXXX)"

skip() {
    echo "=================================================================="
    echo "SKIPPED: the Slurm tests did not run: $1"
    echo "=================================================================="
    rm -rf "$directory"
    exit 0
}

install() {
    command -v apt-get > /dev/null || skip "no slurmctld here, and no apt-get to install it"
    local policy=/usr/sbin/policy-rc.d made=""
    if [ ! -e "$policy" ]; then  # the packages must not start their services
        printf '#!/bin/sh\nexit 101\n' > "$policy" && chmod 755 "$policy" && made=yes
    fi
    export DEBIAN_FRONTEND=noninteractive
    { timeout 120 apt-get -q -o Acquire::Retries=2 update &&
        timeout 240 apt-get -q -y -o Acquire::Retries=2 install --no-install-recommends slurm-wlm munge
    } > "$directory/apt.log" 2>&1
    local code=$?
    [ -n "$made" ] && rm -f "$policy"
    if [ "$code" -ne 0 ]; then
        tail -n 5 "$directory/apt.log"
        skip "apt-get cannot install slurm-wlm and munge (exit code $code)"
    fi
}

[ "$(id -u)" = 0 ] || skip "starting munged, slurmctld and slurmd needs root"
for program in munged slurmctld slurmd sbatch sinfo; do
    command -v "$program" > /dev/null || { install; break; }
done

trap 'tests/slurm/stop.sh "$directory"; rm -rf "$directory"' EXIT
trap 'exit 130' INT TERM HUP
. tests/slurm/start.sh "$directory" || { echo "Slurm is installed but does not start" >&2; exit 1; }
TRAJOPT_REQUIRE_SLURM=1 timeout --kill-after=20 480 "$python" -m pytest tests/slurm
