"""Generate the packages of messages that have definitions here and no wheel: `script/setup ros2` calls it.

Done at once if the packages of these definitions, of these wheels and of this Python exist already.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from robots.shared.ros2.environment import (
    MESSAGES,
    READY,
    ROOT,
    VERSION,
    WHEELS,
    ros_environment,
    site_packages,
)

DEFINITIONS = ROOT / "robots" / "shared" / "ros2" / "definitions"
FIELD = re.compile(r"^([a-z][a-z0-9_]*)/[A-Z]", re.MULTILINE)  # the package of a field's type
AT_ONCE = 2  # packages; each compiler needs up to 200 MB

PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name><version>0.0.0</version><description>Generated</description>
  <maintainer email="nobody@example.org">nobody</maintainer><license>None</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  {depends}
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""

# The wheels' targets name an include folder of the computer that built them: CMake refuses a folder that is missing.
CMAKE = """cmake_minimum_required(VERSION 3.20)
project({name} C CXX)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
foreach(package {depends})
  find_package(${{package}} REQUIRED)
endforeach()
get_directory_property(targets IMPORTED_TARGETS)
foreach(target ${{targets}})
  get_target_property(folders ${{target}} INTERFACE_INCLUDE_DIRECTORIES)
  if(folders)
    list(FILTER folders EXCLUDE REGEX "^/opt/python/")
    set_property(TARGET ${{target}} PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${{folders}}")
  endif()
endforeach()
rosidl_generate_interfaces({name} {files} DEPENDENCIES {depends})
ament_package()
"""


def files_of(package: Path) -> list[Path]:
    """Return the definitions of a package: messages, services, actions."""
    return sorted(path for path in package.glob("*/*") if path.suffix in {".msg", ".srv", ".action"})


def depends_of(package: Path) -> list[str]:
    """Return the packages whose types the fields of a package have."""
    found = {name for path in files_of(package) for name in FIELD.findall(path.read_text())}
    if any(path.suffix == ".action" for path in files_of(package)):
        found.add("action_msgs")
    return sorted(found - {package.name})


def digest() -> str:
    """Return the digest of everything that the generated packages depend on."""
    sources = [Path(__file__), ROOT / "requirements" / "ros2.txt"]
    sources += [path for package in DEFINITIONS.iterdir() for path in files_of(package)]
    taken = hashlib.sha256(f"{VERSION} {os.uname().machine}".encode())
    for path in sorted(sources):
        taken.update(f"\0{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return taken.hexdigest()


def build(package: Path, work: Path, prefix: Path) -> None:
    """Generate, compile and install one package into `prefix`."""
    source, depends = work / package.name, depends_of(package)
    shutil.copytree(package, source)
    files = [str(path.relative_to(package)) for path in files_of(package)]
    (source / "package.xml").write_text(
        PACKAGE.format(name=package.name, depends="".join(f"<depend>{each}</depend>" for each in depends))
    )
    (source / "CMakeLists.txt").write_text(
        CMAKE.format(name=package.name, files=" ".join(files), depends=" ".join(depends))
    )
    variables = ros_environment([prefix, WHEELS], {})
    environment = os.environ | variables | {"CMAKE_PREFIX_PATH": variables["AMENT_PREFIX_PATH"]}
    environment["PYTHONPATH"] = str(site_packages(WHEELS))
    cmake, made = str(WHEELS / "bin" / "cmake"), str(source / "build")
    flags = {
        "CMAKE_INSTALL_PREFIX": prefix,
        "CMAKE_C_FLAGS": "-O0",
        "CMAKE_CXX_FLAGS": "-O0",
        "BUILD_TESTING": "OFF",
        "Python3_EXECUTABLE": WHEELS / "bin" / "python",
    }
    for command in (
        [cmake, "-S", str(source), "-B", made, *(f"-D{name}={value}" for name, value in flags.items())],
        [cmake, "--build", made],
        [cmake, "--install", made],
    ):
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
        if run.returncode:
            raise SystemExit(
                f"{package.name}: {' '.join(command[:2])} failed\n{run.stdout[-3000:]}{run.stderr[-3000:]}"
            )


def build_all(work: Path, prefix: Path) -> None:
    """Build all packages, each after those that it needs."""
    packages = {path.name: path for path in DEFINITIONS.iterdir() if path.is_dir()}
    done: dict[str, Future[None]] = {}

    with ThreadPoolExecutor(AT_ONCE) as pool:
        # A package is queued after those that it needs, and the pool takes them in turn: no wait is for ever.
        def queue(name: str) -> None:
            if name in done:
                return
            needed = [each for each in depends_of(packages[name]) if each in packages]
            for each in needed:
                queue(each)
            before = [done[each] for each in needed]

            def make() -> None:
                for each in before:
                    each.result()
                build(packages[name], work, prefix)

            done[name] = pool.submit(make)

        for name in sorted(packages):
            queue(name)
        for each in done.values():
            each.result()


def main() -> None:
    """Generate what is missing; with --check only fail if something is."""
    wanted = digest()
    if READY.exists() and READY.read_text() == wanted:
        return
    if "--check" in sys.argv:
        sys.exit(1)
    sys.stderr.write("Generating packages of messages for ROS 2\n")
    shutil.rmtree(MESSAGES, ignore_errors=True)
    with tempfile.TemporaryDirectory() as work:
        build_all(Path(work), MESSAGES)
    READY.write_text(wanted)


if __name__ == "__main__":
    main()
