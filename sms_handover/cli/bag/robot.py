"""``sms-handover bag robot``: the robot of a run as URDF, SRDF and MJCF."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping
from pathlib import Path

from sms_handover.bag.info import read_info
from sms_handover.cli.exit_codes import EXIT_OK
from sms_handover.cli.text_files import write_text
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.export.robot_files import robot_files
from sms_handover.launcher.run_folder import bag_of
from sms_handover.model.description import load_robot
from sms_handover.model.urdf import to_urdf

_YAML, _URDF = (".yaml", ".yml"), (".urdf", ".xml")


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write the robot of a run for other programs: robot.urdf as the bag carries it; robot.srdf for\n"
        "MoveIt: a group per arm and one of all arms, end effectors, pairs of links that need not be\n"
        "checked; robot.xml for MuJoCo (MJCF): the same bodies, joints, limits, motors and solids, floating\n"
        "freely and without gravity. A URDF has no rotor inertia, so that of a bag is not in its MJCF."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover bag robot runs/nmpc -o robot\n"
        "  sms-handover bag robot config/robot.yaml -o robot     a description, with its rotor inertia\n"
        "  python -m mujoco.viewer --mjcf robot/robot.xml        look at it\n\n"
        "exit codes: 0 written; 1 damaged bag, or one without a robot; 2 wrong input, or the files exist"
    )
    parser.add_argument(
        "robot",
        type=Path,
        metavar="RUN",
        help="run folder, bag folder or .mcap file; or a robot description as .yaml or .urdf",
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="where to")
    parser.add_argument("--overwrite", action="store_true", help="replace the files if they exist")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    files = robot_files(*_described(options.robot))
    folder: Path = options.output
    there = [name for name in files.texts if (folder / name).exists()]
    if there and not options.overwrite:
        raise ConfigurationError(f"{folder / there[0]} exists; choose another folder, or --overwrite it")
    for name, text in files.texts.items():
        write_text(folder / name, text, parents=True)
        print(folder / name)
    print(f"{files.disabled} pairs of links need not be checked")
    return EXIT_OK


def _described(path: Path) -> tuple[str, Mapping[str, float]]:
    """Return the URDF of a description or bag, and the rotor inertias that are known, by joint."""
    if path.suffix in _YAML:
        robot = load_robot(path)
        joints = [joint for arm in robot.arms for joint in arm.joints]
        return to_urdf(robot), {joint.name: joint.rotor_inertia for joint in joints}
    if path.suffix in _URDF:
        try:
            return path.read_text(encoding="utf-8"), {}
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"{path} cannot be read: {error}") from error
    urdf = read_info(bag_of(path)).urdf_text
    if urdf is None:
        raise BagError(f"{path} carries no robot description")
    return urdf, {}
