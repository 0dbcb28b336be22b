"""REST: a robot's description and its meshes. The console sends no other files than these meshes."""

from __future__ import annotations

import pytest

from robots.bridge.audit.description import taken_description
from robots.records.bridge_records import AuditSink

pytestmark = pytest.mark.django_db(transaction=True)

MESH = b"solid base\nendsolid base\n"


def urdf(*addresses: str) -> str:
    shapes = "".join(
        f'<visual><geometry><mesh filename="{address}"/></geometry></visual>' for address in addresses
    )
    return f'<robot name="r"><link name="base">{shapes}</link></robot>'


@pytest.fixture
def describe(robot):
    """`describe(text)`: store the parameter's value as the robot's bridge does."""
    return lambda found: AuditSink(robot.pk, robot.name).keep_description(taken_description(found))


@pytest.fixture
def share(settings, tmp_path):
    """The folder of ROS packages, with the package `arm_description` and with files that nobody may read."""
    meshes = tmp_path / "share/arm_description/meshes"
    meshes.mkdir(parents=True)
    (meshes / "base.stl").write_bytes(MESH)
    (tmp_path / "share/arm_description/package.xml").write_text("secret")
    (tmp_path / "share/secret.stl").write_bytes(b"secret")
    (tmp_path / "secret.stl").write_bytes(b"secret")
    settings.FLEET_MESHES = [tmp_path / "share"]
    return tmp_path / "share"


@pytest.fixture
def ask(program, observer):
    """`ask(path)`: the answer to an observer's program."""
    caller = program(observer, "read")
    return lambda path, **headers: caller.stream("GET", f"/robots/tiago-1/{path}", **headers)


def mesh_of(ask):
    (entry,) = ask("description").json()["meshes"]
    return entry


def test_without_a_description_the_answer_says_so(ask, robot):
    answer = ask("description")
    assert (answer.status_code, answer.json()["code"]) == (404, "not_found")
    assert "knows no description" in answer.json()["detail"]


def test_an_observer_reads_description_and_mesh(ask, robot, describe, share):
    describe(urdf("package://arm_description/meshes/base.stl"))
    found = ask("description").json()
    assert "<robot" in found["urdf"]
    (entry,) = found["meshes"]
    assert (entry["filename"], entry["problem"]) == ("package://arm_description/meshes/base.stl", "")
    answer = ask(entry["address"].removeprefix("/api/v1/robots/tiago-1/"))
    assert (answer.content, answer["Content-Type"]) == (MESH, "application/octet-stream")
    assert "immutable" in answer["Cache-Control"]


def test_a_mesh_is_fetched_once(ask, robot, describe, share):
    describe(urdf("package://arm_description/meshes/base.stl"))
    path = "meshes/arm_description/meshes/base.stl"
    first = ask(path)
    # The file behind an address without a version may change
    assert first["Cache-Control"] == "private, no-cache"
    assert ask(path, If_None_Match=first["ETag"]).status_code == 304
    (share / "arm_description/meshes/base.stl").write_bytes(MESH + b"\n")
    assert ask(path, If_None_Match=first["ETag"]).status_code == 200


def test_a_description_is_sent_again_only_when_it_or_a_mesh_changed(ask, robot, describe, share):
    describe(urdf("package://arm_description/meshes/base.stl"))
    tags = []

    def same():
        """Whether the newest answer counts as unchanged."""
        unchanged = ask("description", If_None_Match=tags[-1] if tags else '"0"')
        tags.append(unchanged["ETag"])
        return (unchanged.status_code, unchanged.content) == (304, b"")

    assert [same(), same(), same()] == [False, True, True]
    tags[-1] = f"W/{tags[-1]}"  # as changed by a proxy that compresses
    assert same()
    assert ask("description")["Cache-Control"] == "private, no-cache"
    (share / "arm_description/meshes/base.stl").write_bytes(MESH + b"\n")
    assert [same(), same()] == [False, True]
    describe(urdf())
    assert [same(), same()] == [False, True]


def test_a_robot_that_one_may_not_see_has_no_description(program, observer, other_robot, describe):
    assert program(observer, "read")("GET", f"/robots/{other_robot.slug}/description").status_code == 404


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("package://arm_description/../secret.stl", "leads out of its package"),
        ("package://arm_description/meshes/../../../secret.stl", "leads out of its package"),
        ("package://arm_description//etc/passwd.stl", "leads out of its package"),
        ("package://arm_description/./meshes/base.stl", "leads out of its package"),
        ("package://arm_description/meshes\\base.stl", "leads out of its package"),
        ("package://../secret.stl", "names no package"),
        ("package:///secret.stl", "names no package"),
        ("file:///etc/passwd.stl", "lies in no package"),
        ("file:///opt/arm_description/../secret.stl", "lies in no package"),
        ("/etc/passwd.stl", "is no address of a package"),
        ("http://elsewhere/base.stl", "is no address of a package"),
        ("meshes/base.stl", "is no address of a package"),
        ("package://arm_description/meshes/base.step", "neither STL nor Collada nor OBJ"),
        ("package://arm_description/meshes/lost.stl", "is not on the console’s computer"),
        ("package://lost_description/meshes/base.stl", "is not on the console’s computer"),
    ],
)
def test_an_address_that_leads_elsewhere_is_named_and_leads_nowhere(
    ask, robot, describe, share, address, why
):
    describe(urdf(address))
    entry = mesh_of(ask)
    assert entry["address"] is None
    assert why in entry["problem"]


@pytest.mark.parametrize(
    "path",
    [
        "meshes/arm_description/../secret.stl",
        "meshes/arm_description/%2e%2e/secret.stl",
        "meshes/arm_description/meshes/%2e%2e/%2e%2e/secret.stl",
        "meshes/../secret.stl",
        "meshes/arm_description//etc/passwd",
        "meshes/arm_description/package.xml",
        "meshes/arm_description/meshes/other.stl",
    ],
)
def test_only_meshes_of_the_description_are_served(ask, robot, describe, share, path):
    (share / "arm_description/meshes/other.stl").write_bytes(b"secret")
    describe(urdf("package://arm_description/meshes/base.stl", "package://arm_description/../secret.stl"))
    answer = ask(path)
    assert answer.status_code == 404
    assert b"secret" not in answer.content


def test_a_link_that_leads_out_of_the_package_is_not_followed(ask, robot, describe, share):
    (share / "arm_description/meshes/out.stl").symlink_to(share.parent / "secret.stl")
    describe(urdf("package://arm_description/meshes/out.stl"))
    assert "leads out of its package" in mesh_of(ask)["problem"]
    assert ask("meshes/arm_description/meshes/out.stl").status_code == 404


def test_a_huge_mesh_is_named(ask, robot, describe, share):
    with (share / "arm_description/meshes/huge.stl").open("wb") as file:
        file.truncate(30_000_000)
    describe(urdf("package://arm_description/meshes/huge.stl"))
    assert "has 30 MB; at most 25 are drawn" in mesh_of(ask)["problem"]


def test_the_robots_own_path_to_a_package_is_the_one_here(ask, robot, describe, share):
    describe(urdf("file:///opt/pal/lib/share/arm_description/meshes/base.stl"))
    assert mesh_of(ask)["address"].startswith(
        "/api/v1/robots/tiago-1/meshes/arm_description/meshes/base.stl?"
    )


def test_what_is_left_out_carries_key_and_figures(ask, robot, describe):
    describe(
        "<robot><link name='base'/><joint name='b' type='magic'><parent link='base'/><child link='x'/></joint></robot>"
    )
    found = ask("description").json()
    assert found["problems"] == ["joint 'b': the type 'magic' is not known: x is left out"]
    why = [
        "joint {name}: {misfit}",
        {"name": "'b'", "misfit": ["the type {kind} is not known", {"kind": "'magic'"}]},
    ]
    assert found["said"] == {"problems": [["{why}: {link} is left out", {"why": why, "link": "x"}]]}
    describe(urdf("package://nothing/x.stl"))
    mesh = ["“{mesh}” is not on the console’s computer", {"mesh": "package://nothing/x.stl"}]
    assert mesh_of(ask)["said"] == {"problem": ["{why}.", {"why": mesh}]}


@pytest.mark.parametrize(
    ("found", "why"),
    [
        ("x" * 20_000_000, "too large"),
        ({"a": 1}, "is not a text"),
        ("<robot>", "cannot be parsed"),
        ('<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot>&a;</robot>', "declarations"),
    ],
)
def test_a_description_that_cannot_be_drawn_says_why(ask, robot, describe, found, why):
    describe(found)
    answer = ask("description")
    assert (answer.status_code, answer.json()["code"]) == (409, "bad_description")
    assert why in answer.json()["detail"]
    assert ask("meshes/arm_description/meshes/base.stl").status_code == 409
