"""``sms-handover bag robot``: the robot of a run as URDF, SRDF and MJCF."""

import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping
from pathlib import Path

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.cli.exit_codes import EXIT_OK
from sms_handover.cli.text_files import write_text
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.export.robot_files import robot_files
from sms_handover.launcher.recorded_scenario import scenario_in
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
        "freely and without gravity. Rotor inertia, for which a URDF has no place, is that of the scenario\n"
        "in the bag; a bag of the first edition has none, nor has a .urdf."
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
        return to_urdf(robot), robot.rotor_inertia
    if path.suffix in _URDF:
        try:
            return path.read_text(encoding="utf-8"), {}
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"{path} cannot be read: {error}") from error
    info = read_info(bag_of(path))
    if info.urdf_text is None:
        raise BagError(f"{path} carries no robot description")
    return info.urdf_text, _rotors(info)


def _rotors(info: BagInfo) -> Mapping[str, float]:
    """Return the rotor inertias of the scenario in a bag, none without a scenario.

    Raises BagError if the scenario is not that of the robot description.
    """
    if info.scenario_text is None:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        return scenario_in(info, Path(folder)).truth.robot.description.rotor_inertia
