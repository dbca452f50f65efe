#!/bin/bash
# A Slurm of one node on this machine, for trials: no accounting, no cgroups, nothing outside FOLDER but munge's key.
#
# usage: slurm_node.sh FOLDER [PROCESSORS]
#   apt-get install slurm-wlm munge    (Debian's packages), then as root:
#   slurm_node.sh /tmp/slurm 2; export SLURM_CONF=/tmp/slurm/slurm.conf; sinfo
# Ends with: kill $(cat FOLDER/*.pid)
set -euo pipefail
folder=$1 processors=${2:-$(nproc)}
mkdir -p "$folder/state" "$folder/spool"
host=$(hostname -s)
memory_mb=$(awk '/MemAvailable/ {print int($2 / 1024)}' /proc/meminfo)

if ! munge -n >/dev/null 2>&1; then
    [ -s /etc/munge/munge.key ] || (umask 077; head -c 1024 /dev/urandom >/etc/munge/munge.key; chown munge:munge /etc/munge/munge.key)
    mkdir -p /run/munge && chown munge:munge /run/munge && chmod 755 /run/munge
    setpriv --reuid=munge --regid=munge --clear-groups munged
fi

# RequeueExit: a program that was killed (128 + 9) is started again. cred_expire: what is requeued waits as long (seconds).
cat >"$folder/slurm.conf" <<END
ClusterName=trial
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=cred_expire=5
CredType=cred/munge
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
MpiDefault=none
RequeueExit=137
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$processors RealMemory=$memory_mb State=UNKNOWN
PartitionName=trial Nodes=$host Default=YES MaxTime=INFINITE State=UP
END
export SLURM_CONF=$folder/slurm.conf
slurmctld
slurmd
for _ in $(seq 100); do
    [ "$(sinfo --noheader --format=%t 2>/dev/null)" = idle ] && exit 0
    sleep 0.2
done
sinfo
exit 1
