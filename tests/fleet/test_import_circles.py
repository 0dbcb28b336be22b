"""No import circles, and no folder without a layer; lint-imports checks the contracts of pyproject.toml."""

import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]


def test_no_modules_import_each_other_in_a_circle():
    graph = grimp.build_graph("fleet", "robots", "teleop", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    TopologicalSorter(imports).prepare()  # CycleError names the circle


def test_every_folder_with_code_has_a_layer():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = {one for line in contracts[0]["layers"] for one in line.split(" | ")}
    folders = {
        f"{root}.{module.parent.name}"
        for root in ("fleet", "robots", "teleop")
        for module in (ROOT / root).glob("*/*.py")
    }
    assert folders - layers == {"fleet.help", "teleop.migrations"}  # they import no other folder
