#!/bin/bash
# Starts a Slurm of one node on loopback, for tests: as root, without systemd, nothing listens beyond 127.0.0.1.
#
#   . tests/slurm/start.sh [directory]     starts it and sets SLURM_CONF in this shell
#   tests/slurm/stop.sh [directory]        stops it
#
# Needs Debian's slurm-wlm and munge.
SLURM_TEST_DIR="${1:-/tmp/trajopt-slurm}"
host="$(hostname -s)"
cpus="$(nproc)"
memory="$(awk '/MemTotal/ { m = int(0.8 * $2 / 1024); print (m < 4000 ? m : 4000) }' /proc/meminfo)"  # MB
mkdir -p "$SLURM_TEST_DIR/state" "$SLURM_TEST_DIR/spool" "$SLURM_TEST_DIR/munge"
chmod 755 "$SLURM_TEST_DIR"
chmod 700 "$SLURM_TEST_DIR/munge"
if [ ! -s "$SLURM_TEST_DIR/munge/munge.key" ]; then
    (umask 077; dd if=/dev/urandom of="$SLURM_TEST_DIR/munge/munge.key" bs=1 count=1024 status=none)
fi
# Both NoInAddrAny options: slurmd and slurmctld else listen on every address.
cat > "$SLURM_TEST_DIR/slurm.conf" <<CONF
ClusterName=trajopt
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$SLURM_TEST_DIR/munge.sock
CredType=cred/munge
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
StateSaveLocation=$SLURM_TEST_DIR/state
SlurmdSpoolDir=$SLURM_TEST_DIR/spool
SlurmctldPidFile=$SLURM_TEST_DIR/slurmctld.pid
SlurmdPidFile=$SLURM_TEST_DIR/slurmd.pid
SlurmctldLogFile=$SLURM_TEST_DIR/slurmctld.log
SlurmdLogFile=$SLURM_TEST_DIR/slurmd.log
KillWait=5
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=$memory State=UNKNOWN
PartitionName=test Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$SLURM_TEST_DIR/slurm.conf"
export SLURM_TEST_DIR
munged --force --key-file="$SLURM_TEST_DIR/munge/munge.key" --socket="$SLURM_TEST_DIR/munge.sock" \
    --pid-file="$SLURM_TEST_DIR/munged.pid" --log-file="$SLURM_TEST_DIR/munged.log" \
    --seed-file="$SLURM_TEST_DIR/munge/munged.seed"
slurmctld
slurmd -N "$host"
for _ in $(seq 60); do
    if sinfo --noheader --format=%T 2>/dev/null | grep -qE 'idle|mixed|allocated'; then
        echo "Slurm is up: $(sinfo --noheader --format='%N %T %c CPUs')"
        break
    fi
    sleep 0.5
done
sinfo --noheader --format=%T 2>/dev/null | grep -qE 'idle|mixed|allocated' || {
    echo "Slurm did not start; see $SLURM_TEST_DIR/*.log" >&2
    tail -n 5 "$SLURM_TEST_DIR"/*.log >&2
    false
}
