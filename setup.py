"""Install sms_handover as a ROS package (colcon) or as a wheel (pip)."""

import sys
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "sms_handover"
ROOT = Path(__file__).resolve().parent

USER_COMMANDS = ["sms-handover = sms_handover.cli.main:main"]
ROS_EXECUTABLES = [
    "handover = sms_handover.cli.main:run_main",
    "plant = sms_handover.nodes.plant:main",
    "trajectory = sms_handover.nodes.trajectory:main",
    "ik = sms_handover.nodes.ik:main",
    "controller = sms_handover.nodes.controller:main",
    "container = sms_handover.nodes.container:main",
    "recorder = sms_handover.nodes.recorder:main",
    "viewer = sms_handover.nodes.viewer:main",
    "player = sms_handover.nodes.player:main",
    "topic_recorder = sms_handover.nodes.topic_recorder:main",
]


def package_version() -> str:
    """Return the version that package.xml declares."""
    version = ElementTree.parse(ROOT / "package.xml").findtext("version")
    if version is None:
        raise SystemExit(f"{PACKAGE}: package.xml has no <version>")
    return version


def shared_files(*folders: str) -> list[tuple[str, list[str]]]:
    """Pair each shipped file with the folder below ``share/`` that mirrors where it lies here."""
    found = [path for folder in folders for path in sorted((ROOT / folder).rglob("*"))]
    files = [path.relative_to(ROOT) for path in found if path.is_file() and "__pycache__" not in path.parts]
    return [(f"share/{PACKAGE}/{path.parent}", [str(path)]) for path in files]


def console_scripts() -> list[str]:
    """Return the executables to install.

    In a ROS workspace, where setup.py itself installs, setup.cfg sends them to lib/sms_handover and
    ``ros2 run`` finds them there. A wheel would put ``plant`` and ``ik`` on everybody's PATH; it
    carries the user's command only, and the nodes run as ``python -m sms_handover.nodes.plant``.
    """
    installed_by_ros = {"install", "develop"} & set(sys.argv)
    return USER_COMMANDS + (ROS_EXECUTABLES if installed_by_ros else [])


setup(
    name=PACKAGE,
    version=package_version(),
    description="Free-floating dual-arm handover: a ROS 2 graph and the numerical core it runs on",
    maintainer="sms_handover maintainers",
    maintainer_email="maintainers@sms-handover.example",
    license="BSD-3-Clause",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "compiled/native/*", "report/web/*", "scene/web/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *shared_files("config", "launch"),
    ],
    python_requires=">=3.10,<3.14",
    install_requires=[
        "coal>=3.0.3,<4",
        "eigenpy>=3.13,<4",
        "lz4>=4.3,<5",
        "mcap>=1.5,<2",
        "numpy>=2.0,<3",
        "pin>=4.0,<5",
        "pyyaml>=6,<7",
        "rich>=13.7,<16",
        "rosbags>=0.11.9,<0.12",
        "zstandard>=0.22,<1",
    ],
    extras_require={
        "analysis": [
            "jinja2>=3.1,<4",
            "matplotlib>=3.10,<4",
            "plotly>=7,<8",  # of it only plotly.js is used
        ],
        "campaign": [
            "distributed>=2026.1,<2027",  # Dask's; pins dask to the same version
            "pyarrow>=18,<27",
            "SALib>=1.5.1,<2",
            "scipy>=1.13,<2",
            "statsmodels>=0.14.4,<0.16",
        ],
        "compiled": ["casadi>=3.7,<4"],  # writes the equations of motion out as C
        "matlab": ["scipy>=1.13,<2"],
        "pandas": ["pandas>=2.2.2,<4"],
        "mpc": ["daqp>=0.11,<0.12"],  # solves the quadratic programs of the law mpc
        "parquet": ["pyarrow>=18,<27"],
        "ros": [  # the graph over DDS; the last two are in interfaces/ and interfaces_tf2/, in no index
            "ros-jazzy-rclpy>=7.1.6,<7.2",
            "ros-jazzy-common-interfaces>=5.3.6,<5.4",
            "ros-jazzy-rmw-fastrtps-cpp>=8.4.3,<8.5",
            "sms_handover_interfaces",
            "tf2_msgs",
        ],
        "test": [
            "casadi>=3.7,<4",
            "daqp>=0.11,<0.12",
            "distributed>=2026.1,<2027",
            "hypothesis>=6.140,<7",  # draws the inputs of the fuzzers
            "jsonschema>=4.26,<5",  # validates files against the schemas for editors
            "mcap-ros2-support>=0.5.7,<1",
            "mypy>=1.15",
            "pandas>=2.2.2,<4",
            "playwright>=1.50,<2",  # drives a Chromium that the machine has
            "pyarrow>=18,<27",
            "pytest>=8.4",
            "pytest-timeout>=2.4,<3",
            "pytest-xdist>=3.8,<4",
            "rerun-sdk>=0.41,<0.42",  # another reader of our bags
            "ruff>=0.6",
            "SALib>=1.5.1,<2",
            "scipy>=1.13,<2",
            "statsmodels>=0.14.4,<0.16",
            "types-PyYAML",
            "types-setuptools",
        ],
        "verify": [  # second engines and methods; mujoco 4 needs Python 3.11
            "casadi>=3.7,<4",
            "daqp>=0.11,<0.12",
            "mink>=1.3,<2",
            "mujoco>=4.0,<5",
        ],
        "docs": [  # the site; Sphinx 9 needs Python 3.11
            "furo>=2025.7",
            "myst-parser>=5.0,<6",
            "sphinx>=9.0,<10",
            "sphinx-copybutton>=0.5.2,<0.6",
        ],
        # second engines for verify --with; the tested ranges
        "mujoco": ["mujoco>=4.0,<5"],  # needs Python 3.11
        # another solver of optimal control; its wheels are silently wrong beside a later pin: make crocoddyl
        "crocoddyl": ["crocoddyl>=3.2.1,<3.3", "libpinocchio==4.0.0", "pin==4.0.0"],
        "basilisk": ["bsk>=2.12,<2.13"],  # its own pins of other packages need an environment of its own
        "bench": [  # what the benchmarks compare with, beyond verify
            "drake>=1.51,<2",
            "matplotlib>=3.10,<4",
            "pin-pink>=4.4,<5",
        ],
    },
    zip_safe=False,
    entry_points={"console_scripts": console_scripts()},
)
