"""The robot for other programs: groups and pairs of the SRDF, the tree of the MJCF, and the command."""

from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import pinocchio as pin
import pytest

from sms_handover.clearance.allowed_pairs import counted_pairs
from sms_handover.clearance.solids import read_solids
from sms_handover.cli.main import main
from sms_handover.errors import RobotDescriptionError
from sms_handover.export.robot_files import MJCF_FILE, SRDF_FILE, URDF_FILE, robot_files
from sms_handover.model.mjcf import to_mjcf
from sms_handover.model.robot_model import RobotModel
from sms_handover.model.shapes import ContactPairs
from sms_handover.model.urdf_tree import read_urdf

from .bag_messages import made_up_run
from .report_bags import write_bag


@pytest.fixture(scope="module")
def texts(robot: RobotModel) -> dict[str, str]:
    return dict(robot_files(robot.urdf).texts)


def test_pinocchio_drops_the_pairs_that_clearance_does_not_count(
    robot: RobotModel, texts: dict[str, str]
) -> None:
    """Pinocchio's own reader of SRDF leaves exactly the pairs that clearance counts."""
    solids = read_solids(robot.pin, robot.urdf)
    counted = set(counted_pairs(robot.pin, solids, ContactPairs()))
    links = [item.parentFrame for item in solids.geometryObjects]
    every = [(a, b) for a, b in combinations(range(solids.ngeoms), 2) if links[a] != links[b]]
    for pair in every:
        solids.addCollisionPair(pin.CollisionPair(*pair))
    pin.removeCollisionPairsFromXML(robot.pin, solids, texts[SRDF_FILE])
    left = {(int(pair.first), int(pair.second)) for pair in solids.collisionPairs}
    assert left == counted and 0 < len(left) < len(every)


def test_groups_are_chains_of_the_arms(robot: RobotModel, texts: dict[str, str]) -> None:
    """Every joint of an arm is in its group, no link in two; ``both`` has the two; ends are grippers."""
    root, tree = ET.fromstring(texts[SRDF_FILE]), read_urdf(robot.urdf)
    groups = {group.get("name", ""): group for group in root.findall("group")}
    assert list(groups) == ["arm_a", "arm_a_end", "arm_b", "arm_b_end", "both"]
    for arm in robot.arms:
        chain = groups[arm].find("chain")
        assert chain is not None
        up = list(tree.chain(chain.get("tip_link", "")))
        bases = [joint.parent for joint in up]
        moved = up[: bases.index(chain.get("base_link", "")) + 1]
        assert [joint.name for joint in reversed(moved)] == list(robot.joint_names[robot.arm_joints[arm]])
        end = [link.get("name") for link in groups[f"{arm}_end"]]
        assert end == [f"{arm}_gripper", f"{arm}_tool"]
    assert [group.get("name") for group in groups["both"]] == list(robot.arms)
    ends = [
        (end.get("group"), end.get("parent_group"), end.get("parent_link"))
        for end in root.iter("end_effector")
    ]
    assert ends == [(f"{arm}_end", arm, f"{arm}_link_7") for arm in robot.arms]
    reasons = {(p.get("link1"), p.get("link2")): p.get("reason") for p in root.iter("disable_collisions")}
    assert reasons["base_link", "arm_a_mount"] == reasons["arm_a_link_6", "arm_a_link_7"] == "Adjacent"
    assert reasons["arm_a_mount", "arm_b_mount"] == "Never"


def renamed(urdf: str, *arms: str) -> str:
    """Return the description with its arms renamed, and what follows of a third dropped or added."""
    root = ET.fromstring(urdf)
    if len(arms) == 1:
        for element in [*root.findall("link"), *root.findall("joint")]:
            if element.get("name", "").startswith("arm_b"):
                root.remove(element)
    for element in list(root) if len(arms) > 2 else ():
        if element.get("name", "").startswith("arm_b"):
            text = ET.tostring(element, encoding="unicode").replace("arm_b", "arm_c")
            root.append(ET.fromstring(text))
    return ET.tostring(root, encoding="unicode")


@pytest.mark.parametrize(("arms", "whole"), [(("arm_a",), None), (("arm_a", "arm_b", "arm_c"), "all")])
def test_there_may_be_any_number_of_arms(robot: RobotModel, arms: tuple[str, ...], whole: str | None) -> None:
    root = ET.fromstring(robot_files(renamed(robot.urdf, *arms)).texts[SRDF_FILE])
    names = [group.get("name") for group in root.findall("group")]
    expected = [name for arm in arms for name in (arm, f"{arm}_end")]
    assert names == expected + ([whole] if whole else [])


def test_pairs_that_always_touch_are_said_to(robot: RobotModel) -> None:
    """A ball of 0.3 m about the gripper has link 6 in it, 0.06 m away, whatever the joints do."""
    root = ET.fromstring(robot.urdf)
    (gripper,) = [link for link in root.findall("link") if link.get("name") == "arm_a_gripper"]
    gripper.append(ET.fromstring('<collision><geometry><sphere radius="0.3"/></geometry></collision>'))
    found = ET.fromstring(robot_files(ET.tostring(root, encoding="unicode")).texts[SRDF_FILE])
    always = [p for p in found.iter("disable_collisions") if p.get("reason") == "Always"]
    assert ("arm_a_link_6", "arm_a_gripper") in [(p.get("link1"), p.get("link2")) for p in always]


def test_a_pair_that_the_description_allows_is_the_user_s(robot: RobotModel) -> None:
    stated = '<sms_handover><allow first="arm_a_gripper" second="arm_b_gripper"/></sms_handover></robot>'
    found = ET.fromstring(robot_files(robot.urdf.replace("</robot>", stated)).texts[SRDF_FILE])
    reasons = {(p.get("link1"), p.get("link2")): p.get("reason") for p in found.iter("disable_collisions")}
    assert reasons["arm_a_gripper", "arm_b_gripper"] == "User"


def test_a_rotor_inertia_is_in_the_mjcf_alone(robot: RobotModel) -> None:
    root = ET.fromstring(to_mjcf(robot.urdf, {"arm_a_joint_3": 0.25}))
    armature = {joint.get("name"): float(joint.get("armature", "nan")) for joint in root.iter("joint")}
    assert armature["arm_a_joint_3"] == 0.25 and sum(armature.values()) == 0.25
    assert [motor.get("joint") for motor in root.iter("motor")] == list(robot.joint_names)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</robot>", "", "the robot description cannot be read: "),
        ('type="revolute"', 'type="planar"', "'arm_a_joint_1' is of type 'planar', must be fixed, revolute"),
        ('parent link="arm_a_link_3"', 'parent link="x"', "joint 'arm_a_joint_4': there is no link 'x'"),
        ('parent link="base_link"', 'parent link="arm_a_tool"', "must be one tree with one root"),
        ('child link="arm_a_link_4"', 'child link="arm_b_link_4"', "must be one tree with one root"),
        ('xyz="0.5 0.3 0.0"', 'xyz="0.5 0.3"', "'0.5 0.3' must be three numbers"),
        ('mass value="240.0"', "mass", "mass value is None, must be a number"),
    ],
)
def test_a_text_that_is_no_robot_is_an_error(old: str, new: str, message: str, robot: RobotModel) -> None:
    assert old in robot.urdf
    with pytest.raises(RobotDescriptionError, match=message):
        read_urdf(robot.urdf.replace(old, new, 1))


def test_a_robot_without_arms_has_no_groups(robot: RobotModel) -> None:
    with pytest.raises(
        RobotDescriptionError, match="no link's name ends in '_tool', so the robot has no arm"
    ):
        robot_files(robot.urdf.replace("_tool", "_end"))


def test_the_command_writes_the_files_once(
    robot: RobotModel, texts: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_bag(tmp_path / "bag", made_up_run(ticks=3), urdf=robot.urdf, schedule=None, values=None)
    bare = write_bag(tmp_path / "bare", made_up_run(ticks=3), urdf=None, schedule=None, values=None)
    (tmp_path / "given.urdf").write_text(robot.urdf, encoding="utf-8")
    (tmp_path / "latin.urdf").write_bytes(b"\xe9")
    for source in (bag, tmp_path / "given.urdf", "config/robot.yaml"):
        arguments = ["bag", "robot", str(source), "-o", str(tmp_path / "out")]
        assert main([*arguments, "--overwrite"]) == 0
        found = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "out").iterdir()}
        assert found == texts and list(texts) == [URDF_FILE, SRDF_FILE, MJCF_FILE]
        assert capsys.readouterr().out.endswith("pairs of links need not be checked\n")
    (tmp_path / "out" / URDF_FILE).unlink()
    assert main(arguments) == 2
    assert "robot.srdf exists; choose another folder, or --overwrite it" in capsys.readouterr().err
    assert not (tmp_path / "out" / URDF_FILE).exists()  # nothing is written
    cases = {
        bare: (1, "carries no robot"),
        tmp_path / "latin.urdf": (2, "cannot be read"),
        tmp_path / "x": (1, "no bag"),
    }
    for source, (code, message) in cases.items():
        assert main(["bag", "robot", str(source), "-o", str(tmp_path / "new")]) == code
        assert message in capsys.readouterr().err
        assert not (tmp_path / "new").exists()
