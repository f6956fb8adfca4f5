"""A campaign on Slurm, with tasks killed and put back at random, ends in the bytes of one undisturbed run.

Usage: campaign.py GRIP [--units N] [--seed S] [--every SECONDS] [--folder DIR]

Sets up a cluster of one machine with six processors, so it believes, in a folder of its own (munged, slurmctld and slurmd as processes, nothing of the
system's), submits deploy/slurm/campaign.sbatch as an array of N units, a grasp sweep of a seed each, and every so often does one of these
to a task that runs: kills the program, tells it to end, kills the task's shell, has Slurm put the task back. What is missing in the end is
submitted again, as `grip campaign status --missing` says. Then merges, runs the sweep undisturbed, and compares. Takes everything down.

Needs root, and slurmctld, slurmd, slurm-client and munge (Debian's packages); says SKIPPED where they are not, or fails with
GRIP_REQUIRE_SLURM=1.
"""

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PROGRAMS = ["munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "sinfo"]
# More than a small machine has: tasks are so short that half of their time is Slurm's.
CPUS = 6
SWEEP = {"objects": "005_tomato_soup_can", "axes": "x", "samples": 2}


def free_ports(count):
    """Ports that nobody listens to at the moment."""
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Cluster:
    """Slurm on this machine alone, in a folder."""

    def __init__(self, folder):
        self.folder = folder
        self.processes = []
        host = socket.gethostname().split(".")[0]
        for name in ["state", "spool", "munge"]:
            (folder / name).mkdir(mode=0o755)
        key = folder / "munge" / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        ctld, slurmd = free_ports(2)
        munge = folder / "munge" / "socket"
        self.conf = folder / "slurm.conf"
        # cred_expire is also how long a task that is put back waits. linuxproc and no cgroups: it runs in any container.
        self.conf.write_text(
            f"""ClusterName=grip
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ctld}
SlurmdPort={slurmd}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={munge},cred_expire=5
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,sched_interval=2,bf_interval=2,default_queue_depth=1000
MaxArraySize=10001
MaxJobCount=50000
MinJobAge=2
KillWait=5
ReturnToService=2
JobRequeue=1
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={CPUS} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
        )
        self.env = {**os.environ, "SLURM_CONF": str(self.conf)}
        at = folder / "munge"
        self.start(
            ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={munge}", f"--pid-file={at}/pid"]
            + [f"--seed-file={at}/seed", f"--log-file={at}/log"]
        )
        self.until(munge.exists, "munged does not start")
        self.start(["slurmctld", "-D", "-f", str(self.conf)])
        self.start(["slurmd", "-D", "-f", str(self.conf), "-N", host])
        self.until(lambda: self.call("sinfo", "-h", "-o", "%t").strip() == "idle", "slurmd does not register")

    def start(self, command):
        """Starts a daemon, which lives as long as the cluster."""
        log = open(self.folder / f"{command[0]}.out", "w", encoding="utf-8")
        self.processes.append(subprocess.Popen(command, env=self.env, stdout=log, stderr=log))

    def until(self, ready, otherwise):
        """Waits for it, half a minute at most."""
        for _ in range(300):
            try:
                if ready():
                    return
            except subprocess.CalledProcessError:
                pass
            time.sleep(0.1)
        for log in sorted(self.folder.glob("*.log")) + sorted(self.folder.glob("*.out")):
            print(f"== {log.name}\n{log.read_text(errors='replace')[-3000:]}")
        raise SystemExit(otherwise)

    def call(self, *command):
        """What a command of Slurm prints."""
        ran = subprocess.run(command, env=self.env, check=True, capture_output=True, text=True)
        return ran.stdout

    def stop(self):
        """Ends all that was started."""
        try:
            subprocess.run(["scancel", "--me"], env=self.env, check=False, capture_output=True, timeout=20)
            for _ in range(100):
                if not self.call("squeue", "-h").strip():
                    break
                time.sleep(0.1)
        except (OSError, subprocess.SubprocessError):
            pass
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
        # What slurmd has started outlives it, by design: all that has this cluster in its environment.
        mark = f"SLURM_CONF={self.conf}".encode()
        for entry in Path("/proc").iterdir():
            try:
                ours = entry.name.isdigit() and mark in (entry / "environ").read_bytes().split(b"\0")
                if ours and int(entry.name) != os.getpid():
                    os.kill(int(entry.name), signal.SIGKILL)
            except OSError:
                continue


def running(campaign):
    """The processes that run a unit of the campaign: of the program, and of the shells around it."""
    programs, shells = [], []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue
        if str(campaign) not in words:
            continue
        if "campaign" in words and "run" in words:
            programs.append(int(entry.name))
        elif any(word.endswith("slurm_script") for word in words):
            shells.append(int(entry.name))
    return programs, shells


def disturb(cluster, campaign, chance):
    """Does something to a task; says what."""
    programs, shells = running(campaign)
    kind = chance.choice(["kill", "kill", "end", "end", "requeue", "requeue", "shell"])
    try:
        if kind == "requeue":
            tasks = cluster.call("squeue", "-h", "-t", "R", "-o", "%A").split()
            if not tasks:
                return None
            cluster.call("scontrol", "requeue", chance.choice(tasks))
        elif kind == "shell" and shells:
            os.kill(chance.choice(shells), signal.SIGKILL)
        elif kind in ("kill", "end") and programs:
            os.kill(chance.choice(programs), signal.SIGKILL if kind == "kill" else signal.SIGTERM)
        else:
            return None
    except (ProcessLookupError, subprocess.CalledProcessError):
        # It was done in the meantime.
        return None
    return kind


def run(cluster, grip, folder, options):
    """The campaign, and what comes out of it."""
    file, campaign, log = folder / "campaign.toml", folder / "campaign", folder / "logs"
    log.mkdir()
    rows = [f'names = ["{SWEEP["objects"]}"]', f'axes = "{SWEEP["axes"]}"', f"samples = {SWEEP['samples']}"]
    sweep = "\n".join([*rows, f"seeds = {options.units}"])
    file.write_text(f'[campaign]\nname = "slurm"\nunits = {options.units}\n\n[sweep]\n{sweep}\n')
    subprocess.run([grip, "campaign", "plan", file, "--out", campaign], check=True)
    # Once for all tasks, so that the first ones do not all do it.
    subprocess.run([grip, "campaign", "run", campaign, "--unit", "0"], check=True)

    chance, done, began = random.Random(options.seed), {}, time.monotonic()
    env = {**cluster.env, "GRIP": str(grip)}
    for attempt in range(10):
        missing = subprocess.run([grip, "campaign", "status", campaign, "--missing"], capture_output=True, text=True, check=False)
        if missing.returncode == 0:
            break
        array = missing.stdout.strip()
        assert array, "units cannot be done"
        script = ROOT / "deploy" / "slurm" / "campaign.sbatch"
        submit = ["sbatch", f"--array={array}", f"--output={log}/%a.log", "--time=10", str(script), str(campaign)]
        print(f"{time.monotonic() - began:.0f} s: submitted {array}", flush=True)
        subprocess.run(submit, env=env, check=True, stdout=subprocess.DEVNULL)
        last = time.monotonic()
        while cluster.call("squeue", "-h", "-o", "%A").strip():
            time.sleep(options.every * chance.uniform(0.5, 1.5))
            # The last rounds are left in peace, or there would be no end.
            kind = disturb(cluster, campaign, chance) if attempt < 3 else None
            if kind:
                done[kind] = done.get(kind, 0) + 1
            if time.monotonic() - last > 20:
                last = time.monotonic()
                there = len(list(campaign.glob("units/*/done.json")))
                print(f"{last - began:.0f} s: {there} of {options.units} units done; {done}", flush=True)
    print(f"{time.monotonic() - began:.0f} s: {options.units} units on Slurm; done to them: {done}", flush=True)
    subprocess.run([grip, "campaign", "status", campaign], check=True)
    assert sum(done.values()) >= min(10, options.units // 10), f"too little was done to it: {done}"

    merged, whole = folder / "merged", folder / "whole"
    subprocess.run([grip, "campaign", "merge", campaign, "--out", merged], check=True)
    words = [grip, "sweep", SWEEP["objects"], "--axes", SWEEP["axes"], "--samples", str(SWEEP["samples"])]
    words += ["--seeds", str(options.units), "--out", str(whole)]
    # From where the campaign's file is, so that both say the same of where files are.
    subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    names = sorted(path.name for path in whole.iterdir())
    assert names == sorted(path.name for path in merged.iterdir()), names
    for name in names:
        assert (whole / name).read_bytes() == (merged / name).read_bytes(), f"{name} differs"
    print(f"the same bytes as one undisturbed run: {', '.join(names)}")


def main():
    """Sets up, runs, takes down."""
    parser = argparse.ArgumentParser()
    parser.add_argument("grip", type=Path)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=float, default=1.5, help="seconds between two disturbances, in the mean")
    parser.add_argument("--folder", type=Path, help="a new folder, which is kept [default: a temporary one]")
    options = parser.parse_args()
    os.environ["PATH"] += ":/usr/sbin"
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    if lacking or os.geteuid() != 0:
        why = f"no {', '.join(lacking)}" if lacking else "not root"
        if os.environ.get("GRIP_REQUIRE_SLURM"):
            sys.exit(f"GRIP_REQUIRE_SLURM is set but there is {why}")
        print(f"SKIPPED: {why}")
        return
    folder = options.folder or Path(tempfile.mkdtemp(prefix="grip-slurm-"))
    folder.mkdir(exist_ok=True)
    folder = folder.resolve()
    # What munge asks of the way to its socket.
    folder.chmod(0o755)
    cluster = None
    try:
        cluster = Cluster(folder)
        run(cluster, options.grip.resolve(), folder, options)
    finally:
        if cluster:
            cluster.stop()
        if not options.folder:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
