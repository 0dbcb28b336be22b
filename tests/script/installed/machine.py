"""An empty Debian 12, booted with systemd in namespaces of this computer; it shares this computer's network."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from benchmarks.parts.process_stats import children
from script.stack.places import REPOSITORY, locked
from tests.processes import until

BASE = REPOSITORY / "var" / "empty-debian"  # made once, below all machines
# Not in every Debian: systemd, which a computer has, and what README.md asks for.
FIRST = "systemd,systemd-sysv,dbus,sudo,git,ca-certificates"
TRUSTED = "/etc/ssl/certs/ca-certificates.crt"  # a lab's own authorities, too
ENVIRONMENT = {
    "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
    "HOME": "/root",
    "LANG": "C.UTF-8",
    **dict.fromkeys(("PIP_CERT", "SSL_CERT_FILE", "NODE_EXTRA_CA_CERTS"), TRUSTED),
}
USUAL = 0o022  # umask of an administrator
BOOTED_S = 60.0
INSTALLED_S = 1200.0  # packages come over the network
NEEDED = ("mmdebstrap", "systemd-nspawn", "nsenter")


def missing(*more: str) -> str:
    """Return why no machine can be made here; "" if it can."""
    programs = [name for name in (*NEEDED, *more) if shutil.which(name) is None]
    if programs:
        return f"not installed: {', '.join(programs)}"
    return "" if os.getuid() == 0 else "only root boots machines"


class Machine:
    """A booted machine. `root` is its file system, `leader` the process id of its systemd here."""

    def __init__(self, root: Path, leader: int) -> None:
        self.root = root
        self.leader = leader

    def run(self, *words: str, check: bool = True, cwd: str = "/") -> str:
        """Run a command as root, and return what it prints, errors too."""
        inside = ["--chdir", cwd, *(f"{name}={value}" for name, value in ENVIRONMENT.items())]
        done = subprocess.run(
            ["nsenter", "-t", str(self.leader), "-a", "env", "-i", *inside, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=INSTALLED_S,
            umask=USUAL,
        )
        if check and done.returncode:
            raise AssertionError(f"{' '.join(words)} ended with {done.returncode}:\n{done.stdout}")
        return done.stdout

    def shell(self, line: str, *, check: bool = True) -> str:
        """Run a line of an administrator's shell in the folder of the console."""
        return self.run("bash", "-c", line, check=check, cwd="/opt/fleet")

    def clone(self, revision: str) -> None:
        """Clone the console in this revision of this repository; what is not committed does not come along."""
        with tempfile.TemporaryDirectory(dir=self.root / "mnt") as place:
            bare = Path(place) / "fleet.git"
            subprocess.run(["git", "clone", "--quiet", "--bare", REPOSITORY, bare], check=True)
            self.run("git", "clone", "--quiet", f"file:///{bare.relative_to(self.root)}", "/opt/fleet")
        self.checkout(revision)

    def checkout(self, revision: str) -> None:
        """Change the clone to this revision."""
        wanted = subprocess.run(
            ["git", "rev-parse", revision], cwd=REPOSITORY, capture_output=True, text=True, check=True
        ).stdout.strip()
        self.run("git", "-C", "/opt/fleet", "checkout", "--quiet", wanted)

    def log(self, unit: str) -> str:
        """Return the journal of a unit, without times."""
        return self.run("journalctl", "--unit", unit, "--no-pager", "--output", "cat")


@contextmanager
def empty_machine() -> Iterator[Machine]:
    """Boot a machine whose changes go to a temporary directory."""
    base = empty_root()
    directory = Path(tempfile.mkdtemp(prefix="fleet-machine-", dir="/var/tmp"))
    upper, work, root = (directory / name for name in ("upper", "work", "root"))
    for each in (upper, work, root):
        each.mkdir()
        each.chmod(0o755)  # the console's settings keep new folders to their owner
    layers = f"lowerdir={base},upperdir={upper},workdir={work}"
    subprocess.run(["mount", "-t", "overlay", "overlay", "-o", layers, root], check=True)
    try:
        shutil.copy(TRUSTED, root / TRUSTED.lstrip("/"))
        with _booted(root, directory / "console") as leader:
            yield Machine(root, leader)
    finally:
        subprocess.run(["umount", root], check=True)
        shutil.rmtree(directory)


def empty_root() -> Path:
    """Return the file system of an empty Debian 12; it is made once, from the mirror of this computer."""
    root = BASE / "root"
    with locked(BASE / "lock"):
        if not (BASE / "made").exists():
            shutil.rmtree(root, ignore_errors=True)
            command = ["mmdebstrap", "--quiet", "--variant=minbase", f"--include={FIRST}", "bookworm"]
            subprocess.run([*command, root, *_sources()], check=True, umask=USUAL)
            (BASE / "made").touch()
    return root


def _sources() -> list[str]:
    """Return the mirror of Debian that apt uses here."""
    listed = [*Path("/etc/apt").glob("sources.list"), *Path("/etc/apt/sources.list.d").glob("debian.sources")]
    return [str(file) for file in listed if re.search(r"^[^#]*bookworm", file.read_text(), re.MULTILINE)]


@contextmanager
def _booted(root: Path, console: Path) -> Iterator[int]:
    """Boot; yield the process id of the machine's systemd."""
    options = ["--boot", "--register=no", "--keep-unit", "--resolv-conf=copy-host", "--console=pipe"]
    with console.open("wb") as output:
        nspawn = subprocess.Popen(
            [
                "systemd-nspawn",
                "--quiet",
                "-D",
                root,
                f"--machine={root.parent.name.replace('_', 'x')}",
                *options,
            ],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
        )
    try:
        leader = until(lambda: _systemd_of(nspawn.pid) or nspawn.poll(), "the machine starts", BOOTED_S)
        assert nspawn.poll() is None, console.read_text(errors="replace")
        machine = Machine(root, leader)
        state = ("systemctl", "is-system-running")
        until(
            lambda: machine.run(*state, check=False).strip() in ("running", "degraded"),
            "it is booted",
            BOOTED_S,
        )
        yield leader
    finally:
        nspawn.send_signal(signal.SIGTERM)
        try:
            nspawn.wait(BOOTED_S)
        except subprocess.TimeoutExpired:
            nspawn.kill()
            nspawn.wait()


def _systemd_of(nspawn: int) -> int | None:
    """Return the process id of the machine's systemd here, once it runs."""
    for child in children(nspawn):
        with suppress(FileNotFoundError):
            if Path(f"/proc/{child}/comm").read_text() == "systemd\n":
                return child
    return None
