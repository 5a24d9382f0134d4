#!/bin/bash
# A study on a real Slurm: installs it on this machine (Debian, as root), submits four runs, interrupts one of them as
# pre-emption does, lets another run into its time limit, and compares the rows with those of a local run.
#
#   crates/palpate/scripts/slurm_end_to_end.sh [target/release/palpate]
set -euo pipefail
palpate=$(realpath "${1:-target/release/palpate}")
work=$(mktemp -d)
say() { echo "== $*"; }

if ! command -v slurmctld >/dev/null; then
    say "installing Slurm"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq slurmctld slurmd slurm-client munge >/dev/null
fi

say "starting Slurm"
host=$(hostname -s)
mkdir -p "$work"/{state,spool,munge} /etc/slurm
cat >/etc/slurm/slurm.conf <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
AuthType=auth/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
JobRequeue=1
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
mkdir -p /run/munge && chown munge: /run/munge
[ -s /etc/munge/munge.key ] || mungekey --create
pgrep -x munged >/dev/null || runuser -u munge -- munged
slurmctld
slurmd
finish() {
    pkill -x slurmd || true
    pkill -x slurmctld || true
    rm -rf "$work"
}
trap finish EXIT
for _ in $(seq 60); do sinfo -h -o %T 2>/dev/null | grep -q idle && break; sleep 1; done
sinfo

cat >"$work/four.toml" <<STUDY
name = "four"
[set]
sac.hidden = [64, 64]
run.checkpoint_every = 500
[evaluation]
episodes = 10
[[runs]]
name = "peg"
task = "peg-insertion"
model = ["P-14", "A-13pd"]
seeds = [1, 2]
steps = 12_000
STUDY

say "submitting"
# A task that is still running two minutes before its limit is told so, and comes back.
"$palpate" study submit "$work/four.toml" --out "$work/cluster" --slurm --time 00:03:00 --at-once 2 | tee "$work/said"
job=$(sed -n 's/^job //p' "$work/said")

say "pre-empting task 0 in the middle"
run=$work/cluster/runs/peg_P-14_s1
for _ in $(seq 600); do ls "$run"/checkpoints/step_* >/dev/null 2>&1 && break; sleep 0.2; done
for _ in $(seq 50); do scancel --batch --signal=USR1 "${job}_0" 2>/dev/null && break; sleep 0.2; done

say "waiting for the array"
for _ in $(seq 900); do
    squeue -h -j "$job" 2>/dev/null | grep -q . || break
    sleep 1
done
squeue
cat "$work"/cluster/slurm/*.log | grep -E "stopped at step|^done" || true
"$palpate" study status "$work/cluster"
grep -q "stopped at step" "$work/cluster/slurm/0.log" || { say "task 0 was not interrupted"; exit 1; }

say "the same on this machine, without Slurm"
"$palpate" study run "$work/four.toml" --out "$work/local" >/dev/null
for where in cluster local; do "$palpate" study report "$work/$where" >/dev/null; done
for rows in runs episodes evaluation curves; do cmp "$work/cluster/$rows.csv" "$work/local/$rows.csv"; done
head -3 "$work/cluster/runs.csv"
say "the same rows"
