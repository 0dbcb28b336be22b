"""script/serve: the console for real robots, or one of its roles. Settings come from environment variables.

docs/deployment.md has the roles.
"""

from __future__ import annotations

import argparse
import ipaddress
import os
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from django.core.exceptions import ImproperlyConfigured

from fleet.base.environment import Environment, lichtblick
from robots.shared.processes.one_supervisor import LOCK, forget, supervised
from script.service.keeping import Kept, keep
from script.service.readiness import answers, run_directory, tell_systemd
from script.stack.places import REPOSITORY
from script.stack.processes import ChildDied, Ended, ended_by_signals, say
from script.stack.stack import Certificate, StartError, daphne, tls_endpoint

# The processes of each role.
ROLES = {"console": ("supervisor", "web"), "web": ("web",), "bridges": ("supervisor",)}
BRIDGE_HOST = "FLEET_BRIDGE_HOST"

THIS_MACHINE = "127.0.0.0/8,::1"  # proxies on it


def main() -> int:
    """Run the command, and return the exit status."""
    asked = arguments()
    if asked.lichtblick:
        os.environ["FLEET_LICHTBLICK"] = os.path.abspath(asked.lichtblick)
    os.chdir(REPOSITORY)
    os.environ["DJANGO_SETTINGS_MODULE"] = "fleet.settings"  # never others, such as the demo's with its door
    try:
        if asked.is_ready:
            return 0 if ready(asked, Environment(os.environ)) else 1
        with ended_by_signals():
            return serve(asked)
    except Ended:
        say("Ended.")
        return 0
    except (ImproperlyConfigured, StartError, ChildDied) as error:
        print(error, file=sys.stderr)
        return 1


def arguments(words: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="script/serve", description="The console for real robots.")
    parser.add_argument(
        "role",
        nargs="?",
        default="console",
        choices=ROLES,
        help="console: all (default); web: one of several web processes; bridges: the bridges of FLEET_BRIDGE_HOST",
    )
    parser.add_argument(
        "--bind", default="127.0.0.1", help="address to serve on (default: this machine only)"
    )
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument(
        "--behind-proxy",
        nargs="?",
        type=proxies,
        const="",
        metavar="ADDRESSES",
        help="serve proxies only, and believe their X-Forwarded headers: they must overwrite what browsers send. "
        "Addresses or networks, such as 10.0.0.5,10.1.0.0/16 (default: this machine)",
    )
    parser.add_argument("--certificate", type=Path, help="serve TLS with this PEM file; set FLEET_TLS=1 too")
    parser.add_argument("--private-key", type=Path)
    parser.add_argument("--authority", type=Path, help="the chain above the certificate")
    parser.add_argument(
        "--lichtblick",
        metavar="DIR",
        help="serve this build of Lichtblick at /lichtblick/, as FLEET_LICHTBLICK does",
    )
    parser.add_argument(
        "--migrate",
        action="store_true",
        help="also migrate PostgreSQL, or by the role web: you have a backup (docs/upgrade.md)",
    )
    parser.add_argument(
        "--is-ready",
        action="store_true",
        help="start nothing: the exit status tells whether this role, started with the same words, is ready",
    )
    asked = parser.parse_args(words)
    if asked.role == "bridges" and {**vars(asked), "is_ready": False} != vars(parser.parse_args(["bridges"])):
        parser.error("the role bridges takes no options: its settings are in the environment")
    if bool(asked.certificate) != bool(asked.private_key):
        parser.error("--certificate and --private-key go together")
    if asked.behind_proxy and asked.certificate:
        parser.error("--behind-proxy serves plain http: without --certificate")
    if asked.behind_proxy == THIS_MACHINE and not is_loopback(asked.bind):
        parser.error(
            f"--behind-proxy with --bind {asked.bind} needs the proxies' addresses: --behind-proxy 10.0.0.5"
        )
    return asked


def proxies(addresses: str) -> str:
    """Return the addresses of proxies and of this machine, for the web process. Raises ArgumentTypeError."""
    try:
        networks = [ipaddress.ip_network(one.strip()) for one in addresses.split(",") if one.strip()]
    except ValueError as error:
        raise argparse.ArgumentTypeError(error) from error
    if any(network.prefixlen == 0 for network in networks):
        raise argparse.ArgumentTypeError(f"{addresses} has all computers: anybody could invent an address")
    return ",".join([*map(str, networks), THIS_MACHINE])


def is_loopback(address: str) -> bool:
    """Return whether only this computer can connect to the address."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def serve(asked: argparse.Namespace) -> int:
    """Run the role until a signal comes. Check the settings before anything starts."""
    env = Environment(os.environ)
    names = ROLES[asked.role]
    lichtblick(env)
    if "web" in names:
        require_matching_tls(asked, env)
        require_certificate(asked)
        require_free_port(asked)
    commands = {"supervisor": supervisor_command(asked, env), "web": web_command(asked)}
    for command in preparation(asked):
        done = subprocess.run([sys.executable, "manage.py", *command], check=False)  # noqa: S603
        if done.returncode:
            return done.returncode
    if "supervisor" not in names:  # alerts would miss the one of an earlier role
        forget(run_directory() / LOCK)
    keep([Kept(name, commands[name]) for name in names], lambda: ready(asked, env), lambda: introduce(asked))


def preparation(asked: argparse.Namespace) -> Iterator[list[str]]:
    """Yield the commands of manage.py before the start. Only a console migrates unasked: others share its database."""
    if asked.role == "bridges":
        yield ["check"]
    else:
        yield ["collectstatic", "--no-input", "-v", "0"]  # first, because the check needs its result
        yield ["check", "--deploy"]
    how = ["--migrate"] if asked.migrate else [] if asked.role == "console" else ["--check"]
    if "NOTIFY_SOCKET" in os.environ:  # a service: systemd gives up after a few starts
        how.append("--wait")
    yield ["upgrade", *how]


def ready(asked: argparse.Namespace, env: Environment) -> bool:
    """Return whether the processes of the role do their work."""
    names = ROLES[asked.role]
    return ("supervisor" not in names or supervised(run_directory() / LOCK)) and (
        "web" not in names or answers(asked.bind, asked.port, host_names(env)[0], tls=bool(asked.certificate))
    )


def introduce(asked: argparse.Namespace) -> None:
    """Say that the role is ready, and tell systemd last: then all that people need is in its log."""
    if asked.role == "bridges":
        status = f"The supervisor runs the bridges of {os.environ[BRIDGE_HOST]}."
    else:
        status = f"Serving on {asked.bind}:{asked.port}."
    say(f"{status} Ctrl-C or SIGTERM ends it.")
    if asked.role != "bridges":
        invite(asked)
    tell_systemd(status)


def invite(asked: argparse.Namespace) -> None:
    """Print the address of the first-run page and its one-time code, while nobody has an account."""
    made = subprocess.run(
        [sys.executable, "manage.py", "setup_code"], check=False, stdout=subprocess.PIPE, text=True
    )
    if code := made.stdout.strip():
        say(f"Nobody has an account yet. Set the console up at {setup_address(asked)}")
        say(f"One-time code: {code}")


def setup_address(asked: argparse.Namespace) -> str:
    """Return the address of the first-run page, with a host name that the console accepts."""
    names = host_names(Environment(os.environ))
    is_near = is_loopback(asked.bind) and not asked.behind_proxy
    host = next((name for name in names if is_loopback(name) == is_near), names[0])
    if asked.behind_proxy:
        return f"https://{host}/setup/"
    return f"http{'s' if asked.certificate else ''}://{host}:{asked.port}/setup/"


def host_names(env: Environment) -> list[str]:
    """Return the names under which the console is reached."""
    return env.names("FLEET_HOSTS") or ["localhost"]


def require_matching_tls(asked: argparse.Namespace, env: Environment) -> None:
    """Raise StartError if FLEET_TLS does not fit the options."""
    ends_tls = bool(asked.certificate or asked.behind_proxy)
    if env.flag("FLEET_TLS") and not ends_tls:
        raise StartError(
            "FLEET_TLS is on, but nothing ends TLS, so nobody could sign in: give --certificate and --private-key, "
            "or --behind-proxy if a proxy ends it."
        )
    if asked.certificate and not env.flag("FLEET_TLS"):
        raise StartError("--certificate serves TLS: set FLEET_TLS=1, so that cookies never leave it.")


def require_certificate(asked: argparse.Namespace) -> None:
    """Raise StartError if certificate and key cannot be read, or do not belong together."""
    if not asked.certificate:
        return
    try:
        # Give an empty password: otherwise OpenSSL would ask for it in the terminal, which a service does not have.
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(
            asked.certificate, asked.private_key, password=lambda: b""
        )
        if asked.authority:
            ssl.create_default_context(cafile=asked.authority)
    except OSError as error:
        raise StartError(f"The certificate or its key cannot be used: {error}.") from error


def require_free_port(asked: argparse.Namespace) -> None:
    """Raise StartError if the port is taken. Daphne would report this only after the bridges have started."""
    family = socket.AF_INET6 if ":" in asked.bind else socket.AF_INET
    try:
        socket.create_server((asked.bind, asked.port), family=family).close()
    except OSError as error:
        raise StartError(f"Cannot listen on {asked.bind}, port {asked.port}: {error.strerror}.") from error


def supervisor_command(asked: argparse.Namespace, env: Environment) -> list[str]:
    """Return the command of the fleet supervisor: on a bridge host, for the robots with that bridge address."""
    command = [sys.executable, "manage.py", "run_fleet"]
    if asked.role != "bridges":
        return command
    why = "It is the name of this computer in the robots' bridge addresses, such as arm.lab.example."
    return [*command, "--host", env.required(BRIDGE_HOST, why)]


def web_command(asked: argparse.Namespace) -> list[str]:
    """Return the command of the web process, with addresses and trusted proxies."""
    if asked.certificate:
        certificate = Certificate(asked.certificate, asked.private_key, asked.authority)
        return [*daphne(), "--endpoint", tls_endpoint(certificate, asked.bind, asked.port)]
    believed = ["--proxy-headers", "--proxies", asked.behind_proxy] if asked.behind_proxy else []
    return [*daphne(), *believed, "--bind", asked.bind, "--port", str(asked.port)]


if __name__ == "__main__":
    sys.exit(main())
