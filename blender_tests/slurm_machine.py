# SPDX-License-Identifier: GPL-3.0-or-later
"""Slurm on this one machine, for a test: daemons of our own in a folder, on ports of their own."""

import os
import pwd
import shutil
import socket
import subprocess
import time

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "sinfo", "squeue")
_PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


class CannotRun(Exception):
    """Why there is no Slurm here."""


def is_required():
    """Whether a machine that cannot run it fails the test: where MATTERFIT_REQUIRE_SLURM says so, but
    not where there is no network at all, for lack of which its daemons never come up."""
    networks = [name for _index, name in socket.if_nameindex() if name != "lo"]
    return bool(os.environ.get("MATTERFIT_REQUIRE_SLURM") and networks)


def _user():
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError as error:
        raise CannotRun("this user has no name") from error


def _free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Machine:
    """`with Machine(folder) as slurm: slurm.run("sbatch", …)`. CannotRun where that is so."""

    def __init__(self, folder):
        self.folder = folder
        self._processes = []
        self._environment = {**os.environ, "PATH": _PATH,
                             "SLURM_CONF": os.path.join(folder, "slurm.conf")}

    def __enter__(self):
        missing = [name for name in PROGRAMS if shutil.which(name, path=_PATH) is None]
        if missing:
            raise CannotRun(f"no {', '.join(missing)} (Debian's slurm-wlm)")
        try:
            self._start()
        except Exception:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def run(self, *command, timeout=240):
        """The finished process of one of Slurm's programs."""
        return subprocess.run(command, env=self._environment, capture_output=True, text=True,
                              timeout=timeout, check=False, cwd=self.folder)

    def _start(self):
        for name in ("state", "spool"):
            os.makedirs(os.path.join(self.folder, name))
        host, user = socket.gethostname(), _user()
        with open(self._environment["SLURM_CONF"], "w", encoding="ascii") as stream:
            stream.write("\n".join((
                "ClusterName=test", f"SlurmctldHost={host}(127.0.0.1)", f"SlurmUser={user}",
                f"SlurmdUser={user}", "AuthType=auth/none", "CredType=cred/none",
                f"SlurmctldPort={_free_port()}", f"SlurmdPort={_free_port()}",
                f"StateSaveLocation={self.folder}/state", f"SlurmdSpoolDir={self.folder}/spool",
                f"SlurmctldPidFile={self.folder}/ctld.pid", f"SlurmdPidFile={self.folder}/d.pid",
                f"SlurmctldLogFile={self.folder}/ctld.log", f"SlurmdLogFile={self.folder}/d.log",
                "ProctrackType=proctrack/pgid", "TaskPlugin=task/none", "SwitchType=switch/none",
                "MpiDefault=none", "ReturnToService=2", "SelectType=select/cons_res",
                "SelectTypeParameters=CR_CPU", "JobAcctGatherType=jobacct_gather/none",
                "AccountingStorageType=accounting_storage/none",
                f"NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN",
                f"PartitionName=all Nodes={host} Default=YES State=UP MaxTime=INFINITE", "")))
        # No job is put into a control group; left to find the version itself, slurmd does not start in
        # a container where none is mounted, or where systemd does not run.
        with open(os.path.join(self.folder, "cgroup.conf"), "w", encoding="ascii") as stream:
            stream.write("CgroupPlugin=cgroup/v1\n")
        for program in ("slurmctld", "slurmd"):
            log = open(os.path.join(self.folder, program + ".out"), "wb")
            self._processes.append(subprocess.Popen(
                [shutil.which(program, path=_PATH), "-D"], env=self._environment, stdout=log,
                stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True))
            log.close()
        end = time.monotonic() + 60.0
        while "idle" not in self.run("sinfo", "-h", "-o", "%T").stdout:
            if time.monotonic() > end or any(item.poll() is not None for item in self._processes):
                raise CannotRun("its daemons do not come up here: " + self._logs())
            time.sleep(0.5)

    def _logs(self):
        texts = []
        for name in ("slurmctld.out", "slurmd.out"):
            with open(os.path.join(self.folder, name), encoding="utf-8", errors="replace") as stream:
                texts.append(stream.read()[-300:].strip())
        return " / ".join(texts)
